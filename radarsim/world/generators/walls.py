"""Walls with openings: visible rectangles from solid boxes minus opening boxes.

All boxes are axis-aligned, so the boundary of the union is exact on the grid of their coordinates: a cell is
solid or not, and a face separates a solid and an open cell. No face is hidden or coincides with another, and each is a
rectangle with its own corners, so that it remains one planar facet.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float

Span = tuple[float, float, float, float, float, float]  # x0 y0 z0 x1 y1 z1


@dataclass(frozen=True)
class Face:
    """A rectangle of a wall's surface.

    Attributes:
        axis: 0, 1, 2: the coordinate that is constant.
        level: its value, m.
        sign: +1 or -1, direction of the outward normal along the axis.
        low, high: (2,) extent in the two other coordinates, in their order, m.
    """

    axis: int
    level: float
    sign: int
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def area(self) -> float:
        """Area of the face, m^2."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    @property
    def corners(self) -> Float[np.ndarray, "4 3"]:
        """Counter-clockwise seen from outside."""
        (a0, b0), (a1, b1) = self.low, self.high
        loop = [(a0, b0), (a1, b0), (a1, b1), (a0, b1)]
        # (y, z) is right-handed about x and (x, y) about z, but (x, z) is left-handed about y.
        if (self.sign > 0) == (self.axis == 1):
            loop.reverse()
        return np.array([(*point[: self.axis], self.level, *point[self.axis :]) for point in loop])


def faces(solids: list[Span], openings: list[Span], pillars: Sequence[Span] = ()) -> list[Face]:
    """Boundary of the union of `solids` minus the union of `openings`, apart from its lowest and highest plane.

    Those two are floor and ceiling, which belong to the rooms. Vertical faces are extended in height first, then in
    width. `pillars` are solid everywhere, in openings too.
    """
    boxes = np.array([*solids, *openings, *pillars], float).round(6)
    grid = [np.unique(boxes[:, [axis, axis + 3]]) for axis in range(3)]
    solid = np.zeros([len(g) + 1 for g in grid], bool)  # a rim of open cells around the grid

    def cells(span: Float[np.ndarray, "6"]) -> tuple[slice, ...]:
        return tuple(slice(*(np.searchsorted(grid[k], [span[k], span[k + 3]]) + 1)) for k in range(3))

    for k, span in enumerate(boxes):
        solid[cells(span)] = not len(solids) <= k < len(solids) + len(openings)
    found = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        before, after = np.delete(solid, -1, axis), np.delete(solid, 0, axis)
        for i, level in enumerate(grid[axis]):
            if axis == 2 and i in (0, len(grid[2]) - 1):
                continue
            for sign, mask in ((1, before.take(i, axis) & ~after.take(i, axis)),
                               (-1, after.take(i, axis) & ~before.take(i, axis))):  # fmt: skip
                for low, high in _rectangles(mask[1:-1, 1:-1], grid[others[0]], grid[others[1]]):
                    found.append(Face(axis, float(level), sign, low, high))
    return found


def _rectangles(
    mask: Bool[np.ndarray, "a b"], a: np.ndarray, b: np.ndarray
) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
    """Disjoint rectangles that cover a mask on a grid: runs along b, then equal runs of neighbouring columns joined."""
    open_runs: dict[tuple[int, int], int] = {}
    filled = np.flatnonzero(mask.any(axis=1))
    for i in np.union1d(filled, filled + 1):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], mask[i], [0]]))) if i < len(mask) else np.zeros(0, int)
        runs = {(int(s), int(e)) for s, e in np.reshape(edges, (-1, 2))}
        for run in [run for run in open_runs if run not in runs]:
            start = open_runs.pop(run)
            yield (float(a[start]), float(b[run[0]])), (float(a[i]), float(b[run[1]]))
        for run in sorted(runs - open_runs.keys()):
            open_runs[run] = i


def surface(parts: list[Face]) -> trimesh.Trimesh:
    """The faces as one mesh, two triangles each."""
    corners = np.concatenate([part.corners for part in parts])
    quads = 4 * np.arange(len(parts))[:, None]
    triangles = np.stack([quads + [0, 1, 2], quads + [0, 2, 3]], axis=1).reshape(-1, 3)
    return trimesh.Trimesh(corners, triangles, process=False)
