"""Network and least squares together, each by what it says of its own error."""

from dataclasses import replace

import numpy as np

from radarize.odometry.doppler import DopplerVelocity, Velocities
from radarize.odometry.learned import ANY_VELOCITY, LearnedVelocity
from radarize.odometry.settings import FusionConfig
from radarize.signal.batch import Batch


class FusedVelocity:
    """Velocity estimator that weighs two others by their covariances and the correlation of their errors: both look at
    the same samples (Bar-Shalom and Campo, "The effect of the common process noise on the two-sensor fused-track
    covariance", 1986).

    Where they contradict each other by more than both admit, at least one is wrong without knowing: then both are
    believed less.

    Args:
        learned, doppler, settings: both, and what may be set.
        always: the network is asked of every frame, not of those alone of which least squares are unsure.

    Attributes:
        lever: m, see `VelocityEstimator`: that of least squares, which has most of the say.
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
        """Velocities of the next frames."""
        other = self.doppler.estimate(batch)
        unsure = np.linalg.eigvalsh(other.covariance)[:, -1] > self.settings.sure**2
        one = self.learned.estimate(batch, unsure | self.always)
        # Faster than the network sees, its maps are empty.
        seen = one.seen & (np.hypot(*other.velocity.T) <= self.learned.limit)
        one = replace(one, seen=seen, covariance=np.where(seen[:, None, None], one.covariance, ANY_VELOCITY))
        roots = np.linalg.cholesky(one.covariance), np.linalg.cholesky(other.covariance)
        # What one estimator knows nothing of has no error in common with the other.
        both = self.settings.correlation * (one.seen & other.seen)
        common = both[:, None, None] * roots[0] @ roots[1].mT
        apart = (one.velocity - other.velocity)[:, :, None]
        total = one.covariance + other.covariance - common - common.mT
        distance = (apart.mT @ np.linalg.solve(total, apart))[:, 0, 0]
        weight = (one.covariance - common) @ np.linalg.inv(total)
        velocity = one.velocity - (weight @ apart)[:, :, 0]
        covariance = one.covariance - weight @ (one.covariance - common.mT)
        covariance *= np.maximum(distance / self.settings.gate, 1.0)[:, None, None]
        return Velocities(velocity, (covariance + covariance.mT) / 2, other.inliers, one.seen | other.seen)
