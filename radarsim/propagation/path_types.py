"""Type of a path: an echo of a real surface, or a ghost, as the radar's resolution allows to distinguish.

A ghost is an echo whose apparent place is farther from every real surface than the radar can resolve.
The apparent place is where the radar locates the echo: at half the path's length, at the peak of the antenna row's beam
pattern, at the path's mean elevation. The resolution cell extends a range bin in either direction, is as wide as
the row's half-power beam, and as high as the element's; for a floor or ceiling it extends only a range bin. So a
corner of two walls is no ghost, nor is the image of an object in the wall that it touches.

The origin of a path is in its own columns (`paths.Paths`: bounces, through, blocked, moving), so that other
definitions are possible.
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

#: Beams in which the peak is searched, sines of azimuth.
BEAMS = np.linspace(-0.95, 0.95, 96)
#: Number of steps per range bin, and step of the sine of elevation, to which apparent places are rounded, so that many
#: paths, such as the two directions of a ghost, share a place.
STEPS, RISE = 4, 1 / 64
#: Probes of a cell, in halves of its extent: lateral position or extent, radial, vertical; those that meet a surface
#: most often come first.
_ALL = None
_PROBES = (
    (_ALL, 0, 0), (0, _ALL, 0),
    *((_ALL, radial, up) for up, radial in product((1, -1, 0), (-1, 1, 0)) if radial or up),
    *((lateral, _ALL, up) for up, lateral in product((1, -1, 0), (-1, 1, 0)) if lateral or up),
)  # fmt: skip


class PathType(IntEnum):
    """If several types apply, the last one, except for a ghost through a slab, which is a ghost."""

    DIRECT = 0  #: includes corners of mirrors, whose echo comes from where they are
    FLOOR_CEILING = 1
    THROUGH_SLAB = 2  #: target behind a wall, pane or door
    GHOST = 3
    MOVING = 4  #: something on the path moves


@dataclass(frozen=True, eq=False)
class PathTypes:
    """Classifier of paths by the radar's resolution.

    Attributes:
        scene: scene with the real surfaces; None: there are none.
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
            paths, lengths: paths of each frame, and their lengths at the centre of the burst, m.
            positions, rotations: sensor poses at that time, m, sensor to world.
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
        """Antenna row, and positions of its antennas to the left, m."""
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
        """Apparent places of the paths of one frame, m; arguments as for a call."""
        n = len(paths)
        cells = self._cells(paths, lengths, position, rotation)
        return self._places(cells, np.broadcast_to(position, (n, 3)), np.broadcast_to(rotation, (n, 3, 3)))

    def _cells(
        self, paths: Paths, lengths: Float[np.ndarray, "path virtual"], position: Float[np.ndarray, "3"],
        rotation: Float[np.ndarray, "3 3"],
    ) -> Int[np.ndarray, "path 3"]:  # fmt: skip
        """The same as indices of the range step, the beam, and the elevation step from straight down."""
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
        """Centres of cells, m."""
        range_ = self.config.range_resolution / STEPS * cells[:, 0]
        rise = np.clip(RISE * cells[:, 2] - 1, -0.999, 0.999)
        most = np.sqrt(1 - rise**2)
        sine = np.clip(BEAMS[cells[:, 1]], -most, most)
        ahead = np.sqrt(np.maximum(1 - rise**2 - sine**2, 0))
        return positions + range_[:, None] * np.einsum("nij,nj->ni", rotations, np.stack([ahead, sine, rise], axis=1))

    def _near_surface(
        self, places: Float[np.ndarray, "place 3"], positions: Float[np.ndarray, "place 3"]
    ) -> Bool[np.ndarray, "place"]:
        """Whether a surface passes through the resolution cell at some places."""
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
        """Half extents of cells at given offsets from the radar: lateral, radial and vertical, levelled, m."""
        range_ = np.linalg.norm(away, axis=1)
        radial = away / range_[:, None]
        lateral = np.stack([-radial[:, 1], radial[:, 0], np.zeros(len(away))], axis=1)
        lateral /= np.maximum(np.linalg.norm(lateral, axis=1, keepdims=True), 1e-9)
        left = self._row[1]
        aperture = np.ptp(left) * len(left) / max(len(left) - 1, 1)
        # half-power half width of a uniform row, sine; one antenna has no angular resolution
        beam = 0.443 * self.config.wavelength / aperture if aperture > 0 else 1.0
        strong = self.pattern.elevation_gain > self.pattern.elevation_gain[0] / np.sqrt(2)
        rise = np.tan(np.deg2rad(0.5 * np.argmin(strong)) if not strong.all() else np.pi / 4)
        up = np.broadcast_to([0.0, 0.0, 1.0], away.shape)
        return np.stack([
            (range_ * beam)[:, None] * lateral, self.config.range_resolution * radial, (range_ * rise)[:, None] * up
        ], axis=1)  # fmt: skip


@njit(cache=True)
def _ends(places, extents, rows, probe, ends):
    """Both ends of a probe of some cells, given in halves of their extent."""
    for k in range(2):
        for i, row in enumerate(rows):
            for d in range(3):
                ends[k][i, d] = places[row, d]
                for axis in range(3):
                    ends[k][i, d] += probe[k][axis] * extents[row, axis, d]


@njit(cache=True, fastmath=True)
def _beams(lengths, row, wavelength, step, steering, cells):
    """Write the range step and the beam with the strongest response of a row of antennas to each path."""
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
