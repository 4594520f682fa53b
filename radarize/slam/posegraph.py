"""The pose graph: what nodes know of each other, and the poses that agree best with it.

Motions and matches are Gaussian. Closures may be false; graduated non-convexity (Yang et al., RA-L 2020) with motions
and matches as known inliers decides which of them to believe (`gtsam.GncLMOptimizer`, truncated least squares). Robust
kernels do worse: they keep some false closures and weaken true ones.
"""

from dataclasses import dataclass, field

import gtsam
import numpy as np
from jaxtyping import Bool, Float


@dataclass
class PoseGraph:
    """Poses of nodes and relative poses between them.

    Every relative pose is that of node `to` in the frame of node `of`, its covariance is for (x, y, yaw) in the frame
    of `to`, the convention of gtsam.

    Attributes:
        inlier_probability: a closure is rejected when its error is less likely than one minus this.
        poses: current estimate, one per node; node 0 stays where it is.
        closures: (of, to) of all closures.
        accepted: of each closure, whether the last optimisation believed it.
    """

    inlier_probability: float = 0.99
    poses: list[np.ndarray] = field(default_factory=list)
    closures: list[tuple[int, int]] = field(default_factory=list)
    accepted: Bool[np.ndarray, "closure"] = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self):
        self._certain: list[gtsam.BetweenFactorPose2] = []
        self._uncertain: list[gtsam.BetweenFactorPose2] = []

    def add_node(self, pose: Float[np.ndarray, "3"]) -> int:
        """Add a node with a first estimate; returns its number."""
        self.poses.append(np.asarray(pose, float))
        return len(self.poses) - 1

    def add_motion(self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]):
        """A relative pose that is known not to be an outlier: odometry, or a match to the submap being built."""
        self._certain.append(_factor(of, to, relative, covariance))

    def add_closure(self, of: int, to: int, relative: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"]):
        """A relative pose from a loop search, which may be false."""
        self._uncertain.append(_factor(of, to, relative, covariance))
        self.closures.append((of, to))

    def optimise(self, reject: bool = True) -> None:
        """Move `poses` to the optimum, and set `accepted`.

        Args:
            reject: decide anew which closures to believe; otherwise keep what was believed, and believe new ones.
        """
        if len(self.poses) < 2:
            return
        if reject and self._uncertain:
            self.accepted = self._judge()
        else:
            new = len(self._uncertain) - len(self.accepted)
            self.accepted = np.concatenate([self.accepted, np.ones(new, bool)])
        believed = [f for f, keep in zip(self._uncertain, self.accepted, strict=True) if keep]
        graph = self._graph(believed)
        self._set(gtsam.LevenbergMarquardtOptimizer(graph, self._values(), _levenberg()).optimize())

    def covariances(self) -> Float[np.ndarray, "node 3 3"]:
        """Marginal covariance of every node for (x, y, yaw) in its own frame, given that node 0 is exact."""
        if not self.poses:
            return np.zeros((0, 3, 3))
        believed = [f for f, keep in zip(self._uncertain, self.accepted, strict=False) if keep]
        marginals = gtsam.Marginals(self._graph(believed), self._values())
        return np.stack([marginals.marginalCovariance(k) for k in range(len(self.poses))])

    def _judge(self) -> Bool[np.ndarray, "closure"]:
        graph = self._graph(self._uncertain)
        known = graph.size() - len(self._uncertain)
        parameters = gtsam.GncLMParams(_levenberg())
        parameters.setLossType(gtsam.GncLossType.TLS)
        parameters.setKnownInliers(list(range(known)))
        optimizer = gtsam.GncLMOptimizer(graph, self._values(), parameters)
        optimizer.setInlierCostThresholdsAtProbability(self.inlier_probability)
        optimizer.optimize()
        return np.asarray(optimizer.getWeights())[known:] > 0.5

    def _graph(self, closures: list) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        anchor = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)
        graph.add(gtsam.PriorFactorPose2(0, gtsam.Pose2(*self.poses[0]), anchor))
        for factor in self._certain:
            graph.add(factor)
        for factor in closures:
            graph.add(factor)
        return graph

    def _values(self) -> gtsam.Values:
        values = gtsam.Values()
        for k, pose in enumerate(self.poses):
            values.insert(k, gtsam.Pose2(*pose))
        return values

    def _set(self, values: gtsam.Values) -> None:
        for k in range(len(self.poses)):
            pose = values.atPose2(k)
            self.poses[k] = np.array([pose.x(), pose.y(), pose.theta()])


def _factor(of, to, relative, covariance) -> gtsam.BetweenFactorPose2:
    noise = gtsam.noiseModel.Gaussian.Covariance(covariance)
    return gtsam.BetweenFactorPose2(of, to, gtsam.Pose2(*relative), noise)


def _levenberg() -> gtsam.LevenbergMarquardtParams:
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(1e-4)
    return parameters
