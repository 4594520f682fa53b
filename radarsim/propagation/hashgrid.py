"""Hash grid that finds nearby boxes at a cost independent of the size of the world."""

from itertools import product

import numpy as np
from jaxtyping import Float, Int


class Grid:
    """Axis-aligned boxes sorted by the cells that they touch.

    Args:
        low, high: corners, m.
        cell: edge of a cell, m.
    """

    def __init__(self, low: Float[np.ndarray, "box 3"], high: Float[np.ndarray, "box 3"], cell: float = 4.0):
        self.low, self.high, self.cell = low, high, cell
        first, last = np.floor(low / cell).astype(int), np.floor(high / cell).astype(int)
        across, along, up = (last - first + 1).T
        count = across * along * up
        box = np.repeat(np.arange(len(low)), count)
        k = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
        along, up = along[box], up[box]
        cells = first[box] + np.stack([k // (along * up), k // up % along, k % up], axis=1)
        order = np.lexsort(cells.T)
        cells, box = cells[order], box[order]
        new = np.ones(len(box), bool)
        new[1:] = (cells[1:] != cells[:-1]).any(axis=1)
        keys = map(tuple, cells[new].tolist())
        self._boxes = dict(zip(keys, np.split(box, np.flatnonzero(new)[1:]), strict=False))  # without empty cells

    def near(
        self, positions: Float[np.ndarray, "position 3"], reach: float
    ) -> tuple[Int[np.ndarray, "near"], Float[np.ndarray, "near"]]:
        """Boxes within `reach` (m) of any position, in ascending order, and their distance to the nearest one."""
        positions = np.atleast_2d(positions)
        first, last = (np.floor((positions + s * reach) / self.cell).astype(int).tolist() for s in (-1, 1))
        keys = {key for a, b in zip(first, last, strict=True) for key in _cells(a, b)}
        found = np.unique(np.concatenate([np.zeros(0, int), *(self._boxes[key] for key in keys & self._boxes.keys())]))
        outside = np.maximum(self.low[found] - positions[:, None], positions[:, None] - self.high[found])
        distance = np.linalg.norm(np.maximum(outside, 0), axis=2).min(axis=0, initial=np.inf)
        keep = distance <= reach
        return found[keep], distance[keep]


def nearby_order(places: Float[np.ndarray, "place 3"], cell: float = 1.5) -> Int[np.ndarray, "place"]:
    """Order in which consecutive places are near each other: Morton's, by cells (m) in the horizontal plane."""
    x, y = (np.floor(places[:, :2] / cell).astype(int) & 31).T
    return np.argsort(_SPREAD[x] | _SPREAD[y] << 1, kind="stable")  # NumPy sorts 16 bits in linear time


#: Numbers of five bits with room for another bit after each.
_SPREAD = np.array([sum((n >> bit & 1) << 2 * bit for bit in range(5)) for n in range(32)], np.uint16)


def _cells(first, last):
    return product(*(range(a, b + 1) for a, b in zip(first, last, strict=True)))
