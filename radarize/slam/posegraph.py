"""Pose graph: relative poses between nodes, and the poses that fit them best.

While a session runs, accepted closures are added to iSAM2 (Kaess et al., IJRR 2012), which updates only the affected
part. At its end, graduated non-convexity (Yang et al., RA-L 2020; `gtsam.GncLMOptimizer`, truncated least squares)
decides over all closures and matches again, with odometry as known inliers. Robust kernels give worse results: they
keep some false closures and weaken true ones.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import gtsam
import numpy as np
from jaxtyping import Float

from radarize.io.pose import between, carried
from radarize.slam.rows import Rows


class PoseGraph:
    """Poses of nodes and relative poses between them.

    Every relative pose is that of node `to` in the frame of node `of`. Its covariance is for (x, y, yaw) in the frame
    of `to`, the convention of gtsam. Node 0 is fixed.

    Args:
        inlier_probability: a closure is rejected if its error is less likely than one minus this.
        correlated: number of matches, and of closures, with fully correlated errors; `covariances` counts them as one.

    Attributes:
        closures: (of, to) of all closures.
        accepted: (closure,) whether each closure is accepted.
        solved: False once `covariances` failed.
    """

    def __init__(self, inlier_probability: float = 0.99, correlated: int = 1):
        self.inlier_probability, self.correlated = inlier_probability, correlated
        self.closures: list[tuple[int, int]] = []
        self.accepted = np.zeros(0, bool)
        self.solved = True
        self._poses = Rows(3)
        self._motion_factors: list[gtsam.BetweenFactorPose2] = []
        self._match_factors: list[gtsam.BetweenFactorPose2] = []
        self._accepted_matches = np.zeros(0, bool)
        self._closure_factors: list[gtsam.BetweenFactorPose2] = []
        self._isam: gtsam.ISAM2 | None = None
        self._factorization = "CHOLESKY"
        self._pending = gtsam.NonlinearFactorGraph()  # factors that are not in iSAM2 yet
        self._in_isam = 0  # number of nodes in iSAM2

    @property
    def poses(self) -> Float[np.ndarray, "node 3"]:
        """Current estimates."""
        return self._poses.values

    def add_node(self, pose: Float[np.ndarray, "3"]) -> int:
        """Add a node with an initial estimate; returns its number."""
        self._poses.append(pose)
        return len(self._poses) - 1

    def add_motion(
        self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]
    ) -> None:
        """Add a relative pose by odometry, a known inlier."""
        self._motion_factors.append(_factor(of, to, relative, covariance))
        self._pending.add(self._motion_factors[-1])

    def add_match(
        self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]
    ) -> None:
        """Add a match with the submap being built, or a heading constraint from walls: accepted until the final
        optimisation."""
        self._match_factors.append(_factor(of, to, relative, covariance))
        self._pending.add(self._match_factors[-1])

    def add_closure(
        self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]
    ) -> None:
        """Add a loop closure, which may be false; it has no effect until it is accepted."""
        self._closure_factors.append(_factor(of, to, relative, covariance))
        self.closures.append((of, to))
        self.accepted = np.append(self.accepted, False)

    def accept(self, closure: int) -> None:
        """Accept a closure; it takes effect at the next `update`."""
        if not self.accepted[closure]:
            self.accepted[closure] = True
            self._pending.add(self._closure_factors[closure])

    def keep(self, numbers: Sequence[int], spread: Callable[[int, int], Float[np.ndarray, "3 3"]]) -> None:
        """Remove all other nodes; those kept are renumbered from 0.

        Where nodes are removed, their neighbours get the current estimate of the motion between them, with the
        covariance of odometry.

        Args:
            numbers: of the nodes to keep, ascending.
            spread: covariance of the motion between two nodes, by odometry.
        """
        place = {int(number): k for k, number in enumerate(numbers)}

        def stays(factors: list) -> np.ndarray:
            return np.array([all(key in place for key in factor.keys()) for factor in factors], bool)

        def chosen(factors: list, stay: np.ndarray) -> list:
            moved = [(*factor.keys(), factor) for factor, each in zip(factors, stay, strict=True) if each]
            return [gtsam.BetweenFactorPose2(place[a], place[b], f.measured(), f.noiseModel()) for a, b, f in moved]

        steps = {tuple(factor.keys()): factor for factor in self._motion_factors}
        self._motion_factors = [
            gtsam.BetweenFactorPose2(place[a], place[b], steps[a, b].measured(), steps[a, b].noiseModel())
            if (a, b) in steps
            else _factor(place[a], place[b], between(self.poses[a], self.poses[b]), spread(a, b))
            for a, b in pairwise(map(int, numbers))
        ]
        matches, closures = stays(self._match_factors), stays(self._closure_factors)
        self._match_factors = chosen(self._match_factors, matches)
        self._closure_factors = chosen(self._closure_factors, closures)
        self._accepted_matches = self._accepted_matches[matches[: len(self._accepted_matches)]]
        self.accepted = self.accepted[closures]
        self.closures = [(of, to) for of, to in (factor.keys() for factor in self._closure_factors)]
        poses, self._poses = self.poses[list(numbers)], Rows(3)
        for pose in poses:
            self._poses.append(pose)
        self._isam, self._pending = None, gtsam.NonlinearFactorGraph()

    def update(self) -> None:
        """Update the poses by one step of iSAM2 with all accepted factors."""
        if len(self.poses) < 2:
            return
        try:
            self._step()
        except RuntimeError:  # covariances from (0.1 mm)^2 to rad^2 in one graph exceed the precision of Cholesky
            self._isam, self._factorization = None, "QR"
            self._step()

    def _step(self) -> None:
        if self._isam is None:
            self._isam, self._in_isam = gtsam.ISAM2(_incremental(self._factorization)), 0
            self._pending = self._graph(self._accepted_factors())
        self._isam.update(self._pending, self._values(self._in_isam))
        self._pending, self._in_isam = gtsam.NonlinearFactorGraph(), len(self.poses)
        self.poses[:] = gtsam.utilities.extractPose2(self._isam.calculateBestEstimate())

    def optimise(self) -> None:
        """Reject outliers among all closures and matches, and optimise the poses."""
        if len(self.poses) < 2:
            return
        if self._closure_factors or self._match_factors:
            self._reject_outliers()
        graph = self._graph(self._accepted_factors())
        values = gtsam.LevenbergMarquardtOptimizer(graph, self._values(), _levenberg()).optimize()
        self.poses[:] = gtsam.utilities.extractPose2(values)
        self._isam = None

    def covariances(self) -> Float[np.ndarray, "node 3 3"]:
        """Return the marginal covariance of every node for (x, y, yaw) in its own frame, given node 0. If no solver
        succeeds, return that of odometry and set `solved` to False."""
        if not len(self.poses):
            return np.zeros((0, 3, 3))
        graph, values = self._graph([self._downweighted(factor) for factor in self._accepted_factors()]), self._values()
        for solve in (gtsam.Marginals, _by_qr):
            try:
                solution = solve(graph, values)
                found = np.stack([solution.marginalCovariance(k) for k in range(len(self.poses))])
            except RuntimeError:
                continue
            if np.isfinite(found).all() and (found.diagonal(axis1=1, axis2=2) > 0).all():
                return found
        self.solved = False
        return self._odometry_covariances()

    def _odometry_covariances(self) -> Float[np.ndarray, "node 3 3"]:
        """Covariance of every node by odometry alone, an upper bound of that with matches and closures."""
        found = np.zeros((len(self.poses), 3, 3))
        for factor in self._motion_factors:
            of, to = factor.keys()
            motion = between(self.poses[of], self.poses[to])
            found[to] = carried(found[of], motion) + _covariance(factor)
        return found

    def _accepted_factors(self) -> list:
        new = np.ones(len(self._match_factors) - len(self._accepted_matches), bool)
        keep = np.concatenate([self._accepted_matches, new, self.accepted])
        factors = [*self._match_factors, *self._closure_factors]
        return [factor for factor, keep in zip(factors, keep, strict=True) if keep]

    def _downweighted(self, factor: gtsam.BetweenFactorPose2) -> gtsam.BetweenFactorPose2:
        """The factor of a match or a closure with its covariance multiplied by `correlated`."""
        noise = gtsam.noiseModel.Gaussian.Covariance(self.correlated * _covariance(factor))
        of, to = factor.keys()
        return gtsam.BetweenFactorPose2(of, to, factor.measured(), noise)

    def _reject_outliers(self) -> None:
        graph = self._graph([*self._match_factors, *self._closure_factors])
        known = 1 + len(self._motion_factors)
        parameters = gtsam.GncLMParams(_levenberg())
        parameters.setLossType(gtsam.GncLossType.TLS)
        parameters.setKnownInliers(list(range(known)))
        optimizer = gtsam.GncLMOptimizer(graph, self._values(), parameters)
        optimizer.setInlierCostThresholdsAtProbability(self.inlier_probability)
        optimizer.optimize()
        kept = np.asarray(optimizer.getWeights())[known:] > 0.5
        self._accepted_matches, self.accepted = kept[: len(self._match_factors)], kept[len(self._match_factors) :]

    def _graph(self, others: list) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        anchor = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
        graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*self.poses[0]), anchor))
        for factor in (*self._motion_factors, *others):
            graph.add(factor)
        return graph

    def _values(self, first: int = 0) -> gtsam.Values:
        values = gtsam.Values()
        for k, pose in enumerate(self.poses[first:], first):
            values.insert(k, gtsam.Pose2(*pose))
        return values


def _covariance(factor: gtsam.BetweenFactorPose2) -> Float[np.ndarray, "3 3"]:
    noise = factor.noiseModel()
    assert isinstance(noise, gtsam.noiseModel.Gaussian)
    return noise.covariance()


def _factor(
    of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]
) -> gtsam.BetweenFactorPose2:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return gtsam.BetweenFactorPose2(of, to, gtsam.Pose2(*relative), noise)


def _by_qr(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.ISAM2:
    """Solver by QR decomposition: slower than Cholesky but more precise, as it does not square the condition number."""
    solution = gtsam.ISAM2(_incremental("QR"))
    solution.update(graph, values)
    return solution


def _levenberg() -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-4)
    return parameters


def _incremental(factorization: str) -> gtsam.ISAM2Params:
    parameters = gtsam.ISAM2Params()
    parameters.setRelinearizeThreshold(0.02)
    parameters.relinearizeSkip = 1
    parameters.setFactorization(factorization)
    return parameters
