"""Correlative search: the pose in a window at which a scan's points fall on the most probable cells.

Branch and bound over a pyramid (Hess et al., ICRA 2016, section V.C). Level h holds, on cells of 2^h, the maximum over
2 x 2 such cells, so that all poses whose shift lies in a block of 2^h x 2^h cells are bounded by one look-up per point:
the best pose of the window is found as if all had been tried. A pyramid takes 4/3 of the bytes of its grid.
"""

from dataclasses import dataclass

import numba
import numpy as np
from jaxtyping import Float

from radarize.slam.grid import OccupancyGrid


@dataclass(frozen=True)
class Pyramid:
    """Bounds of a grid at falling resolution, probabilities in 1/255, all levels in one buffer.

    Attributes:
        resolution, origin: of level 0, as in `OccupancyGrid`.
        half: half-width of the largest window that can be searched, cells; twice this much empty space is added around
            the grid, so that the search need not look where the grid ends.
        buffer: levels one after the other, row by row.
        starts, rows, columns: of each level; from level 1 on, cell (-1, -1) is stored at (0, 0).
    """

    resolution: float
    origin: Float[np.ndarray, "2"]
    half: int
    buffer: np.ndarray
    starts: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    @classmethod
    def of(cls, grid: OccupancyGrid, levels: int, distance: float) -> "Pyramid":
        """Pyramid with `levels` halvings for windows of half-width up to `distance` (m)."""
        half = int(np.ceil(distance / grid.resolution))
        base = np.pad(np.rint(255 * grid.probability).astype(np.uint8), 2 * half)
        planes = [base] + [_maxima(base, 1 << h) for h in range(1, levels + 1)]
        sizes = np.array([p.size for p in planes])
        return cls(
            grid.resolution,
            grid.origin - 2 * half * grid.resolution,
            half,
            np.concatenate([p.ravel() for p in planes]),
            np.concatenate([[0], np.cumsum(sizes)[:-1]]),
            np.array([p.shape[0] for p in planes]),
            np.array([p.shape[1] for p in planes]),
        )

    @property
    def levels(self) -> int:
        """Number of halvings."""
        return len(self.starts) - 1


def search(
    pyramid: Pyramid,
    points: Float[np.ndarray, "n 2"],
    guess: Float[np.ndarray, "3"],
    *,
    distance: float,
    angle: float,
    min_score: float,
    penalty: tuple[float, float] = (0.0, 0.0),
) -> tuple[Float[np.ndarray, "3"], float] | None:
    """Best pose of a window around a guess, or None if none scores above `min_score`.

    Args:
        pyramid: of the submap.
        points: in the scan's frame, m.
        guess: middle of the window, in the submap's frame.
        distance, angle: half-widths of the window, m and rad. The angle steps by one cell at the 90th percentile of
            the points' ranges.
        min_score: mean probability at the points, 0...1.
        penalty: subtracted from the score per square metre and per square radian away from the guess.

    Returns:
        Pose in the submap's frame and its score, penalty subtracted.
    """
    if not len(points):
        return None
    reach = max(float(np.percentile(np.hypot(points[:, 0], points[:, 1]), 90)), 1.0)
    step = pyramid.resolution / reach
    turns = int(np.ceil(angle / step))
    angles = np.arange(-turns, turns + 1) * step
    half = min(int(np.ceil(distance / pyramid.resolution)), pyramid.half)
    found, score, a, dx, dy = _search(
        pyramid.buffer,
        pyramid.starts,
        pyramid.rows,
        pyramid.columns,
        np.ascontiguousarray(points, float),
        (np.asarray(guess, float)[:2] - pyramid.origin) / pyramid.resolution,
        guess[2] + angles,
        angles**2 * penalty[1],
        1 / pyramid.resolution,
        half,
        min_score,
        penalty[0] * pyramid.resolution**2,
    )
    if not found:
        return None
    shift = np.array([dx, dy]) * pyramid.resolution
    return np.array([guess[0] + shift[0], guess[1] + shift[1], guess[2] + angles[a]]), score


@numba.njit(cache=True)
def _maxima(base, size):
    # Cell (i, j) of the result bounds base cells (i - 1) * size ... (i + 1) * size - 1 along each axis.
    rows, columns = base.shape
    out = np.zeros(((rows + size - 1) // size + 1, (columns + size - 1) // size + 1), np.uint8)
    for row in range(rows):
        r = row // size
        for column in range(columns):
            c, value = column // size, base[row, column]
            if value > 0:
                for i in range(r, r + 2):
                    for j in range(c, c + 2):
                        if out[i, j] < value:
                            out[i, j] = value
    return out


@numba.njit(cache=True)
def _bound(buffer, cells, shift):
    total = np.int64(0)
    for k in range(len(cells)):
        total += buffer[cells[k] + shift]
    return total


@numba.njit(cache=True)
def _nearest(low, size):
    # Smallest distance to 0 of the integers low ... low + size - 1.
    return max(low, -(low + size - 1), 0)


@numba.njit(cache=True)
def _search(buffer, starts, rows, columns, points, guess, angles, angle_penalty, scale, half, min_score, penalty):
    # Shifts (dx, dy) count from the window's corner, so a block's shift at its level is one number for all points.
    top = len(starts) - 1
    size = 1 << top
    across = (2 * half + size) // size
    count = len(angles) * across * across
    unit = 1 / (255.0 * len(points))
    cells, inside = np.empty((len(angles), top + 1, len(points)), np.int64), np.zeros(len(angles), np.int64)
    bounds, where = np.empty(count), np.empty((count, 3), np.int64)
    n = 0
    for a in range(len(angles)):
        cos, sin = np.cos(angles[a]), np.sin(angles[a])
        for k in range(len(points)):
            x, y = points[k, 0] * scale, points[k, 1] * scale
            column = int(np.floor(cos * x - sin * y + guess[0])) - half
            row = int(np.floor(sin * x + cos * y + guess[1])) - half
            if column >= 0 and row >= 0 and column + 2 * half < columns[0] and row + 2 * half < rows[0]:
                for h in range(top + 1):
                    rim = 1 if h > 0 else 0
                    cells[a, h, inside[a]] = starts[h] + ((row >> h) + rim) * columns[h] + (column >> h) + rim
                inside[a] += 1
        for i in range(across):
            for j in range(across):
                dx, dy = i * size, j * size
                away = _nearest(dx - half, size) ** 2 + _nearest(dy - half, size) ** 2
                total = _bound(buffer, cells[a, top, : inside[a]], i + j * columns[top])
                bounds[n] = total * unit - angle_penalty[a] - penalty * away
                where[n, 0], where[n, 1], where[n, 2] = a, dx, dy
                n += 1
    best, best_a, best_x, best_y, found = min_score, 0, 0, 0, False
    stack_bound, stack = np.empty(4 * top + 4), np.empty((4 * top + 4, 3), np.int64)
    child_bound, child = np.empty(4), np.empty((4, 2), np.int64)
    for index in np.argsort(-bounds):
        if bounds[index] <= best:
            break
        a = where[index, 0]
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
                    total = _bound(buffer, cells[a, level, : inside[a]], (cx >> level) + (cy >> level) * columns[level])
                    child_bound[c] = total * unit - angle_penalty[a] - penalty * away
            for c in np.argsort(child_bound):  # the best child is looked at first
                if child_bound[c] > best:
                    stack_bound[depth] = child_bound[c]
                    stack[depth, 0], stack[depth, 1], stack[depth, 2] = child[c, 0], child[c, 1], level
                    depth += 1
    return found, best, best_a, best_x, best_y
