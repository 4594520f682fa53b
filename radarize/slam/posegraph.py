"""The pose graph: what nodes know of each other, and the poses that agree best with it.

While a session runs, closures that are believed go into iSAM2 (Kaess et al., IJRR 2012), which solves anew only what
they touch. At its end graduated non-convexity (Yang et al., RA-L 2020) with odometry as known inliers decides over all
closures and matches afresh (`gtsam.GncLMOptimizer`, truncated least squares). Robust kernels do worse: they keep
some false closures and weaken true ones.
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

    Every relative pose is that of node `to` in the frame of node `of`, its covariance is for (x, y, yaw) in the frame
    of `to`, the convention of gtsam. Node 0 stays where it is.

    Args:
        inlier_probability: a closure is rejected when its error is less likely than one minus this.
        alike: so many matches, and so many closures, err alike, and count as one in `covariances`.

    Attributes:
        closures: (of, to) of all closures.
        accepted: (closure,) of each, whether it is believed.
        solved: False once `covariances` could not be solved for.
    """

    def __init__(self, inlier_probability: float = 0.99, alike: int = 1):
        self.inlier_probability, self.alike = inlier_probability, alike
        self.closures: list[tuple[int, int]] = []
        self.accepted = np.zeros(0, bool)
        self.solved = True
        self._poses = Rows(3)
        self._certain: list[gtsam.BetweenFactorPose2] = []
        self._matches: list[gtsam.BetweenFactorPose2] = []
        self._matches_kept = np.zeros(0, bool)
        self._uncertain: list[gtsam.BetweenFactorPose2] = []
        self._isam: gtsam.ISAM2 | None = None
        self._factorization = "CHOLESKY"
        self._news = gtsam.NonlinearFactorGraph()  # not in iSAM2 yet
        self._known = 0  # nodes in iSAM2

    @property
    def poses(self) -> Float[np.ndarray, "node 3"]:
        """Current estimate."""
        return self._poses.values

    def add_node(self, pose: Float[np.ndarray, "3"]) -> int:
        """Add a node with a first estimate; returns its number."""
        self._poses.append(pose)
        return len(self._poses) - 1

    def add_motion(self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]):
        """A relative pose that is known not to be an outlier: odometry."""
        self._certain.append(_factor(of, to, relative, covariance))
        self._news.add(self._certain[-1])

    def add_match(self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]):
        """A match to the submap being built, or walls that are parallel: believed at once, seldom false."""
        self._matches.append(_factor(of, to, relative, covariance))
        self._news.add(self._matches[-1])

    def add_closure(self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]):
        """A relative pose from a loop search, which may be false; it is not believed yet."""
        self._uncertain.append(_factor(of, to, relative, covariance))
        self.closures.append((of, to))
        self.accepted = np.append(self.accepted, False)

    def accept(self, closure: int) -> None:
        """Let a closure move poses from the next `update` on."""
        if not self.accepted[closure]:
            self.accepted[closure] = True
            self._news.add(self._uncertain[closure])

    def keep(self, numbers: Sequence[int], spread: Callable[[int, int], Float[np.ndarray, "3 3"]]) -> None:
        """Forget all nodes but these, which then count from 0 on.

        Where nodes go, their neighbours keep the motion between them as it is known now, as sure as odometry is of it.

        Args:
            numbers: of the nodes to keep, ascending.
            spread: covariance of the motion between two nodes, by odometry.
        """
        place = {int(number): k for k, number in enumerate(numbers)}

        def stays(factors: list) -> np.ndarray:
            return np.array([all(key in place for key in factor.keys()) for factor in factors], bool)

        def chosen(factors: list, stay: np.ndarray) -> list:
            moved = [factor for factor, each in zip(factors, stay, strict=True) if each]
            return [
                gtsam.BetweenFactorPose2(*(place[k] for k in f.keys()), f.measured(), f.noiseModel()) for f in moved
            ]

        steps = {tuple(factor.keys()): factor for factor in self._certain}
        self._certain = [
            gtsam.BetweenFactorPose2(place[a], place[b], steps[a, b].measured(), steps[a, b].noiseModel())
            if (a, b) in steps
            else _factor(place[a], place[b], between(self.poses[a], self.poses[b]), spread(a, b))
            for a, b in pairwise(map(int, numbers))
        ]
        matches, closures = stays(self._matches), stays(self._uncertain)
        self._matches, self._uncertain = chosen(self._matches, matches), chosen(self._uncertain, closures)
        self._matches_kept = self._matches_kept[matches[: len(self._matches_kept)]]
        self.accepted = self.accepted[closures]
        self.closures = [tuple(factor.keys()) for factor in self._uncertain]
        poses, self._poses = self.poses[list(numbers)], Rows(3)
        for pose in poses:
            self._poses.append(pose)
        self._isam, self._news = None, gtsam.NonlinearFactorGraph()

    def update(self) -> None:
        """Move poses towards where everything believed agrees, by one step, solving anew only what changed."""
        if len(self.poses) < 2:
            return
        try:
            self._step()
        except RuntimeError:  # steps known to 0.1 mm beside ones known to radians are too much for Cholesky, the faster
            self._isam, self._factorization = None, "QR"
            self._step()

    def _step(self) -> None:
        if self._isam is None:
            self._isam, self._known = gtsam.ISAM2(_incremental(self._factorization)), 0
            self._news = self._graph(self._accepted_factors())
        self._isam.update(self._news, self._values(self._known))
        self._news, self._known = gtsam.NonlinearFactorGraph(), len(self.poses)
        self.poses[:] = gtsam.utilities.extractPose2(self._isam.calculateBestEstimate())

    def optimise(self) -> None:
        """Decide over all closures afresh, and move poses to the optimum."""
        if len(self.poses) < 2:
            return
        if self._uncertain or self._matches:
            self._judge()
        graph = self._graph(self._accepted_factors())
        values = gtsam.LevenbergMarquardtOptimizer(graph, self._values(), _levenberg()).optimize()
        self.poses[:] = gtsam.utilities.extractPose2(values)
        self._isam = None

    def covariances(self) -> Float[np.ndarray, "node 3 3"]:
        """Marginal covariance of every node for (x, y, yaw) in its own frame, given that node 0 is exact; where no
        solver finds it, that of odometry alone, and `solved` is False."""
        if not len(self.poses):
            return np.zeros((0, 3, 3))
        graph, values = self._graph([self._counted(factor) for factor in self._accepted_factors()]), self._values()
        for solve in (gtsam.Marginals, _by_qr):
            try:
                solution = solve(graph, values)
                found = np.stack([solution.marginalCovariance(k) for k in range(len(self.poses))])
            except RuntimeError:
                continue
            if np.isfinite(found).all() and (found.diagonal(axis1=1, axis2=2) > 0).all():
                return found
        self.solved = False
        return self._reckoned()

    def _reckoned(self) -> Float[np.ndarray, "node 3 3"]:
        """What odometry alone leaves unknown of every node: at least what it is with matches and closures."""
        found = np.zeros((len(self.poses), 3, 3))
        for factor in self._certain:
            of, to = factor.keys()
            motion = between(self.poses[of], self.poses[to])
            found[to] = carried(found[of], motion) + factor.noiseModel().covariance()
        return found

    def _accepted_factors(self) -> list:
        new = np.ones(len(self._matches) - len(self._matches_kept), bool)
        keep = np.concatenate([self._matches_kept, new, self.accepted])
        return [factor for factor, keep in zip([*self._matches, *self._uncertain], keep, strict=True) if keep]

    def _counted(self, factor: gtsam.BetweenFactorPose2) -> gtsam.BetweenFactorPose2:
        """A match or a closure at its share: `alike` of them weigh as much as one."""
        noise = gtsam.noiseModel.Gaussian.Covariance(self.alike * factor.noiseModel().covariance())
        return gtsam.BetweenFactorPose2(*factor.keys(), factor.measured(), noise)

    def _judge(self) -> None:
        graph = self._graph([*self._matches, *self._uncertain])
        known = 1 + len(self._certain)
        parameters = gtsam.GncLMParams(_levenberg())
        parameters.setLossType(gtsam.GncLossType.TLS)
        parameters.setKnownInliers(list(range(known)))
        optimizer = gtsam.GncLMOptimizer(graph, self._values(), parameters)
        optimizer.setInlierCostThresholdsAtProbability(self.inlier_probability)
        optimizer.optimize()
        kept = np.asarray(optimizer.getWeights())[known:] > 0.5
        self._matches_kept, self.accepted = kept[: len(self._matches)], kept[len(self._matches) :]

    def _graph(self, others: list) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        anchor = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
        graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*self.poses[0]), anchor))
        for factor in (*self._certain, *others):
            graph.add(factor)
        return graph

    def _values(self, first: int = 0) -> gtsam.Values:
        values = gtsam.Values()
        for k, pose in enumerate(self.poses[first:], first):
            values.insert(k, gtsam.Pose2(*pose))
        return values


def _factor(of, to, relative, covariance) -> gtsam.BetweenFactorPose2:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return gtsam.BetweenFactorPose2(of, to, gtsam.Pose2(*relative), noise)


def _by_qr(graph: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.ISAM2:
    """Slower than Cholesky, whose squares of residuals have twice the digits to lose."""
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
