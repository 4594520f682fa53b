"""Paths over the floor: tours that return to their start, and routes through given way-points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from radarize.io.errors import InputError
from radarsim.motion.band import SLACK, relax
from radarsim.world.clearance import RESOLUTION, Clearance

_STRIDE = 2  # cells of the clearance map per cell of the search grid
_CELL = _STRIDE * RESOLUTION
_USED_COST = 2.5  # factor on the length of ground already used, so that the way back is a loop if there is one
_GOAL_AREA = 15.0  # m^2 of floor per candidate goal
_CHOICE = 3  # candidate goals; the one with the best loop is taken
_REACH = 0.35  # largest distance of the first goal, relative to the tour's length


@dataclass(frozen=True)
class Ground:
    """A connected part of the floor with enough clearance, as a graph for shortest paths.

    Attributes:
        points: nodes, m.
        clearance: of the nodes, m.
        edges: pairs of nodes.
        costs: cost of each edge: its length, m, times a factor that prefers the middle of free space.
    """

    points: Float[np.ndarray, "node 2"]
    clearance: Float[np.ndarray, "node"]
    edges: np.ndarray
    costs: Float[np.ndarray, "edge"]

    @classmethod
    def of(cls, clearance: Clearance, radius: float, start: Float[np.ndarray, "2"] | None = None) -> "Ground":
        """Build the graph of nodes at least `radius` (m) from obstacles: the part around `start` (m), or the largest.

        Raises:
            InputError: the largest part has less than a square metre.
        """
        distance = clearance.distance[::_STRIDE, ::_STRIDE]
        labels, count = ndimage.label(distance >= radius)
        sizes = np.bincount(labels.ravel(), minlength=2)[1:]
        if not count or sizes.max() * _CELL**2 < 1.0:
            raise InputError(f"no room to move: less than 1 m2 of floor lies {radius:.2f} m away from everything")
        part = 1 + sizes.argmax()
        if start is not None:
            nodes = np.argwhere(labels)
            part = labels[tuple(nodes[cKDTree(clearance.origin + nodes * _CELL).query(start)[1]])]
        inside = labels == part
        number = np.full(inside.shape, -1)
        number[inside] = np.arange(inside.sum())
        edges, lengths = [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = number[: len(number) - dx, max(0, -dy) : number.shape[1] - max(0, dy)]
            b = number[dx:, max(0, dy) : number.shape[1] + min(0, dy)]
            both = (a >= 0) & (b >= 0)
            edges.append(np.stack([a[both], b[both]], axis=1))
            lengths.append(np.full(both.sum(), _CELL * np.hypot(dx, dy)))
        pairs, room = np.concatenate(edges), distance[inside]
        dear = 1 + 3 * np.exp(-(room - radius) / 0.15)
        costs = np.concatenate(lengths) * dear[pairs].mean(axis=1)
        return cls(clearance.origin + np.argwhere(inside) * _CELL, room, pairs, costs)

    def search(
        self, start: int, used: Bool[np.ndarray, "node"] | None = None, limit: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Cost to every node (inf beyond `limit`) and its predecessor; nodes in `used` cost more."""
        costs = self.costs if used is None else self.costs * np.where(used, _USED_COST, 1.0)[self.edges].mean(axis=1)
        graph = coo_array((costs, tuple(self.edges.T)), shape=(len(self.points),) * 2).tocsr()
        return dijkstra(graph, directed=False, indices=start, return_predecessors=True, limit=limit)

    @staticmethod
    def way(predecessor: Int[np.ndarray, "node"], goal: int) -> list[int]:
        """Nodes from the start of a search to `goal`."""
        nodes = [goal]
        while predecessor[nodes[-1]] >= 0:
            nodes.append(int(predecessor[nodes[-1]]))
        return nodes[::-1]

    def around(self, nodes: Sequence[int]) -> Bool[np.ndarray, "node"]:
        """Nodes within half a metre of a path, apart from its ends."""
        path = self.points[nodes[10:-10] or nodes]
        return np.isfinite(cKDTree(path).query(self.points, distance_upper_bound=0.5)[0])


