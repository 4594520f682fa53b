"""A grid of what the last frames looked like around the sensor, against which the next one is laid."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32
from numba import njit
from scipy.ndimage import shift as moved

#: m, by how far the sensor may be off the grid's middle.
_OFF_MIDDLE = 1.0
#: Cells along a side of the map: what a frame takes does not grow with how far the radar sees.
_MOST = 640


class View(NamedTuple):
    """A frame as the map sees it.

    Attributes:
        feature: (range, azimuth) contrast, dB.
        ranges: of rows, m, evenly spaced.
        sines: of the columns' azimuths, evenly spaced and symmetric.
    """

    feature: Float32[np.ndarray, "range azimuth"]
    ranges: Float[np.ndarray, "range"]
    sines: Float[np.ndarray, "azimuth"]


class Grid(NamedTuple):
    """Cells of a map: mean of what was seen there, how often it was, and the cells' side, m."""

    mean: Float32[np.ndarray, "x y"]
    count: Float32[np.ndarray, "x y"]
    cell: float


class LocalMap:
    """A map as large as the sensor sees, which moves along with it.

    Args:
        reach: m, the farthest range.
        cell: m, least side of a cell; so many cells as there may be cover what a radar of coarse range sees in larger
            ones, which its range cells are anyway.
    """

    def __init__(self, reach: float, cell: float):
        cell = max(cell, 2 * (reach + 2 * _OFF_MIDDLE) / _MOST)
        side = 2 * int((reach + 2 * _OFF_MIDDLE) / cell)
        self._grid = Grid(*np.zeros((2, side, side), np.float32), cell)

    def correlate(
        self, view: View, positions: Float[np.ndarray, "yaw 2"], yaws: Float[np.ndarray, "yaw"]
    ) -> tuple[Float[np.ndarray, "yaw"], Float[np.ndarray, "yaw"]]:
        """Correlation (-1...1) of a frame with the map, seen at each yaw from its position (m), and how much of the
        frame's area (0...1) the map knows there."""
        return _correlate(view, self._grid, positions, yaws)

    def blend(self, view: View, position: Float[np.ndarray, "2"], yaw: float, share: float) -> None:
        """A frame joins the map: where it had been seen often, the frame's share of the cell's mean is `share`."""
        _blend(view, self._grid, position, yaw, share)

    def recenter(self, position: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
        """Keep the sensor in the map's middle; its position after that. What leaves the map is forgotten."""
        cell = self._grid.cell
        steps = np.rint(position / cell).astype(int)
        if np.abs(steps).max() * cell <= _OFF_MIDDLE:
            return position
        self._grid = Grid(*(moved(each, -steps, order=0) for each in self._grid[:2]), cell)
        return position - steps * cell

    def forget(self) -> None:
        """Begin anew."""
        self._grid.mean[:] = self._grid.count[:] = 0.0


@njit(cache=True, fastmath=True)
def _correlate(view, grid, positions, yaws):
    """Normalised correlation of a polar map with the grid, and their overlap; cells weigh by area."""
    (feature, ranges, sines), (mean, count, cell) = view, grid
    side = mean.shape[0]
    correlation, overlap = np.zeros(len(yaws)), np.zeros(len(yaws))
    ahead, left = np.empty(feature.shape, np.float32), np.empty(feature.shape, np.float32)
    for i in range(len(ranges)):
        for j in range(len(sines)):
            ahead[i, j] = ranges[i] / cell * np.sqrt(max(1 - sines[j] ** 2, 0.0))
            left[i, j] = ranges[i] / cell * sines[j]
    for k in range(len(yaws)):
        c, s = np.cos(yaws[k]), np.sin(yaws[k])
        origin_x, origin_y = positions[k, 0] / cell + side / 2, positions[k, 1] / cell + side / 2
        n = sum_f = sum_m = sum_ff = sum_mm = sum_fm = 0.0
        for i in range(len(ranges)):
            w = ranges[i]
            for j in range(len(sines)):
                at_x, at_y = origin_x + c * ahead[i, j] - s * left[i, j], origin_y + s * ahead[i, j] + c * left[i, j]
                ix, iy = int(at_x), int(at_y)
                if ix < 0 or iy < 0 or ix >= side - 1 or iy >= side - 1:
                    continue
                if min(count[ix, iy], count[ix + 1, iy], count[ix, iy + 1], count[ix + 1, iy + 1]) <= 0:
                    continue
                u, v = at_x - ix, at_y - iy
                m = (mean[ix, iy] * (1 - u) + mean[ix + 1, iy] * u) * (1 - v)
                m += (mean[ix, iy + 1] * (1 - u) + mean[ix + 1, iy + 1] * u) * v
                f = feature[i, j]
                n += w
                sum_f += w * f
                sum_m += w * m
                sum_ff += w * f * f
                sum_mm += w * m * m
                sum_fm += w * f * m
        if n > 0:
            f_var, m_var = sum_ff - sum_f * sum_f / n, sum_mm - sum_m * sum_m / n
            correlation[k] = (sum_fm - sum_f * sum_m / n) / np.sqrt(max(f_var * m_var, 1e-12))
            overlap[k] = n / (ranges.sum() * len(sines))
    return correlation, overlap


@njit(cache=True, fastmath=True)
def _blend(view, grid, position, yaw, least):
    """Running mean of polar maps on the grid; a cell's newest value weighs 1/count, but no less than `least`."""
    (feature, ranges, sines), (mean, count, cell) = view, grid
    side, (rows, columns) = mean.shape[0], feature.shape
    nearest, spacing, field = ranges[0], ranges[1] - ranges[0], sines[-1]
    x, y = position
    c, s = np.cos(yaw), np.sin(yaw)
    reach = int((nearest + spacing * rows) / cell) + 1
    middle_x, middle_y = int(x / cell + side / 2), int(y / cell + side / 2)
    for ix in range(max(0, middle_x - reach), min(side, middle_x + reach)):
        for iy in range(max(0, middle_y - reach), min(side, middle_y + reach)):
            dx, dy = (ix - side / 2) * cell - x, (iy - side / 2) * cell - y
            ahead, left = c * dx + s * dy, c * dy - s * dx
            ground = np.sqrt(dx * dx + dy * dy)
            if ahead <= 0:
                continue
            i, j = (ground - nearest) / spacing, (left / ground + field) / (2 * field) * (columns - 1)
            if i < 0 or j < 0 or i >= rows - 1 or j >= columns - 1:
                continue
            a, b = int(i), int(j)
            u, v = i - a, j - b
            f = (feature[a, b] * (1 - v) + feature[a, b + 1] * v) * (1 - u)
            f += (feature[a + 1, b] * (1 - v) + feature[a + 1, b + 1] * v) * u
            count[ix, iy] += 1
            mean[ix, iy] += max(1 / count[ix, iy], least) * (f - mean[ix, iy])
