"""Tours on a clearance map: out from a home point, and back to it another way where there is one."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from radarize.errors import InputError
from radarsim.scene.clearance import RESOLUTION, Clearance

STEP = 0.02  # m between points of a leg
_STRIDE = 2  # cells of the clearance map per cell of the search grid
_WAYPOINTS = 14
_USED_COST = 2.5  # times the length for ground walked before, so that a way back is a loop if there is one
_SMOOTHING = 0.30  # m, Gaussian along the path


@dataclass(frozen=True)
class Grid:
    """The largest connected part of the ground with enough clearance, as a graph for shortest paths."""

    points: Float[np.ndarray, "node 2"]  # m
    clearance: Float[np.ndarray, "node"]  # m
    edges: np.ndarray  # (edge, 2) node indices
    lengths: Float[np.ndarray, "edge"]  # m

    @classmethod
    def of(cls, clearance: Clearance, radius: float) -> "Grid":
        """Nodes at least `radius` (m) from everything.

        Raises:
            InputError: there is less than a square metre of them.
        """
        distance = clearance.distance[::_STRIDE, ::_STRIDE]
        labels, count = ndimage.label(distance >= radius)
        sizes = np.bincount(labels.ravel(), minlength=2)[1:]
        cell = _STRIDE * RESOLUTION
        if not count or sizes.max() * cell**2 < 1.0:
            raise InputError(f"no room to move: less than 1 m2 of floor lies {radius:.2f} m away from everything")
        inside = labels == 1 + sizes.argmax()
        number = np.full(inside.shape, -1)
        number[inside] = np.arange(inside.sum())
        edges, lengths = [], []
        for dx, dy in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = number[: len(number) - dx, max(0, -dy) : number.shape[1] - max(0, dy)]
            b = number[dx:, max(0, dy) : number.shape[1] + min(0, dy)]
            both = (a >= 0) & (b >= 0)
            edges.append(np.stack([a[both], b[both]], axis=1))
            lengths.append(np.full(both.sum(), cell * np.hypot(dx, dy)))
        points = clearance.origin + np.argwhere(inside) * cell
        return cls(points, distance[inside], np.concatenate(edges), np.concatenate(lengths))

    def search(self, start: int, radius: float, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cost to every node and its predecessor; the middle of free space is cheaper than its edge."""
        node_cost = (1 + 3 * np.exp(-(self.clearance - radius) / 0.15)) * np.where(used, _USED_COST, 1.0)
        a, b = self.edges.T
        weight = self.lengths * (node_cost[a] + node_cost[b]) / 2
        graph = coo_array((weight, (a, b)), shape=(len(self.points),) * 2).tocsr()
        return dijkstra(graph, directed=False, indices=start, return_predecessors=True)


def walk(predecessor: np.ndarray, goal: int) -> list[int]:
    """Nodes from the start of a search to `goal`."""
    nodes = [goal]
    while predecessor[nodes[-1]] >= 0:
        nodes.append(int(predecessor[nodes[-1]]))
    return nodes[::-1]


def tour(clearance: Clearance, radius: float, length: float, rng: np.random.Generator) -> list[np.ndarray]:
    """A tour of at least `length` metres, as smooth legs between stops.

    Args:
        clearance: of the platform's body.
        radius: clearance to keep, m.
        length: m.
        rng: for the waypoints.

    Returns:
        Legs, each (points, 2) in m about `STEP` apart. One starts where the one before ends.

    Raises:
        InputError: no room to move.
    """
    grid = Grid.of(clearance, radius)
    nothing = np.zeros(len(grid.points), bool)
    goals = _waypoints(grid, radius, rng)
    costs = np.stack([grid.search(goal, radius, nothing)[0][goals] for goal in goals])
    home = goals[costs.mean(axis=1).argmin()]
    used, travelled, nodes, fresh = nothing.copy(), 0.0, [int(home)], []
    while travelled < length:
        cost, before = grid.search(home, radius, nothing)
        fresh = fresh or [int(g) for g in rng.permutation(goals) if g != home]
        # The first way round is short enough that the walk comes back to where it has been.
        near = [g for g in fresh if travelled or 3.0 < cost[g] < 0.35 * length] or fresh
        goal = near[0]
        fresh.remove(goal)
        out = walk(before, goal)
        back = walk(grid.search(goal, radius, _near(grid, out))[1], home)
        for part in (out, back):
            used |= _near(grid, part)
            travelled += _length(grid.points[part])
            nodes += part[1:]
    return _smooth_legs(grid.points[nodes], clearance, radius)


def _waypoints(grid: Grid, radius: float, rng: np.random.Generator) -> np.ndarray:
    """Nodes far from each other and not too close to things."""
    roomy = np.flatnonzero(grid.clearance >= min(radius + 0.1, np.quantile(grid.clearance, 0.7)))
    pool = rng.choice(roomy, size=min(400, len(roomy)), replace=False)
    chosen = [pool[0]]
    while len(chosen) < min(_WAYPOINTS, len(pool)):
        apart = np.linalg.norm(grid.points[pool, None] - grid.points[chosen][None], axis=2).min(axis=1)
        chosen.append(pool[apart.argmax()])
    return np.array(chosen)


def _near(grid: Grid, nodes: list[int]) -> np.ndarray:
    """Nodes within half a metre of a path, apart from its ends."""
    from scipy.spatial import cKDTree

    return cKDTree(grid.points[nodes[10:-10] or nodes]).query(grid.points, distance_upper_bound=0.5)[0] < 0.5


def _length(points: Float[np.ndarray, "n 2"]) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _smooth_legs(points: Float[np.ndarray, "n 2"], clearance: Clearance, radius: float) -> list[np.ndarray]:
    """Split where the path doubles back, and round each leg off as far as the clearance allows."""
    # The direction over 0.4 m to each side tells a corner from a turn-around.
    reach = 8
    ahead = points[np.minimum(np.arange(len(points)) + reach, len(points) - 1)] - points
    behind = points - points[np.maximum(np.arange(len(points)) - reach, 0)]
    turn = np.sum(ahead * behind, axis=1) / np.maximum(
        np.linalg.norm(ahead, axis=1) * np.linalg.norm(behind, axis=1), 1e-9
    )
    cuts, last = [0], 0
    for i in range(1, len(points) - 1):
        window = turn[max(0, i - reach) : i + reach + 1]
        if turn[i] < -0.2 and turn[i] == window.min() and i - last > 2 * reach:
            cuts.append(i)
            last = i
    cuts.append(len(points) - 1)
    legs = [points[a : b + 1] for a, b in zip(cuts[:-1], cuts[1:], strict=True) if b - a > 2]
    return [_smooth(leg, clearance, radius) for leg in legs]


def _smooth(leg: Float[np.ndarray, "n 2"], clearance: Clearance, radius: float) -> Float[np.ndarray, "m 2"]:
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(leg, axis=0), axis=1))])
    count = max(8, int(np.ceil(along[-1] / STEP)))
    dense = np.stack([np.interp(np.linspace(0, along[-1], count), along, leg[:, k]) for k in range(2)], axis=1)
    sigma = _SMOOTHING
    while True:
        # Odd reflection at the ends keeps them where they are.
        pad = min(int(4 * sigma / STEP), count - 1)
        padded = np.pad(dense, ((pad, pad), (0, 0)), mode="reflect", reflect_type="odd")
        result = ndimage.gaussian_filter1d(padded, sigma / STEP, axis=0)[pad : pad + count]
        if sigma < 0.08 or clearance.at(result).min() >= radius - 0.03:
            return result
        sigma *= 0.8
