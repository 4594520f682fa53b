"""Ego-velocity from a sparse point cloud: three-point RANSAC, then least squares over what agrees.

Doer and Trommer, "An EKF based approach to radar inertial odometry", MFI 2020 (REVE), without its filter: points of a
static world close at u . v, u being their direction and v the sensor's velocity.
"""

import math

import numpy as np
from jaxtyping import Float

from radarize.odometry.doppler import Velocities
from radarize.odometry.integration import Odometry
from radarize.odometry.rotation import MapRotation
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch

#: (m/s)^2, of a velocity that the points do not tell.
_UNKNOWN = 1.0


#: As published: m/s, by how much a point's speed may differ; share of points that may be wrong; probability that one
#: hypothesis, at least, is made of right points alone.
_INLIER, _OUTLIERS, _SUCCESS = 0.15, 0.4, 0.9999
#: m/s: if the median of all speeds is less, the sensor stands (zero-velocity test); least deviation of a speed.
_STILL, _NOISE = 0.05, 0.02
#: Triples of points that are tried.
HYPOTHESES = math.ceil(math.log(1 - _SUCCESS) / math.log(1 - (1 - _OUTLIERS) ** 3))


class RansacVelocity:
    """Velocity estimator; stateless between frames, whose triples come from one table."""

    #: m, see `VelocityEstimator`; as published.
    lever = 0.0

    def __init__(self):
        self._draws = np.random.default_rng(0).random((HYPOTHESES, 3))

    def estimate(self, batch: Batch) -> Velocities:
        """Velocities of the next frames.

        Raises:
            InputError: see `PointClouds`.
        """
        points, frame = batch.points
        found = [self.solve(points[frame == k]) for k in range(len(batch))]
        velocity, covariance, inliers = zip(*found, strict=True)
        inliers = np.array(inliers)
        return Velocities(np.stack(velocity), np.stack(covariance), inliers, inliers > 0)

    def solve(
        self, points: Float[np.ndarray, "point 6"]
    ) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2 2"], int]:
        """Velocity of one frame (forward, left), m/s, its covariance, and the points that agree."""
        unknown = np.zeros(2), _UNKNOWN * np.eye(2), 0
        if len(points) < 3:
            return unknown
        direction = points[:, :3] / np.linalg.norm(points[:, :3], axis=1, keepdims=True)
        speed = points[:, 3]
        if np.median(np.abs(speed)) < _STILL:
            return np.zeros(2), _NOISE**2 * np.eye(2), len(points)
        triples = (self._draws * len(points)).astype(int)
        regular = np.abs(np.linalg.det(direction[triples])) > 1e-4
        if not regular.any():
            return unknown
        guesses = np.linalg.solve(direction[triples[regular]], speed[triples[regular]][..., None])[..., 0]
        agree = np.abs(speed - guesses @ direction.T) < _INLIER
        agree = agree[agree.sum(axis=1).argmax()]
        normal = direction[agree].T @ direction[agree]
        if agree.sum() < 4 or np.linalg.cond(normal) > 1e6:
            return unknown
        velocity = np.linalg.solve(normal, direction[agree].T @ speed[agree])
        residual = speed[agree] - direction[agree] @ velocity
        variance = max((residual**2).sum() / (agree.sum() - 3), _NOISE**2)
        return velocity[:2], (variance * np.linalg.inv(normal))[:2, :2], int(agree.sum())


def odometry(inputs: Inputs) -> Odometry:
    """Least squares over a sparse point cloud, in the place of `doppler`'s."""
    settings = inputs.configuration
    rotation = MapRotation(inputs.signal.heatmaps, settings.rotation)
    return Odometry(inputs.radar, RansacVelocity(), rotation, settings.velocity)


METHOD = Method("Doppler RANSAC", odometry)
