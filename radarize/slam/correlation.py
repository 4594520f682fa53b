"""Correlative search: the pose in a window at which a scan's points fall on the most probable cells.

Branch and bound over a pyramid (Hess et al., ICRA 2016, section V.C). Level h holds, on cells of 2^h, the maximum over
2 x 2 such cells, so that all poses whose shift lies in a block of 2^h x 2^h cells are bounded by one look-up per point:
the best pose of the window is found as if all had been tried. A pyramid takes 4/3 of the bytes of its grid.

Echoes should lie where the map is occupied. Places in front of them, as seen by the sensor, should lie where it is
free: a wall seen from its other side, which is what a corridor's two walls are to each other, is another wall.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.slam.grid import OccupancyGrid

_STEPS = 9  # between the middle of the window and its edge, at which `scatter` looks
_TURN = 0.05  # rad between them, at most
_BLIND = 0.1  # least share of a window's information that counts


class Levels(NamedTuple):
    """Bounds of a grid at falling resolution, probabilities in 1/255, all levels in one buffer.

    Attributes:
        buffer: levels one after the other, row by row: first of being occupied, then, if asked for, of being free.
        starts, rows, columns: of each level; from level 1 on, cell (-1, -1) is stored at (0, 0).
    """

    buffer: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    columns: np.ndarray


class Window(NamedTuple):
    """Poses that are tried: shifts of up to `half` cells each way, and angles (rad).

    Attributes:
        angles: in the grid's frame.
        prices: subtracted from the score at each angle.
        half: cells.
        price: subtracted from the score per square cell away from the middle.
    """

    angles: np.ndarray
    prices: np.ndarray
    half: int
    price: float


@dataclass(frozen=True)
class Pyramid:
    """A grid, ready to be searched.

    Attributes:
        resolution, origin: of level 0, as in `OccupancyGrid`.
        half: half-width of the largest window that can be searched, cells; twice this much empty space is added around
            the grid, so that the search need not look where the grid ends.
        levels: its bounds.
    """

    resolution: float
    origin: Float[np.ndarray, "2"]
    half: int
    levels: Levels

    @classmethod
    def of(cls, grid: OccupancyGrid, levels: int, distance: float, free: bool = False) -> "Pyramid":
        """Pyramid with `levels` halvings for windows of half-width up to `distance` (m)."""
        half = int(np.ceil(distance / grid.resolution))
        rows, columns = np.array(grid.probability.shape)[:, None] + 4 * half
        size = 1 << np.arange(levels + 1)
        rim = np.minimum(np.arange(levels + 1), 1)
        rows, columns = (rows + size - 1) // size + rim, (columns + size - 1) // size + rim
        sizes = rows * columns
        starts = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        probability = grid.quantised().probability
        layers = [probability, np.where((probability > 0) & (probability < 128), np.uint8(255), np.uint8(0))]
        buffer = np.zeros((1 + free, sizes.sum()), np.uint8)
        for layer, values in zip(buffer, layers, strict=False):
            base = layer[: sizes[0]].reshape(rows[0], columns[0])
            base[2 * half : rows[0] - 2 * half, 2 * half : columns[0] - 2 * half] = values
            _fill(layer, starts, rows, columns)
        origin = grid.origin - 2 * half * grid.resolution
        return cls(grid.resolution, origin, half, Levels(buffer.ravel(), starts, rows, columns))


def search(
    pyramid: Pyramid,
    points: Float[np.ndarray, "n 2"],
    guess: Float[np.ndarray, "3"],
    *,
    distance: float,
    angle: float,
    min_score: float,
    penalty: tuple[float, float] = (0.0, 0.0),
    fronts: Float[np.ndarray, "m 2"] | None = None,
) -> tuple[Float[np.ndarray, "3"], float] | None:
    """Best pose of a window around a guess, or None if none scores above `min_score`.

    Args:
        pyramid: of the submap.
        points: in the scan's frame, m.
        guess: middle of the window, in the submap's frame.
        distance, angle: half-widths of the window, m and rad. The angle steps by one cell at the 90th percentile of
            the points' ranges.
        min_score: mean probability at the points and, if there are any, of being free at the fronts, the lower of
            both, 0...1.
        penalty: subtracted from the score per square metre and per square radian away from the guess.
        fronts: places in front of the points, m, for a pyramid that knows what is free.

    Returns:
        Pose in the submap's frame and its score, penalty subtracted.
    """
    if not len(points):
        return None
    reach = max(float(np.sort(np.hypot(points[:, 0], points[:, 1]))[int(0.9 * (len(points) - 1))]), 1.0)
    step = pyramid.resolution / reach
    turns = int(np.ceil(angle / step))
    angles = np.arange(-turns, turns + 1) * step
    half = min(int(np.ceil(distance / pyramid.resolution)), pyramid.half)
    everything = points if fronts is None else np.concatenate([points, fronts])
    found, score, a, dx, dy = _search(
        pyramid.levels,
        np.ascontiguousarray(everything, float) * (1 / pyramid.resolution),
        len(points),
        (np.asarray(guess, float)[:2] - pyramid.origin) / pyramid.resolution,
        Window(guess[2] + angles, angles**2 * penalty[1], half, penalty[0] * pyramid.resolution**2),
        min_score,
    )
    if not found:
        return None
    shift = np.array([dx, dy]) * pyramid.resolution
    return np.array([guess[0] + shift[0], guess[1] + shift[1], guess[2] + angles[a]]), score


def scatter(
    pyramid: Pyramid,
    points: Float[np.ndarray, "n 2"],
    pose: Float[np.ndarray, "3"],
    *,
    distance: float,
    angle: float,
    sigma: float,
) -> Float[np.ndarray, "3 3"]:
    """Covariance of a pose that was found, by how well its points fit elsewhere.

    The curvature at the best pose knows nothing of a second place that fits as well, and takes the roughness of a
    straight wall for knowledge of where along it one is. So poses of a whole window around it are weighed by their
    likelihood, and the second moment is taken (Olson, Real-Time Correlative Scan Matching, ICRA 2009). What the
    window's own size says is taken off again: where all of it fits alike, nothing is known.

    Args:
        pyramid: of the submap.
        points: in the scan's frame, m.
        pose: in the submap's frame.
        distance, angle: half-widths of the window, m and rad.
        sigma: standard deviation of the residual of one point, as in `radarize.slam.matcher`.

    Returns:
        for (x, y, yaw) in the scan's frame.
    """
    half = min(int(np.ceil(distance / pyramid.resolution)), pyramid.half)
    stride = max(half // _STEPS, 1)
    half -= half % stride
    shifts = np.arange(-half, half + 1, stride)
    turns = np.linspace(-angle, angle, 2 * int(np.ceil(angle / _TURN)) + 1)
    residuals = (1 - np.maximum(2 * np.arange(256) / 255 - 1, 0)) ** 2
    rows, columns = pyramid.levels.rows[0], pyramid.levels.columns[0]
    cost = _costs(
        pyramid.levels.buffer[: rows * columns].reshape(rows, columns),
        np.ascontiguousarray(points, float) / pyramid.resolution,
        (pose[:2] - pyramid.origin) / pyramid.resolution,
        pose[2] + turns,
        shifts,
        residuals / sigma**2,
    )
    weight = np.exp((cost.min() - cost) / 2)
    away = np.stack(np.meshgrid(turns, shifts, shifts, indexing="ij"), axis=-1)[..., ::-1].reshape(-1, 3)
    window = np.array([half, half, angle])
    away = away / window  # -1...1
    moment = (away * weight.reshape(-1, 1)).T @ away / weight.sum()
    share, axes = np.linalg.eigh(3 * moment)  # 1: as much as a window without preference
    spread = axes * (share / np.maximum(1 - share, _BLIND)) @ axes.T / 3
    size = window * [pyramid.resolution, pyramid.resolution, 1]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * size
    return turn @ spread @ turn.T


@numba.njit(cache=True, nogil=True)
def _costs(grid, points, origin, angles, shifts, residuals):
    # Sum of the residuals at the points, of every pose of the window; shifts in cells.
    costs = np.empty((len(angles), len(shifts), len(shifts)))
    rows, columns = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    low, high = shifts[0], shifts[-1]
    for a in range(len(angles)):
        cos, sin = np.cos(angles[a]), np.sin(angles[a])
        n = 0
        for k in range(len(points)):
            column = int(np.floor(cos * points[k, 0] - sin * points[k, 1] + origin[0]))
            row = int(np.floor(sin * points[k, 0] + cos * points[k, 1] + origin[1]))
            if row + low >= 0 and column + low >= 0 and row + high < grid.shape[0] and column + high < grid.shape[1]:
                rows[n], columns[n] = row, column
                n += 1
        outside = (len(points) - n) * residuals[0]
        for i in range(len(shifts)):
            for j in range(len(shifts)):
                cost = outside
                for k in range(n):
                    cost += residuals[grid[rows[k] + shifts[i], columns[k] + shifts[j]]]
                costs[a, i, j] = cost
    return costs


@numba.njit(cache=True, nogil=True)
def _fill(buffer, starts, rows, columns):
    # Cell (i, j) of level h bounds base cells (i - 1) * size ... (i + 1) * size - 1 along each axis: the maximum of
    # 2 x 2 blocks of `size`, which in turn are the maxima of four blocks half as large.
    blocks = buffer[: rows[0] * columns[0]].reshape((rows[0], columns[0]))
    for h in range(1, len(starts)):
        coarse = np.zeros((rows[h] - 1, columns[h] - 1), np.uint8)
        for row in range(blocks.shape[0]):
            for column in range(blocks.shape[1]):
                value = blocks[row, column]
                if value > coarse[row >> 1, column >> 1]:
                    coarse[row >> 1, column >> 1] = value
        blocks = coarse
        plane = buffer[starts[h] : starts[h] + rows[h] * columns[h]].reshape((rows[h], columns[h]))
        for row in range(blocks.shape[0]):
            for column in range(blocks.shape[1]):
                value = blocks[row, column]
                if value > 0:
                    plane[row, column] = max(plane[row, column], value)
                    plane[row, column + 1] = max(plane[row, column + 1], value)
                    plane[row + 1, column] = max(plane[row + 1, column], value)
                    plane[row + 1, column + 1] = max(plane[row + 1, column + 1], value)


@numba.njit(cache=True, nogil=True)
def _mean(buffer, cells, shift, needed, count):
    # Mean at the cells, of `count` points with those outside, or an upper bound of it once that is below the needed.
    total, unit = np.int64(0), 1 / (255.0 * count)
    for start in range(0, len(cells), 16):
        end = min(start + 16, len(cells))
        for k in range(start, end):
            total += buffer[cells[k] + shift]
        bound = (total + 255 * (len(cells) - end)) * unit
        if bound < needed:
            return bound
    return total * unit


@numba.njit(cache=True, nogil=True)
def _bound(buffer, cells, split, shift, needed, echoes, fronts):
    # The lower one of both means; of bounds it is a bound.
    score = _mean(buffer, cells[:split], shift, needed, echoes)
    if fronts > 0 and score > needed:
        score = min(score, _mean(buffer, cells[split:], shift, needed, fronts))
    return score


@numba.njit(cache=True, nogil=True)
def _cells(corner, h, starts, columns, out):
    rim = 1 if h > 0 else 0
    for k in range(len(corner)):
        out[k] = corner[k, 2] + starts[h] + ((corner[k, 0] >> h) + rim) * columns[h] + (corner[k, 1] >> h) + rim


@numba.njit(cache=True, nogil=True)
def _nearest(low, size):
    # Smallest distance to 0 of the integers low ... low + size - 1.
    return max(low, -(low + size - 1), 0)


@numba.njit(cache=True, nogil=True)
def _search(levels, points, echoes, guess, window, min_score):
    # Points and guess in cells, the first `echoes` points to lie on what is occupied, the others on what is free.
    # Shifts (dx, dy) count from the window's corner, so a block's shift at its level is one number for all points.
    buffer, starts, rows, columns = levels
    angles, half = window.angles, window.half
    top = len(starts) - 1
    size = 1 << top
    across = (2 * half + size) // size
    count = len(angles) * across * across
    fronts = len(points) - echoes
    # Cells of the points, by angle; those below the top level only of angles that are looked at closer.
    corner, inside = np.empty((len(angles), len(points), 3), np.int32), np.zeros(len(angles), np.int64)
    split = np.zeros(len(angles), np.int64)
    cells, known = np.empty((len(angles), top + 1, len(points)), np.int32), np.zeros(len(angles), np.bool_)
    bounds, where = np.empty(count), np.empty((count, 3), np.int64)
    n = 0
    for a in range(len(angles)):
        cos, sin = np.cos(angles[a]), np.sin(angles[a])
        for k in range(len(points)):
            column = int(np.floor(cos * points[k, 0] - sin * points[k, 1] + guess[0])) - half
            row = int(np.floor(sin * points[k, 0] + cos * points[k, 1] + guess[1])) - half
            if column >= 0 and row >= 0 and column + 2 * half < columns[0] and row + 2 * half < rows[0]:
                corner[a, inside[a], 0], corner[a, inside[a], 1] = row, column
                corner[a, inside[a], 2] = 0 if k < echoes else len(buffer) // 2
                inside[a] += 1
                split[a] += k < echoes
        _cells(corner[a, : inside[a]], top, starts, columns, cells[a, top])
        for i in range(across):
            for j in range(across):
                dx, dy = i * size, j * size
                away = _nearest(dx - half, size) ** 2 + _nearest(dy - half, size) ** 2
                cost = window.prices[a] + window.price * away
                shift = i + j * columns[top]
                score = _bound(buffer, cells[a, top, : inside[a]], split[a], shift, min_score + cost, echoes, fronts)
                bounds[n] = score - cost
                where[n, 0], where[n, 1], where[n, 2] = a, dx, dy
                n += 1
    best, best_a, best_x, best_y, found = min_score, 0, 0, 0, False
    stack_bound, stack = np.empty(4 * top + 4), np.empty((4 * top + 4, 3), np.int64)
    child_bound, child = np.empty(4), np.empty((4, 2), np.int64)
    for index in np.argsort(-bounds):
        if bounds[index] <= best:
            break
        a = where[index, 0]
        if not known[a]:
            known[a] = True
            for h in range(top):
                _cells(corner[a, : inside[a]], h, starts, columns, cells[a, h])
        stack_bound[0], stack[0, 0], stack[0, 1], stack[0, 2] = bounds[index], where[index, 1], where[index, 2], top
        depth = 1
        while depth > 0:
            depth -= 1
            if stack_bound[depth] <= best:
                continue
            dx, dy, level = stack[depth, 0], stack[depth, 1], stack[depth, 2]
            if level == 0:
                best, best_a, best_x, best_y, found = stack_bound[depth], a, dx - half, dy - half, True
                continue
            level -= 1
            size = 1 << level
            for c in range(4):
                cx, cy = dx + (c & 1) * size, dy + (c >> 1) * size
                child[c, 0], child[c, 1] = cx, cy
                child_bound[c] = -1.0
                if cx <= 2 * half and cy <= 2 * half:
                    away = _nearest(cx - half, size) ** 2 + _nearest(cy - half, size) ** 2
                    shift = (cx >> level) + (cy >> level) * columns[level]
                    cost = window.prices[a] + window.price * away
                    score = _bound(buffer, cells[a, level, : inside[a]], split[a], shift, best + cost, echoes, fronts)
                    child_bound[c] = score - cost
            for c in np.argsort(child_bound):  # the best child is looked at first
                if child_bound[c] > best:
                    stack_bound[depth] = child_bound[c]
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = child[c, 0], child[c, 1], level
                    depth += 1
    return found, best, best_a, best_x, best_y
