"""The type of a path, as a user of the radar means it: an echo of what is really there, or a ghost.

A ghost is an echo whose apparent place is farther from every surface that is really there than the radar can resolve.
The apparent place is where the radar puts the echo: at half the path's length, at the peak of the antenna row's beam
pattern, at the path's mean elevation. The cell that the radar cannot resolve is a range bin deep either way, as wide as
the row's half-power beam, and as high as the element's; a floor or ceiling fills it only within a range bin. So a
corner of two walls is no ghost, nor is the image of a thing in the wall that it touches.

How a path came about stands in its own columns (`paths.Paths`: bounces, through, blocked, moving), so that any other
definition can be made from them.
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from itertools import product

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt8
from numba import njit

from radarize.radar.array import azimuth_row, virtual_positions
from radarize.radar.config import RadarConfig
from radarsim.propagation.antenna import GainPattern
from radarsim.propagation.paths import Paths
from radarsim.world.scene import Scene

#: Beams over which the peak is looked for, sines of azimuth.
BEAMS = np.linspace(-0.95, 0.95, 96)
#: Apparent places are rounded to so many steps a range bin, and to sines of elevation of this step: many paths, those
#: out and back in either order among them, then share a place.
STEPS, RISE = 4, 1 / 64
#: Probes of a cell, in halves of its extent: lateral position, or all of it, radial, upward; first those that meet a
#: surface most often.
_ALL = None
_PROBES = (
    (_ALL, 0, 0), (0, _ALL, 0),
    *((_ALL, radial, up) for up, radial in product((1, -1, 0), (-1, 1, 0)) if radial or up),
    *((lateral, _ALL, up) for up, lateral in product((1, -1, 0), (-1, 1, 0)) if lateral or up),
)  # fmt: skip


class PathType(IntEnum):
    """Of several that fit, the last but for a ghost through a slab, which is a ghost."""

    DIRECT = 0  #: corners of mirrors, too: they echo from where they stand
    FLOOR_CEILING = 1
    THROUGH_SLAB = 2  #: of something behind a wall, pane or door
    GHOST = 3
    MOVING = 4  #: something on the way moves


@dataclass(frozen=True, eq=False)
class PathTypes:
    """Tells paths apart by what a radar can resolve.

    Attributes:
        scene: whose surfaces are really there; None: there are none.
        config, pattern: of the radar.
    """

    scene: Scene | None
    config: RadarConfig
    pattern: GainPattern

    def __call__(
        self,
        paths: list[Paths],
        lengths: list[Float[np.ndarray, "path virtual"]],
        positions: Float[np.ndarray, "frame 3"],
        rotations: Float[np.ndarray, "frame 3 3"],
    ) -> list[UInt8[np.ndarray, "path"]]:
        """Type of each path of some frames.

        Args:
            paths, lengths: of each frame, and how long they are in the middle of the burst, m.
            positions, rotations: of the sensor then, m, sensor to world.
        """
        found, mirrored, cells = [], [], []
        for some, length, position, rotation in zip(paths, lengths, positions, rotations, strict=True):
            types = np.where(some.level, PathType.FLOOR_CEILING, PathType.DIRECT).astype(np.uint8)
            types[some.through] = PathType.THROUGH_SLAB
            types[some.moving] = PathType.MOVING
            rows = np.flatnonzero((some.bounces > 0) & ~some.moving)
            found.append(types)
            mirrored.append(rows)
            cells.append(self._cells(some[rows], length[rows], position, rotation))
        frame = np.repeat(np.arange(len(cells)), [len(some) for some in cells])
        cell = np.concatenate(cells)
        size = cell.max(axis=0, initial=0) + 1
        _, first, which = np.unique(
            np.ravel_multi_index((frame, *cell.T), (len(cells), *size)), return_index=True, return_inverse=True
        )
        places = self._places(cell[first], positions[frame[first]], rotations[frame[first]])
        ghosts = ~self._near_surface(places, positions[frame[first]])[which]
        for k, (types, rows) in enumerate(zip(found, mirrored, strict=True)):
            types[rows[ghosts[frame == k]]] = PathType.GHOST
        return found

    @cached_property
    def _row(self) -> tuple[Int[np.ndarray, "antenna"], Float[np.ndarray, "antenna"]]:
        """The antenna row, and how far to the left its antennas are, m."""
        row = azimuth_row(self.config)
        return row, virtual_positions(self.config).reshape(-1, 3)[row, 1]

    @cached_property
    def _steering(self) -> Complex[np.ndarray, "antenna beam"]:
        left = self._row[1]
        return np.exp(2j * np.pi / self.config.wavelength * left[:, None] * BEAMS).astype(np.complex64)

    def apparent(
        self, paths: Paths, lengths: Float[np.ndarray, "path virtual"], position: Float[np.ndarray, "3"],
        rotation: Float[np.ndarray, "3 3"],
    ) -> Float[np.ndarray, "path 3"]:  # fmt: skip
        """Where the radar puts paths of one frame, m; arguments as for a call."""
        n = len(paths)
        cells = self._cells(paths, lengths, position, rotation)
        return self._places(cells, np.broadcast_to(position, (n, 3)), np.broadcast_to(rotation, (n, 3, 3)))

    def _cells(
        self, paths: Paths, lengths: Float[np.ndarray, "path virtual"], position: Float[np.ndarray, "3"],
        rotation: Float[np.ndarray, "3 3"],
    ) -> Int[np.ndarray, "path 3"]:  # fmt: skip
        """The same as numbers of the step in range, the beam, and the step in elevation from straight down."""
        cells, way = np.empty((len(paths), 3), np.int64), paths.apparent(position) - position
        rise = way @ rotation[:, 2] / np.maximum(np.linalg.norm(way, axis=2), 1e-9)
        cells[:, 2] = np.rint((rise.mean(axis=1) + 1) / RISE)
        step = self.config.range_resolution / STEPS
        _beams(lengths, self._row[0], self.config.wavelength, step, self._steering, cells)
        return cells

    def _places(
        self, cells: Int[np.ndarray, "cell 3"], positions: Float[np.ndarray, "cell 3"],
        rotations: Float[np.ndarray, "cell 3 3"],
    ) -> Float[np.ndarray, "cell 3"]:  # fmt: skip
        """Middles of cells, m."""
        range_ = self.config.range_resolution / STEPS * cells[:, 0]
        rise = np.clip(RISE * cells[:, 2] - 1, -0.999, 0.999)
        most = np.sqrt(1 - rise**2)
        sine = np.clip(BEAMS[cells[:, 1]], -most, most)
        ahead = np.sqrt(np.maximum(1 - rise**2 - sine**2, 0))
        return positions + range_[:, None] * np.einsum("nij,nj->ni", rotations, np.stack([ahead, sine, rise], axis=1))

    def _near_surface(
        self, places: Float[np.ndarray, "place 3"], positions: Float[np.ndarray, "place 3"]
    ) -> Bool[np.ndarray, "place"]:
        """Whether a surface passes through the cells about some places."""
        real = np.zeros(len(places), bool)
        if self.scene is None or not len(places):
            return real
        extent = self._extents(places - positions)
        bin_ = np.array([0.0, 0.0, self.config.range_resolution])
        real |= self.scene.occluded(places - bin_, places + bin_, margin=0.0)
        rows = np.flatnonzero(~real)
        for probe in _PROBES:
            here = np.array([0.0 if part is _ALL else part for part in probe])
            along = np.array([1.0 if part is _ALL else 0.0 for part in probe])
            begin, end = np.empty((2, len(rows), 3))
            _ends(places, extent, rows, (here - along, here + along), (begin, end))
            met = self.scene.occluded(begin, end, margin=0.0)
            real[rows[met]] = True
            rows = rows[~met]
        return real

    def _extents(self, away: Float[np.ndarray, "place 3"]) -> Float[np.ndarray, "place 3 3"]:
        """Half the extent of cells so far away from the radar: lateral, radial and upward, levelled, m."""
        range_ = np.linalg.norm(away, axis=1)
        radial = away / range_[:, None]
        lateral = np.stack([-radial[:, 1], radial[:, 0], np.zeros(len(away))], axis=1)
        lateral /= np.maximum(np.linalg.norm(lateral, axis=1, keepdims=True), 1e-9)
        left = self._row[1]
        aperture = np.ptp(left) * len(left) / max(len(left) - 1, 1)
        # half-power half width of a uniform row, sine; one antenna tells no directions apart
        beam = 0.443 * self.config.wavelength / aperture if aperture > 0 else 1.0
        strong = self.pattern.elevation_gain > self.pattern.elevation_gain[0] / np.sqrt(2)
        rise = np.tan(np.deg2rad(0.5 * np.argmin(strong)) if not strong.all() else np.pi / 4)
        up = np.broadcast_to([0.0, 0.0, 1.0], away.shape)
        return np.stack([
            (range_ * beam)[:, None] * lateral, self.config.range_resolution * radial, (range_ * rise)[:, None] * up
        ], axis=1)  # fmt: skip


@njit(cache=True)
def _ends(places, extents, rows, probe, ends):
    """Both ends of a probe of some cells, which it is given in halves of their extent."""
    for k in range(2):
        for i, row in enumerate(rows):
            for d in range(3):
                ends[k][i, d] = places[row, d]
                for axis in range(3):
                    ends[k][i, d] += probe[k][axis] * extents[row, axis, d]


@njit(cache=True, fastmath=True)
def _beams(lengths, row, wavelength, step, steering, cells):
    """Writes the step in range and the beam in which a row of antennas sees each path strongest."""
    antennas, beams = steering.shape
    real, imaginary = steering.real.copy(), steering.imag.copy()
    re, im = np.empty(beams, np.float32), np.empty(beams, np.float32)
    for i in range(len(cells)):
        cells[i, 0] = np.rint(lengths[i].mean() / (2 * step))
        re[:], im[:] = real[0], imaginary[0]
        for a in range(1, antennas):
            phase = np.float32(2 * np.pi / wavelength * (lengths[i, row[a]] - lengths[i, row[0]]))
            c, s = np.cos(phase), np.sin(phase)
            for b in range(beams):
                re[b] += c * real[a, b] - s * imaginary[a, b]
                im[b] += c * imaginary[a, b] + s * real[a, b]
        for b in range(beams):
            re[b] = re[b] * re[b] + im[b] * im[b]
        cells[i, 1] = np.argmax(re) if antennas > 1 else beams // 2
