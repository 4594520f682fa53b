"""Headings from the walls of submaps: most of a building's stand at right angles, or in a few directions.

The walls of a submap have the direction along which its points, seen along either axis, pile up most. Where it is one
that was met before, the two submaps are parallel, or at right angles, however far apart they are and whatever odometry
has lost in between. Which one it is must hardly be in doubt, so that where walls stand in all directions nothing is
told; and after a turn that odometry saw too badly, directions are others than before.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.rightangles import past_right_angle, recognised
from radarize.slam.config import WallsConfig

#: rad: directions that are tried, and those that count as the same.
_TURNS, _SAME = np.radians(np.arange(0, 90, 0.25)), np.radians(8.0)
#: rad: a heading that is known worse since a direction was met last may not tell right angles apart.
_LOST = np.radians(15.0)
#: Points of a submap that are looked at, at most; m and number of the cells that they pile up in; what is farther
#: apart than all cells begins at the first again.
_POINTS, _CELL, _CELLS = 2000, 0.05, 1024


class Direction(NamedTuple):
    """Of walls.

    Attributes:
        angle: of their normals, rad, modulo a right angle.
        contrast: how much better points pile up than along any other direction.
    """

    angle: float
    contrast: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "point 2"]) -> "Direction":
        """Of the walls that some points (m) lie on."""
        piled = _piled(points[:: 1 + len(points) // _POINTS], _TURNS)
        best = int(piled.argmax())
        before, at, after = piled[best - 1], piled[best], piled[(best + 1) % len(piled)]
        between = (before - after) / (2 * (before - 2 * at + after) or 1.0)
        others = piled[np.abs(past_right_angle(_TURNS - _TURNS[best])) > _SAME]
        return cls(float(_TURNS[best] + between * (_TURNS[1] - _TURNS[0])), float(at / others.max()))


class Walls:
    """Directions that are remembered, with the nodes in the middle of the submaps whose walls had them."""

    def __init__(self, config: WallsConfig):
        self.config = config
        self._known: list[dict[int, float]] = []  # of each direction the angles by node, each as seen from it

    def meet(
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
        found = Direction.of(points)
        if found.contrast < self.config.contrast or any(node in known for known in self._known):
            return None
        number = self._recognised(node, found.angle, headings, drift)
        if number is None:
            return None
        if number == len(self._known):
            self._known.append({node: found.angle})
            return None
        first, angle = next(iter(self._known[number].items()))
        self._known[number][node] = found.angle
        off = past_right_angle(headings[first] + angle - headings[node] - found.angle)
        return first, float(headings[node] + off - headings[first])

    def _recognised(
        self, node: int, angle: float, headings: Float[np.ndarray, "node"], drift: Callable[[int, int], float]
    ) -> int | None:
        """Which direction an angle is, seen from a node; as many as there are for a new one, None where in doubt.

        Only where no direction was met since headings were lost, those before are looked at; in doubt it is a new one.
        """
        firsts = [next(iter(known.items())) for known in self._known]
        off = past_right_angle(np.array([headings[k] + each for k, each in firsts]) - headings[node] - angle)
        variances = np.array([drift(next(reversed(known)), node) for known in self._known]) + 2 * self.config.sigma**2
        walls = np.array([len(known) for known in self._known], int)
        near = np.flatnonzero(variances < _LOST**2)
        if not len(near):
            found = recognised(off, variances, walls)
            return len(walls) if found is None else found
        found = recognised(off[near], variances[near], walls[near])
        return found if found is None else int([*near, len(walls)][found])

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
