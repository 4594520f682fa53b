"""Ego-velocity from a sparse point cloud: three-point RANSAC, then least squares over the inliers.

Doer and Trommer, "An EKF based approach to radar inertial odometry", MFI 2020 (REVE), without its filter. Static points
have the closing speed u . v, where u is the direction of the point and v the velocity of the sensor.
"""

import math

import numpy as np
from jaxtyping import Float

from radarize.odometry.doppler import Velocities
from radarize.odometry.integration import Odometry
from radarize.odometry.rotation import MapRotation
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch

#: Variance of an unobservable velocity, (m/s)^2.
_UNKNOWN = 1.0


#: As published: maximum residual of an inlier, m/s; share of outliers; probability that at least one hypothesis is free
#: of outliers.
_INLIER, _OUTLIERS, _SUCCESS = 0.15, 0.4, 0.9999
#: Median speed below which the sensor stands still (zero-velocity test), m/s; minimum standard deviation of a speed,
#: m/s.
_STILL, _NOISE = 0.05, 0.02
#: Number of hypotheses.
HYPOTHESES = math.ceil(math.log(1 - _SUCCESS) / math.log(1 - (1 - _OUTLIERS) ** 3))


class RansacVelocity:
    """Velocity estimator without state between frames; all frames use the same table of random triples."""

    #: Lever arm of `VelocityEstimator`, m; zero as published.
    lever = 0.0

    def __init__(self):
        self._draws = np.random.default_rng(0).random((HYPOTHESES, 3))

    def estimate(self, batch: Batch) -> Velocities:
        """Estimate velocities of the next frames.

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
        """Estimate the velocity of one frame (forward, left), m/s, its covariance, and the number of inliers."""
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
    """Make odometry with RANSAC velocities in place of those of the method `doppler`."""
    settings = inputs.configuration
    rotation = MapRotation(inputs.signal.heatmaps, settings.rotation)
    return Odometry(inputs.radar, RansacVelocity(), rotation, settings.velocity)


METHOD = Method("Doppler RANSAC", odometry)
