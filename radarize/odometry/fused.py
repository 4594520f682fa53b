"""Fusion of the velocities by the network and by least squares, weighted by their covariances."""

from dataclasses import replace

import numpy as np

from radarize.odometry.doppler import DopplerVelocity, Velocities
from radarize.odometry.learned import ANY_VELOCITY, LearnedVelocity
from radarize.odometry.settings import FusionConfig
from radarize.signal.batch import Batch


class FusedVelocity:
    """Velocity estimator that fuses two others, weighted by their covariances and the correlation of their errors, as
    both use the same samples (Bar-Shalom and Campo, "The effect of the common process noise on the two-sensor
    fused-track covariance", 1986).

    Where the two differ by more than their covariances explain, the fused covariance is inflated.

    Args:
        learned, doppler, settings: both estimators, and the settings of the fusion.
        always: evaluate the network for every frame, not only where the covariance of least squares is large.

    Attributes:
        lever: m, lever arm of the least-squares estimate, which has the larger weight; see `VelocityEstimator`.
    """

    def __init__(
        self,
        learned: LearnedVelocity,
        doppler: DopplerVelocity,
        settings: FusionConfig | None = None,
        always: bool = True,
    ):
        self.learned, self.doppler, self.settings = learned, doppler, settings or FusionConfig()
        self.lever, self.always = doppler.lever, always

    def estimate(self, batch: Batch) -> Velocities:
        """Return the velocities of the next frames."""
        doppler = self.doppler.estimate(batch)
        uncertain = np.linalg.eigvalsh(doppler.covariance)[:, -1] > self.settings.sure**2
        network = self.learned.estimate(batch, uncertain | self.always)
        # Beyond the speed range of the network its input maps are empty.
        seen = network.seen & (np.hypot(*doppler.velocity.T) <= self.learned.limit)
        network = replace(
            network, seen=seen, covariance=np.where(seen[:, None, None], network.covariance, ANY_VELOCITY)
        )
        roots = np.linalg.cholesky(network.covariance), np.linalg.cholesky(doppler.covariance)
        # An estimator without a measurement has no error in common with the other.
        correlation = self.settings.correlation * (network.seen & doppler.seen)
        common = correlation[:, None, None] * roots[0] @ roots[1].mT
        difference = (network.velocity - doppler.velocity)[:, :, None]
        total = network.covariance + doppler.covariance - common - common.mT
        distance = (difference.mT @ np.linalg.solve(total, difference))[:, 0, 0]
        weight = (network.covariance - common) @ np.linalg.inv(total)
        velocity = network.velocity - (weight @ difference)[:, :, 0]
        covariance = network.covariance - weight @ (network.covariance - common.mT)
        covariance *= np.maximum(distance / self.settings.gate, 1.0)[:, None, None]
        return Velocities(velocity, (covariance + covariance.mT) / 2, doppler.inliers, network.seen | doppler.seen)
