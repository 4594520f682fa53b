"""Local map: a grid of the contrast around the sensor in the last frames, with which the next frame is matched."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32
from numba import njit
from scipy.ndimage import shift

#: Maximum distance of the sensor from the centre of the grid, m.
_MAX_OFFSET = 1.0
#: Maximum number of cells along a side: it bounds the computing time of a frame, however long the range of the radar
#: is.
_MAX_CELLS = 640


class View(NamedTuple):
    """A frame in polar coordinates.

    Attributes:
        feature: (range, azimuth) contrast, dB.
        ranges: of rows, m, evenly spaced.
        sines: of the azimuths of columns, evenly spaced and symmetric.
    """

    feature: Float32[np.ndarray, "range azimuth"]
    ranges: Float[np.ndarray, "range"]
    sines: Float[np.ndarray, "azimuth"]


class Grid(NamedTuple):
    """Cells of a map: running mean, number of frames in it, and side of a cell (m)."""

    mean: Float32[np.ndarray, "x y"]
    frames: Float32[np.ndarray, "x y"]
    cell: float


class LocalMap:
    """Map of the surroundings, centred on the sensor.

    Args:
        reach: m, maximum range.
        cell: m, side of a cell; larger for radars whose range exceeds `_MAX_CELLS` cells of this size.
    """

    def __init__(self, reach: float, cell: float):
        cell = max(cell, 2 * (reach + 2 * _MAX_OFFSET) / _MAX_CELLS)
        side = 2 * int((reach + 2 * _MAX_OFFSET) / cell)
        mean, frames = np.zeros((2, side, side), np.float32)
        self._grid = Grid(mean, frames, cell)

    def correlate(
        self, view: View, positions: Float[np.ndarray, "yaw 2"], yaws: Float[np.ndarray, "yaw"]
    ) -> tuple[Float[np.ndarray, "yaw"], Float[np.ndarray, "yaw"]]:
        """Return the normalised correlation (-1...1) of a frame with the map at each yaw and its position (m), and the
        share (0...1) of the frame's area that the map covers there."""
        return _correlate(view, self._grid, positions, yaws)

    def blend(self, view: View, position: Float[np.ndarray, "2"], yaw: float, share: float) -> None:
        """Blend a frame into the map, with a weight of at least `share` in the running mean of each cell."""
        _blend(view, self._grid, position, yaw, share)

    def recenter(self, position: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
        """Shift the map such that the sensor is near its centre; returns the position after that. Cells outside of the
        map are discarded."""
        cell = self._grid.cell
        steps = np.rint(position / cell).astype(int)
        if np.abs(steps).max() * cell <= _MAX_OFFSET:
            return position
        mean, frames = (shift(each, -steps, order=0) for each in (self._grid.mean, self._grid.frames))
        self._grid = Grid(mean, frames, cell)
        return position - steps * cell

    def forget(self) -> None:
        """Discard the map."""
        self._grid.mean[:] = self._grid.frames[:] = 0.0


@njit(cache=True, fastmath=True)
def _correlate(view, grid, positions, yaws):
    """Normalised correlation of a polar map with the grid, weighted by the area of polar cells, and their overlap."""
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
    """Running mean of polar maps on the grid; the weight of a new value is 1/count, at least `least`."""
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
