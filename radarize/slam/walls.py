"""Heading constraints from wall directions: most walls of a building are at right angles, or have a few directions.

The wall direction of a submap is the axis on which the projections of its points are most concentrated. If a submap has
the direction of an earlier one, the two are parallel or at right angles, whatever their distance and whatever the drift
of odometry between them. The association has to be unambiguous, so there are no constraints where walls have all
directions. After a rotation that odometry did not observe, new directions are started.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numba
import numpy as np
from jaxtyping import Float

from radarize.odometry.rightangles import associate_direction, from_right_angle
from radarize.slam.config import WallsConfig

#: Directions that are evaluated, and half width of the peak that the contrast excludes, rad.
_ANGLES, _PEAK_WIDTH = np.radians(np.arange(0, 90, 0.25)), np.radians(8.0)
#: Maximum standard deviation of the heading since the last association with a direction, rad; above it right angles are
#: not distinguished.
_MAX_HEADING_STD = np.radians(15.0)
#: Maximum number of points of a submap; size (m) and number of the bins of a projection, which wraps around beyond the
#: last bin.
_MAX_POINTS, _BIN_SIZE, _BINS = 2000, 0.05, 1024


class WallDirection(NamedTuple):
    """Direction of the walls of a submap.

    Attributes:
        angle: of their normals, rad, modulo a right angle.
        contrast: ratio of the concentration of points in this direction to that in any other direction.
    """

    angle: float
    contrast: float

    @classmethod
    def of(cls, points: Float[np.ndarray, "point 2"]) -> "WallDirection":
        """Return the wall direction of some points (m)."""
        concentration = _concentrations(np.ascontiguousarray(points[:: 1 + len(points) // _MAX_POINTS]), _ANGLES)
        best = int(concentration.argmax())
        before, at, after = concentration[best - 1], concentration[best], concentration[(best + 1) % len(concentration)]
        between = (before - after) / (2 * (before - 2 * at + after) or 1.0)
        others = concentration[np.abs(from_right_angle(_ANGLES - _ANGLES[best])) > _PEAK_WIDTH]
        return cls(float(_ANGLES[best] + between * (_ANGLES[1] - _ANGLES[0])), float(at / others.max()))


class Walls:
    """Remembered wall directions, with the central nodes of the submaps that have them."""

    def __init__(self, config: WallsConfig):
        self.config = config
        self._known: list[dict[int, float]] = []  # per direction: angles of walls by node, in the frame of the node

    def associate(
        self,
        node: int,
        points: Float[np.ndarray, "point 2"],
        headings: Float[np.ndarray, "node"],
        drift: Callable[[int, int], float],
    ) -> tuple[int, float] | None:
        """Associate the walls of a submap with a remembered direction, and remember them.

        Args:
            node: in the middle of the submap.
            points: of the submap, in the frame of the node, m.
            headings: current estimates of all nodes, rad.
            drift: variance of the rotation between two nodes by odometry, rad^2.

        Returns:
            The first node with this direction, and the rotation from its heading to that of this node, rad; None if the
            direction is new or ambiguous.
        """
        found = WallDirection.of(points)
        if found.contrast < self.config.contrast or any(node in known for known in self._known):
            return None
        variances = [drift(next(reversed(known)), node) + 2 * self.config.sigma**2 for known in self._known]
        usable = [k for k, variance in enumerate(variances) if variance < _MAX_HEADING_STD**2]
        firsts = [next(iter(self._known[k].items())) for k in usable]
        expected = np.array([headings[first] + angle for first, angle in firsts])
        deviations = from_right_angle(expected - headings[node] - found.angle)
        index = associate_direction(deviations, np.array(variances)[usable], [len(self._known[k]) for k in usable])
        if index is None:
            return None
        if index == len(usable):
            self._known.append({node: found.angle})
            return None
        self._known[usable[index]][node] = found.angle
        first = firsts[index][0]
        return first, float(headings[node] + deviations[index] - headings[first])

    def keep(self, place: Mapping[int, int]) -> None:
        """Remove all other nodes; `place` holds the new numbers of those kept."""
        kept = [{place[node]: angle for node, angle in known.items() if node in place} for known in self._known]
        self._known = [known for known in kept if known]


@numba.njit(cache=True, nogil=True)
def _concentrations(points, angles):
    """Concentration of the points for each angle: sum of the squared histograms of their projections on both axes, with
    linear sharing between neighbouring bins."""
    found, histogram = np.zeros(len(angles)), np.empty(_BINS)
    for k in range(len(angles)):
        for x, y in ((np.cos(angles[k]), np.sin(angles[k])), (-np.sin(angles[k]), np.cos(angles[k]))):
            histogram[:] = 0.0
            for i in range(len(points)):
                place = (points[i, 0] * x + points[i, 1] * y) / _BIN_SIZE
                low = np.floor(place)
                cell = int(low) % _BINS
                histogram[cell] += 1 - (place - low)
                histogram[(cell + 1) % _BINS] += place - low
            found[k] += (histogram**2).sum()
    return found
