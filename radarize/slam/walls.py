"""Headings from the walls of submaps: most of a building's stand at right angles, or in a few directions.

The walls of a submap have the direction along which its points, seen along either axis, pile up most. Where it is one
that was met before, the two submaps are parallel, or at right angles, however far apart they are and whatever odometry
has lost in between. Which one it is must hardly be in doubt, so that where walls stand in all directions nothing is
told; and after a turn that odometry did not see, directions are others than before.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.odometry.rightangles import associate_direction, from_right_angle
from radarize.slam.config import WallsConfig

#: rad: directions that are tried, and those that count as the same.
_TURNS, _SAME = np.radians(np.arange(0, 90, 0.25)), np.radians(8.0)
#: rad: a heading that is known worse since a direction was met last does not tell right angles apart.
_LOST = np.radians(15.0)
#: Points of a submap that are looked at, at most; m and number of the cells that they pile up in; what is farther
#: apart than all cells begins at the first again.
_POINTS, _CELL, _CELLS = 2000, 0.05, 1024


class WallDirection(NamedTuple):
    """Of walls.

    Attributes:
        angle: of their normals, rad, modulo a right angle.
        contrast: how much better points pile up than along any other direction.
    """

    angle: float
    contrast: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "point 2"]) -> "WallDirection":
        """Of the walls that some points (m) lie on."""
        piled = _piled(np.ascontiguousarray(points[:: 1 + len(points) // _POINTS]), _TURNS)
        best = int(piled.argmax())
        before, at, after = piled[best - 1], piled[best], piled[(best + 1) % len(piled)]
        between = (before - after) / (2 * (before - 2 * at + after) or 1.0)
        others = piled[np.abs(from_right_angle(_TURNS - _TURNS[best])) > _SAME]
        return cls(float(_TURNS[best] + between * (_TURNS[1] - _TURNS[0])), float(at / others.max()))


class Walls:
    """Directions that are remembered, with the nodes in the middle of the submaps whose walls had them."""

    def __init__(self, config: WallsConfig):
        self.config = config
        self._known: list[dict[int, float]] = []  # of each direction the angles by node, each as seen from it

    def associate(
        self,
        node: int,
        points: Float[np.ndarray, "point 2"],
        headings: Float[np.ndarray, "node"],
        drift: Callable[[int, int], float],
    ) -> tuple[int, float] | None:
        """Look up the direction of a submap's walls, and remember it.

        Args:
            node: in the middle of the submap.
            points: of the submap, seen from the node, m.
            headings: of all nodes, as they are known, rad.
            drift: variance of the turn from one node to another by odometry, rad^2.

        Returns:
            The first node that had this direction, and the turn from its heading to that of this one, rad; None where
            nothing is told.
        """
        found = WallDirection.of(points)
        if found.contrast < self.config.contrast or any(node in known for known in self._known):
            return None
        variances = [drift(next(reversed(known)), node) + 2 * self.config.sigma**2 for known in self._known]
        near = [k for k, variance in enumerate(variances) if variance < _LOST**2]
        firsts = [next(iter(self._known[k].items())) for k in near]
        expected = np.array([headings[first] + angle for first, angle in firsts])
        off = from_right_angle(expected - headings[node] - found.angle)
        number = associate_direction(off, np.array(variances)[near], [len(self._known[k]) for k in near])
        if number is None:
            return None
        if number == len(near):
            self._known.append({node: found.angle})
            return None
        self._known[near[number]][node] = found.angle
        first = firsts[number][0]
        return first, float(headings[node] + off[number] - headings[first])

    def keep(self, place: Mapping[int, int]) -> None:
        """Forget all nodes but these, which then have other numbers."""
        kept = [{place[node]: angle for node, angle in known.items() if node in place} for known in self._known]
        self._known = [known for known in kept if known]


@numba.njit(cache=True, nogil=True)
def _piled(points, turns):
    """For each turn, by how much points pile up along both axes: sums of the squared numbers of points in cells, each
    being shared by the two cells next to it."""
    found, count = np.zeros(len(turns)), np.empty(_CELLS)
    for k in range(len(turns)):
        for x, y in ((np.cos(turns[k]), np.sin(turns[k])), (-np.sin(turns[k]), np.cos(turns[k]))):
            count[:] = 0.0
            for i in range(len(points)):
                place = (points[i, 0] * x + points[i, 1] * y) / _CELL
                low = np.floor(place)
                cell = int(low) % _CELLS
                count[cell] += 1 - (place - low)
                count[(cell + 1) % _CELLS] += place - low
            found[k] += (count**2).sum()
    return found