def tour(
    clearance: Clearance, radius: float, turning: float, length: float, rng: np.random.Generator
) -> list[Float[np.ndarray, "n 2"]]:
    """Plan a tour of at least `length` metres as smooth segments: away from home, and back another way if possible.

    Args:
        clearance: clearance map of the platform's body.
        radius: clearance to keep, m.
        turning: clearance preferred where the platform turns round, m.
        length: m.
        rng: random generator of the goals.

    Returns:
        Path segments, each (points, 2) in m; each starts at the end of the one before.

    Raises:
        InputError: not enough free floor.
    """
    ground = Ground.of(clearance, radius)
    goals = _goals(ground, turning, rng)
    apart = np.linalg.norm(ground.points[goals, None] - ground.points[goals], axis=2)
    home = int(goals[np.sum(apart < _REACH * length, axis=1).argmax()])
    cost, before = ground.search(home)
    travelled, nodes = 0.0, [home]
    fresh: list[int] = []
    while travelled < length:
        fresh = fresh or [int(g) for g in rng.permutation(goals) if g != home]
        # The first loop is short enough that the walk revisits it.
        near = [g for g in fresh if travelled or 3.0 < cost[g] < _REACH * length] or fresh
        trips = [_round(ground, home, goal, float(cost[goal]), before) for goal in near[:_CHOICE]]
        goal, (out, back), _ = min(trips, key=lambda trip: trip[-1])
        fresh.remove(goal)
        for part in (out, back):
            travelled += np.linalg.norm(np.diff(ground.points[part], axis=0), axis=1).sum()
            nodes += part[1:]
    path = ground.points[nodes]
    cuts = _reversals(path)
    return [relax(path[a : b + 1], clearance, radius) for a, b in zip(cuts[:-1], cuts[1:], strict=True)]


def route(clearance: Clearance, radius: float, places: Float[np.ndarray, "n 2"]) -> list[Float[np.ndarray, "m 2"]]:
    """Plan smooth segments through way-points, in their order, along shortest paths.

    Args:
        clearance: clearance map of the platform's body.
        radius: clearance to keep, m.
        places: way-points with that clearance, m.

    Raises:
        InputError: names the first way-point that cannot be reached.
    """
    ground = Ground.of(clearance, radius, places[0])
    gaps, stations = cKDTree(ground.points).query(places)
    for number, gap in enumerate(gaps, 1):
        if gap > SLACK + 2 * _CELL:
            raise InputError(
                f"way-point {number} (x {places[number - 1, 0]:.2f}, y {places[number - 1, 1]:.2f} m) cannot be "
                f"reached from the first one with {radius:.2f} m to each side of the carrier's middle"
            )
    path, pins = [places[:1]], [0]
    for start, end, place in zip(stations[:-1], stations[1:], places[1:], strict=True):
        # Near way-points no search of the whole floor is needed; the outer nodes are replaced by the way-points
        # themselves.
        reach = 5 * float(np.linalg.norm(ground.points[start] - ground.points[end])) + 1
        cost, before = ground.search(int(start), limit=reach)
        if np.isinf(cost[end]):
            before = ground.search(int(start))[1]
        nodes = ground.way(before, int(end))[1:-1]
        path += [ground.points[nodes], place[None]]
        pins.append(pins[-1] + len(nodes) + 1)
    whole = np.concatenate(path)
    cuts = _reversals(whole, pins)
    return [
        relax(whole[a : b + 1], clearance, radius, [p - a for p in pins if a < p < b])
        for a, b in zip(cuts[:-1], cuts[1:], strict=True)
    ]


def _round(
    ground: Ground, home: int, goal: int, cost: float, before: np.ndarray
) -> tuple[int, tuple[list[int], list[int]], float]:
    """Return the goal, the paths there and back, and the fraction of the way back that repeats the way there."""
    out = ground.way(before, goal)
    used = ground.around(out)
    # Costs of the way there, as used ground.
    back = ground.way(ground.search(goal, used, limit=1.01 * _USED_COST * cost)[1], home)
    return goal, (out, back), float(used[back].mean())


def _goals(ground: Ground, turning: float, rng: np.random.Generator) -> np.ndarray:
    """Nodes far from each other, with room to turn round."""
    roomy = np.flatnonzero(ground.clearance >= min(turning, np.quantile(ground.clearance, 0.8)))
    pool = rng.choice(roomy, size=min(500, len(roomy)), replace=False)
    wanted = int(np.clip(len(ground.points) * _CELL**2 / _GOAL_AREA, 12, 60))
    chosen, apart = [pool[0]], np.full(len(pool), np.inf)
    while len(chosen) < min(wanted, len(pool)):
        apart = np.minimum(apart, np.linalg.norm(ground.points[pool] - ground.points[chosen[-1]], axis=1))
        chosen.append(pool[apart.argmax()])
    return np.array(chosen)


def _reversals(path: Float[np.ndarray, "n 2"], pins: Sequence[int] | None = None) -> list[int]:
    """Indices of points where a path reverses (among `pins`, if given), and its two ends."""
    # A reversal shows in the direction over 0.4 m to each side, a corner does not.
    reach = round(0.4 / _CELL)
    index = np.arange(len(path))
    ahead = path[np.minimum(index + reach, len(path) - 1)] - path
    behind = path - path[np.maximum(index - reach, 0)]
    size = np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1)
    onward = np.sum(ahead * behind, axis=1) / np.maximum(size, 1e-9)
    cuts = [0]
    for i in range(1, len(path) - 1) if pins is None else pins[1:-1]:
        sharpest = onward[max(0, i - reach) : i + reach + 1].min() if pins is None else onward[i]
        if onward[i] < -0.2 and onward[i] == sharpest and i - cuts[-1] > reach and len(path) - 1 - i > reach:
            cuts.append(int(i))
    return [*cuts, len(path) - 1]
