"""Loop closure: search and verification.

Searches run in background threads (the kernels release the GIL). Each result is used a fixed number of nodes after its
search began, and waited for if it is late. So the timing of threads does not change the result.
"""

from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from radarize.io.pose import between, compose
from radarize.slam.config import LoopConfig
from radarize.slam.correlation import Pyramid, scatter, search
from radarize.slam.grid import OccupancyGrid
from radarize.slam.matcher import Match, match
from radarize.slam.odometry import Drift
from radarize.slam.posegraph import PoseGraph
from radarize.slam.submap import Submap

_PYRAMIDS = 12  # number of cached pyramids of submaps
_WORKERS = 2


@dataclass(frozen=True)
class LoopCandidate:
    """Pair of a node and a submap to search for a loop closure.

    Attributes:
        submap, node: the submap, and the number of the node.
        points, fronts: in the frame of the node, as in `Node`, m.
        guess: pose of the node in the frame of the submap.
        spread: covariance of the guess, in the frame of the node.
        min_score: minimum score of a closure.
    """

    submap: Submap
    node: int
    points: Float[np.ndarray, "point 2"]
    fronts: Float[np.ndarray, "front 2"]
    guess: Float[np.ndarray, "3"]
    spread: Float[np.ndarray, "3 3"]
    min_score: float


@dataclass(frozen=True)
class Closure:
    """Match of a node with a submap.

    Attributes:
        anchor, node: numbers of the anchor of the submap and of the node.
        pose: of the node in the frame of the anchor.
        covariance: of the pose for (x, y, yaw) in the frame of the node.
        score: mean probability at the points of the node.
    """

    anchor: int
    node: int
    pose: Float[np.ndarray, "3"]
    covariance: Float[np.ndarray, "3 3"]
    score: float


class LoopSearch:
    """Searches loop candidates in the background, in the order of their submission."""

    def __init__(self, config: LoopConfig):
        self.config = config
        self._pool = ThreadPoolExecutor(_WORKERS, thread_name_prefix="loops")
        self._pending: deque[tuple[int, Future]] = deque()
        self._unpack = lru_cache(_PYRAMIDS)(self._build)

    def _build(self, submap: Submap) -> tuple[OccupancyGrid, Pyramid]:
        grid = submap.grid
        return grid, Pyramid.of(grid, self.config.levels, self.config.distance, free=self.config.front > 0)

    def submit(self, candidates: Sequence[LoopCandidate]) -> None:
        """Start to search candidates."""
        for candidate in candidates:
            self._pending.append((candidate.node, self._pool.submit(self.search, candidate)))

    def results(self, before: int | None = None) -> list[Closure]:
        """Return the closures found for nodes up to `before`, or for all; waits for them."""
        found = []
        while self._pending and (before is None or self._pending[0][0] <= before):
            found.append(self._pending.popleft()[1].result())
        return [closure for closure in found if closure is not None]

    def search(self, candidate: LoopCandidate) -> Closure | None:
        """Search around the guess and refine the result; None if there is no match."""
        c, submap, points = self.config, candidate.submap, candidate.points
        grid, pyramid = self._unpack(submap)
        position_std = float(np.sqrt(np.linalg.eigvalsh(candidate.spread[:2, :2])[1]))
        yaw_std = float(np.sqrt(candidate.spread[2, 2]))
        # Penalty of the mean score that corresponds to the covariance of the guess.
        unit_penalty = c.sigma**2 / max(len(points), 1)
        found = search(
            pyramid,
            points,
            candidate.guess,
            distance=min(c.distance, max(3 * position_std, 4 * grid.resolution)),
            angle=min(c.angle, max(3 * yaw_std, 0.05)),
            min_score=candidate.min_score,
            penalty=(unit_penalty / position_std**2, unit_penalty / yaw_std**2),
            fronts=candidate.fronts if c.front else None,
        )
        if found is None:
            return None
        pose, score = found
        refined = match(grid, points, pose, sigma=c.sigma)
        moved = np.abs(between(pose, refined.pose))
        if max(moved[0], moved[1]) > 4 * grid.resolution or moved[2] > 0.1:
            return None  # the refinement leaves the peak of the search: no match
        covariance = match_covariance(refined, c.translation_floor, c.rotation_floor)
        covariance += scatter(pyramid, points, refined.pose, distance=c.distance / 2, angle=c.angle / 2, sigma=c.sigma)
        return Closure(submap.anchor, candidate.node, refined.pose, covariance, score)


class LoopVerifier:
    """Verifies closures for immediate use; the final optimisation of the graph decides over all of them again.

    A closure that agrees with the current estimate is accepted. One that contradicts it has to be possible given the
    drift of odometry, and is accepted when other closures, of other nodes nearby, contradict it in the same way:
    perceptual aliasing rarely persists over several nodes.
    """

    def __init__(self, graph: PoseGraph, drift: Drift, config: LoopConfig):
        self.graph, self.drift, self.config = graph, drift, config
        self._limit = float(chdtri(3, 1 - config.inlier_probability))
        self._contradicting: deque[tuple[int, Closure]] = deque(maxlen=4 * config.support)

    def forget(self) -> None:
        """Forget contradicting closures: nodes have been renumbered."""
        self._contradicting.clear()

    def check(self, closure: Closure) -> bool:
        """Add a closure to the graph and accept it if verified; True if the graph should be updated now."""
        number = len(self.graph.closures)
        self.graph.add_closure(closure.anchor, closure.node, closure.pose, closure.covariance)
        poses = self.graph.poses
        error = between(between(poses[closure.anchor], poses[closure.node]), closure.pose)
        if self._fits(error, closure.covariance):
            self.graph.accept(number)
            return False
        if not self._fits(error, closure.covariance + self.drift.between(closure.anchor, closure.node)):
            return False
        agreeing = [n for n, other in self._contradicting if self._agree(other, closure)]
        self._contradicting.append((number, closure))
        if len(agreeing) + 1 < self.config.support:
            return False
        for n in (*agreeing, number):
            self.graph.accept(n)
        return True

    def _agree(self, first: Closure, second: Closure) -> bool:
        if first.node == second.node and first.anchor == second.anchor:
            return False
        poses = self.graph.poses
        carried = compose(compose(poses[first.anchor], first.pose), between(poses[first.node], poses[second.node]))
        error = between(carried, compose(poses[second.anchor], second.pose))
        drift = self.drift.between(first.node, second.node) + self.drift.between(first.anchor, second.anchor)
        return self._fits(error, first.covariance + second.covariance + drift)

    def _fits(self, error: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]) -> bool:
        return float(error @ np.linalg.solve(covariance, error)) <= self._limit


def match_covariance(result: Match, translation: float, rotation: float) -> Float[np.ndarray, "3 3"]:
    """Covariance of a match: the inverse of its information, plus minimum standard deviations (m, rad); 10 m and 1 rad
    where unobservable."""
    prior_information = np.diag([1e-2, 1e-2, 1.0])
    return np.linalg.inv(result.information + prior_information) + np.diag([translation, translation, rotation]) ** 2
