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
#: Probes of a cell, in halves of its extent: lateral position, or all of it, radial, upward.
_ALL = None
_CENTRAL = ((_ALL, 0, 0), (0, _ALL, 0))
_OTHERS = (
    *((_ALL, radial, up) for radial, up in product((-1, 0, 1), (-1, 0, 1)) if radial or up),
    *((lateral, _ALL, up) for lateral, up in product((-1, 0, 1), (-1, 0, 1)) if lateral or up),
)


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
        found, mirrored = [], []
        for some in paths:
            types = np.where(some.level, PathType.FLOOR_CEILING, PathType.DIRECT).astype(np.uint8)
            types[some.through] = PathType.THROUGH_SLAB
            types[some.moving] = PathType.MOVING
            found.append(types)
            mirrored.append(np.flatnonzero((some.bounces > 0) & ~some.moving))
        poses = zip(paths, lengths, mirrored, positions, rotations, strict=True)
        places = [self.apparent(p[rows], length[rows], *pose) for p, length, rows, *pose in poses]
        shared = [np.unique(each, axis=0, return_inverse=True) for each in places]
        each = [len(some) for some, _ in shared]
        real = self._near_surface(np.concatenate([some for some, _ in shared]), np.repeat(positions, each, axis=0))
        for types, rows, (_, which), near in zip(
            found, mirrored, shared, np.split(real, np.cumsum(each)), strict=False
        ):
            types[rows[~near[which.ravel()]]] = PathType.GHOST
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
        row = lengths[:, self._row[0]] / self.config.wavelength
        waves = np.exp(2j * np.pi * (row - row[:, :1])).astype(np.complex64)
        sine = BEAMS[np.argmax(np.abs(waves @ self._steering), axis=1)] if len(paths) else np.zeros(0)
        way = paths.apparent(position) - position
        way /= np.maximum(np.linalg.norm(way, axis=2, keepdims=True), 1e-9)
        rise = np.clip(RISE * np.rint(way.mean(axis=1) @ rotation[:, 2] / RISE), -0.999, 0.999)
        sine = np.clip(sine, -np.sqrt(1 - rise**2), np.sqrt(1 - rise**2))
        ahead = np.sqrt(np.maximum(1 - rise**2 - sine**2, 0))
        step = self.config.range_resolution / STEPS
        range_ = step * np.rint(lengths.mean(axis=1) / 2 / step)
        return position + range_[:, None] * (np.stack([ahead, sine, rise], axis=1) @ rotation.T)

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
        for probes in (_CENTRAL, _OTHERS):
            rows = np.flatnonzero(~real)
            for probe in probes:
                here = np.array([0.0 if part is _ALL else part for part in probe])
                along = np.array([1.0 if part is _ALL else 0.0 for part in probe])
                middle, half = (places[rows] + np.einsum("k,nkd->nd", here, extent[rows]),
                                np.einsum("k,nkd->nd", along, extent[rows]))  # fmt: skip
                real[rows] |= self.scene.occluded(middle - half, middle + half, margin=0.0)
        return real

    def _extents(self, away: Float[np.ndarray, "place 3"]) -> Float[np.ndarray, "place 3 3"]:
        """Half the extent of cells so far away from the radar: lateral, radial and upward, levelled, m."""
        range_ = np.linalg.norm(away, axis=1)
        radial = away / range_[:, None]
        lateral = np.stack([-radial[:, 1], radial[:, 0], np.zeros(len(away))], axis=1)
        lateral /= np.maximum(np.linalg.norm(lateral, axis=1, keepdims=True), 1e-9)
        left = self._row[1]
        aperture = np.ptp(left) * len(left) / max(len(left) - 1, 1)
        beam = 0.443 * self.config.wavelength / aperture  # half-power half width of a uniform row, sine
        strong = self.pattern.elevation_gain > self.pattern.elevation_gain[0] / np.sqrt(2)
        rise = np.tan(np.deg2rad(0.5 * np.argmin(strong)) if not strong.all() else np.pi / 4)
        up = np.broadcast_to([0.0, 0.0, 1.0], away.shape)
        return np.stack([
            (range_ * beam)[:, None] * lateral, self.config.range_resolution * radial, (range_ * rise)[:, None] * up
        ], axis=1)  # fmt: skip
