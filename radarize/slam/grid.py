"""Occupancy grids from rays.

A cell holds the probability that it is occupied, 0 if unknown. Evidence multiplies the odds (adds log odds): a hit by
hit / (1 - hit), a miss by miss / (1 - miss). Per insertion a cell gets either one hit or one miss; a hit has priority
(Hess et al., Real-Time Loop Closure in 2D LIDAR SLAM, ICRA 2016, eq. 2-3).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float, Int, UInt8

from radarize.io.errors import InputError
from radarize.slam.config import GridConfig

_MARGIN = 32  # cells added around the contents of a grid when it grows
#: Maximum number of cells of a map: 0.5 km x 0.5 km at 0.05 m, 512 MB.
_MAX_CELLS = 1 << 27


class Evidence(NamedTuple):
    """Factors of a cell's odds for a hit and a miss, and limits of its probability."""

    hit: float
    miss: float
    lowest: float
    highest: float


@dataclass
class OccupancyGrid:
    """Grid of occupancy probabilities, rows along +y and columns along +x.

    Attributes:
        resolution: cell size, m.
        origin: x, y of the outer corner of cell (0, 0), m.
        probability: 0 where unknown. float32, or uint8 in steps of 1/255 for a finished grid.
    """

    resolution: float
    origin: Float[np.ndarray, "2"]
    probability: Float[np.ndarray, "row column"] | UInt8[np.ndarray, "row column"]

    @classmethod
    def empty(cls, resolution: float) -> "OccupancyGrid":
        """Return a grid without known cells."""
        return cls(resolution, np.zeros(2), np.zeros((1, 1), np.float32))

    def cells(self, points: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "n 2"]:
        """Return row and column of points, inside the grid or not."""
        return np.floor((points - self.origin) / self.resolution).astype(np.int64)[:, ::-1]

    def insert(
        self,
        origins: Float[np.ndarray, "ray 2"],
        ends: Float[np.ndarray, "ray 2"],
        hits: np.ndarray,
        config: GridConfig,
        spread: bool = False,
    ) -> None:
        """Insert the rays of one node: cells along a ray are missed; its last cell is hit where `hits` is true, else
        missed.

        With `spread`, a hit is shared among the four nearest cells, with bilinear weights of the log odds. This places
        surfaces with sub-cell accuracy; otherwise matches would be attracted to the centres of cells. Without it,
        surfaces are one cell thin.
        """
        if not len(ends):
            return
        self._grow(np.minimum(origins.min(axis=0), ends.min(axis=0)), np.maximum(origins.max(axis=0), ends.max(axis=0)))
        _insert(
            self.probability,
            (origins - self.origin) / self.resolution,
            (ends - self.origin) / self.resolution,
            np.ascontiguousarray(hits, dtype=np.bool_),
            Evidence(config.hit / (1 - config.hit), config.miss / (1 - config.miss), config.lowest, config.highest),
            spread,
        )

    def _grow(self, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> None:
        rows, columns = self.probability.shape
        first, last = self.cells(np.stack([low, high])) + [[-1], [1]]  # a spread hit also changes the next cell
        if self.probability.size == 1:  # an empty grid starts where its first rays are
            self.origin = (first[::-1] - _MARGIN) * self.resolution + self.origin
            shape = last - first + 1 + 2 * _MARGIN
            self._check(shape)
            self.probability = np.zeros(tuple(shape), np.float32)
            return
        before = np.where(first < 0, -first + _MARGIN, 0)
        after = np.where(last >= (rows, columns), last - (rows - 1, columns - 1) + _MARGIN, 0)
        if before.any() or after.any():
            self._check(before + (rows, columns) + after)
            self.probability = np.pad(self.probability, np.stack([before, after], axis=1))
            self.origin = self.origin - before[::-1] * self.resolution

    def _check(self, shape: np.ndarray) -> None:
        rows, columns = map(float, shape)
        if rows * columns > _MAX_CELLS:
            raise InputError(
                f"a map of {columns * self.resolution:.0f} x {rows * self.resolution:.0f} m would be needed, expected "
                f"at most {_MAX_CELLS} cells of {self.resolution:g} m: poses or ranges are no metres"
            )

    def crop(self, margin: int = 0) -> "OccupancyGrid":
        """Return the smallest grid with all known cells, padded by `margin` unknown ones."""
        known = np.argwhere(self.probability > 0)
        if not len(known):
            return OccupancyGrid.empty(self.resolution)
        (top, left), (bottom, right) = known.min(axis=0), known.max(axis=0) + 1
        inner = self.probability[top:bottom, left:right]
        origin = self.origin + (np.array([left, top]) - margin) * self.resolution
        return OccupancyGrid(self.resolution, origin, np.pad(inner, margin))

    def quantised(self) -> "OccupancyGrid":
        """Return the grid in uint8, a quarter of the memory; rays can no longer be inserted."""
        if self.probability.dtype == np.uint8:
            return self
        return OccupancyGrid(self.resolution, self.origin, np.rint(255 * self.probability).astype(np.uint8))

    @property
    def unit(self) -> float:
        """Probability per step of `probability`."""
        return 1 / 255 if self.probability.dtype == np.uint8 else 1.0

    def image(self) -> UInt8[np.ndarray, "row column"]:
        """Return the map as an image of map_server, y up: 0 occupied, 254 free, 205 unknown."""
        picture = np.full(self.probability.shape, 205, np.uint8)
        picture[self.probability >= 0.65] = 0
        picture[(self.probability > 0) & (self.probability <= 0.35)] = 254
        return picture[::-1]


@numba.njit(cache=True, nogil=True)
def cross(x0: float, y0: float, x1: float, y1: float, out: np.ndarray) -> int:
    """List the cells (row, column) that a segment crosses, in order, including both ends; returns their number.

    Coordinates in cells. A. Amanatides, A. Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, Eurographics 1987.
    """
    column, row = int(np.floor(x0)), int(np.floor(y0))
    last_column, last_row = int(np.floor(x1)), int(np.floor(y1))
    step_x, step_y = (1 if x1 >= x0 else -1), (1 if y1 >= y0 else -1)
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    delta_x, delta_y = (1 / dx if dx > 0 else np.inf), (1 / dy if dy > 0 else np.inf)
    next_x = ((column + 1 - x0) if step_x > 0 else (x0 - column)) * delta_x if dx > 0 else np.inf
    next_y = ((row + 1 - y0) if step_y > 0 else (y0 - row)) * delta_y if dy > 0 else np.inf
    count = abs(last_column - column) + abs(last_row - row) + 1
    for k in range(count):
        out[k, 0], out[k, 1] = row, column
        # The number of steps is known beforehand; rounding in next_x and next_y cannot lead past the end.
        if column != last_column and (next_x < next_y or row == last_row):
            column += step_x
            next_x += delta_x
        else:
            row += step_y
            next_y += delta_y
    return count


@numba.njit(cache=True, nogil=True)
def _insert(probability, origins, ends, hits, evidence, spread):
    left, top = int(min(origins[:, 0].min(), ends[:, 0].min())) - 1, int(min(origins[:, 1].min(), ends[:, 1].min())) - 1
    right = int(max(origins[:, 0].max(), ends[:, 0].max())) + 1
    bottom = int(max(origins[:, 1].max(), ends[:, 1].max())) + 1
    # Evidence of this insertion per cell: a share of a hit (0...1], a miss (-1), or none (0).
    inserted = np.zeros((bottom - top + 1, right - left + 1), np.float32)
    line = np.empty((2 * (inserted.shape[0] + inserted.shape[1]), 2), np.int64)
    for i in range(len(ends)):
        count = cross(origins[i, 0], origins[i, 1], ends[i, 0], ends[i, 1], line)
        for k in range(count - 1 if hits[i] else count):
            inserted[line[k, 0] - top, line[k, 1] - left] = -1
    for i in range(len(ends)):
        if hits[i] and spread:
            row, column = int(np.floor(ends[i, 1] - 0.5)), int(np.floor(ends[i, 0] - 0.5))
            v, u = ends[i, 1] - 0.5 - row, ends[i, 0] - 0.5 - column
            for j in range(2):
                for k in range(2):
                    share = (v if j else 1 - v) * (u if k else 1 - u)
                    if share > inserted[row + j - top, column + k - left]:
                        inserted[row + j - top, column + k - left] = share
        elif hits[i]:
            inserted[int(np.floor(ends[i, 1])) - top, int(np.floor(ends[i, 0])) - left] = 1
    for row in range(inserted.shape[0]):
        for column in range(inserted.shape[1]):
            share = inserted[row, column]
            if share != 0:
                p = probability[row + top, column + left]
                odds = (p / (1 - p) if p > 0 else 1.0) * (evidence.miss if share < 0 else evidence.hit**share)
                probability[row + top, column + left] = min(max(odds / (1 + odds), evidence.lowest), evidence.highest)
