"""Correlative scan matching: the pose in a search window at which a scan's points fall on the most probable cells.

Branch and bound over a pyramid of grids (Hess et al., ICRA 2016, section V.C). Level h stores, for cells of 2^h, the
maximum over 2 x 2 such cells, so one look-up per point bounds the score of all shifts in a block of 2^h x 2^h cells.
The result is the best pose of the window, as in an exhaustive search. A pyramid takes 4/3 of the memory of its grid.

Points should fall on occupied cells, and places in front of them, towards the sensor, on free cells. The second
condition distinguishes the two sides of a wall, and so the two walls of a corridor.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.slam.grid import OccupancyGrid

#: Sampling of the window by `scatter`: number of steps from its centre to its edge, and maximum step of the angle, rad.
_STEPS, _MAX_TURN = 9, 0.05
#: Minimum of 1 - (variance within the window / variance of a uniform distribution over it): it bounds the covariance of
#: unobservable directions.
_MIN_INFORMATION = 0.1


class Levels(NamedTuple):
    """Levels of a pyramid, from fine to coarse, probabilities in 1/255, in one buffer.

    Attributes:
        buffer: levels one after the other, row by row: first probability of being occupied, then, if requested, of
            being free.
        starts, rows, columns: of each level; from level 1 on, cell (-1, -1) is stored at (0, 0).
    """

    buffer: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    columns: np.ndarray


class Window(NamedTuple):
    """Search window: shifts of up to `half` cells in x and y, and angles (rad).

    Attributes:
        angles: in the frame of the grid.
        angle_penalties: penalty of each angle, subtracted from the score.
        half: half width, cells.
        shift_penalty: penalty per square cell of the distance from the centre, subtracted from the score.
    """

    angles: np.ndarray
    angle_penalties: np.ndarray
    half: int
    shift_penalty: float


@dataclass(frozen=True)
class Pyramid:
    """Pyramid of a grid for the branch-and-bound search.

    Attributes:
        resolution, origin: of level 0, as in `OccupancyGrid`.
        half: half width of the largest search window, cells; the grid is padded by twice this width, so that the search
            needs no bounds check.
        levels: the grids.
    """

    resolution: float
    origin: Float[np.ndarray, "2"]
    half: int
    levels: Levels

    @classmethod
    def of(cls, grid: OccupancyGrid, levels: int, distance: float, free: bool = False) -> "Pyramid":
        """Return the pyramid of a grid with `levels` halvings, for windows of half width up to `distance` (m)."""
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
    """Return the best pose of a window around a guess, or None if no score exceeds `min_score`.

    Args:
        pyramid: of the submap.
        points: in the frame of the scan, m.
        guess: centre of the window, in the frame of the submap.
        distance, angle: half widths of the window, m and rad. The step of the angle moves a point at the 90th
            percentile of the ranges by one cell.
        min_score: minimum of the mean probability of occupied cells at the points and, if given, of free cells at the
            fronts, 0...1.
        penalty: subtracted from the score per square metre and per square radian of the distance from the guess.
        fronts: places in front of the points, m, for a pyramid with `free`.

    Returns:
        Pose in the frame of the submap, and its score minus the penalty.
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
    """Covariance of a matched pose, from the likelihood of all poses in a window around it.

    The curvature at the best pose misses a second pose that fits as well, and overestimates the information along a
    straight wall, from its roughness. So the covariance is the second moment over the window, weighted by likelihood
    (Olson, Real-Time Correlative Scan Matching, ICRA 2009). The result is corrected for the finite window: if all poses
    fit equally, the pose is unobservable.

    Args:
        pyramid: of the submap.
        points: in the frame of the scan, m.
        pose: in the frame of the submap.
        distance, angle: half widths of the window, m and rad.
        sigma: standard deviation of the residual of one point, as in `radarize.slam.matcher`.

    Returns:
        Covariance for (x, y, yaw) in the frame of the scan.
    """
    half = min(int(np.ceil(distance / pyramid.resolution)), pyramid.half)
    stride = max(half // _STEPS, 1)
    half -= half % stride
    shifts = np.arange(-half, half + 1, stride)
    turns = np.linspace(-angle, angle, 2 * int(np.ceil(angle / _MAX_TURN)) + 1)
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
    share, axes = np.linalg.eigh(3 * moment)  # 1: as for a uniform distribution over the window
    spread = axes * (share / np.maximum(1 - share, _MIN_INFORMATION)) @ axes.T / 3
    size = window * [pyramid.resolution, pyramid.resolution, 1]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) * size
    return turn @ spread @ turn.T


@numba.njit(cache=True, nogil=True)
def _costs(grid, points, origin, angles, shifts, residuals):
    # Sum of the residuals at the points, for every pose of the window; shifts in cells.
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
    # Mean over `count` points, with 0 for points outside of the grid; an upper bound once that is below `needed`.
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
    # Minimum of the means at echoes and fronts; a bound if the inputs are bounds.
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
def _min_distance(low, size):
    # Minimum absolute value of the integers low ... low + size - 1.
    return max(low, -(low + size - 1), 0)


@numba.njit(cache=True, nogil=True)
def _search(levels, points, echoes, guess, window, min_score):
    # Points and guess in cells; the first `echoes` points belong on occupied cells, the others on free cells. Shifts
    # (dx, dy) count from the corner of the window, so a shift of a block at its level is one offset for all points.
    buffer, starts, rows, columns = levels
    angles, half = window.angles, window.half
    top = len(starts) - 1
    size = 1 << top
    across = (2 * half + size) // size
    count = len(angles) * across * across
    fronts = len(points) - echoes
    # Cells of the points by angle; below the top level they are computed only for angles that are refined.
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
                away = _min_distance(dx - half, size) ** 2 + _min_distance(dy - half, size) ** 2
                cost = window.angle_penalties[a] + window.shift_penalty * away
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
                    away = _min_distance(cx - half, size) ** 2 + _min_distance(cy - half, size) ** 2
                    shift = (cx >> level) + (cy >> level) * columns[level]
                    cost = window.angle_penalties[a] + window.shift_penalty * away
                    score = _bound(buffer, cells[a, level, : inside[a]], split[a], shift, best + cost, echoes, fronts)
                    child_bound[c] = score - cost
            for c in np.argsort(child_bound):  # the best child is on top of the stack
                if child_bound[c] > best:
                    stack_bound[depth] = child_bound[c]
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = child[c, 0], child[c, 1], level
                    depth += 1
    return found, best, best_a, best_x, best_y
