"""Network and least squares together, each by what it says of its own error."""

import numpy as np
import torch
from jaxtyping import Complex64, Float

from radarize.odometry.doppler import DopplerVelocity, Velocities
from radarize.odometry.learned import LearnedVelocity


class FusedVelocity:
    """Velocity estimator that weighs two others by their covariances.

    Where they contradict each other by more than both admit, at least one is wrong without knowing: then both are
    believed less.

    Args:
        learned, doppler: the two.
        gate: squared Mahalanobis distance between them from which covariances grow.
    """

    def __init__(self, learned: LearnedVelocity, doppler: DopplerVelocity, gate: float = 9.0):
        self.learned, self.doppler, self.gate = learned, doppler, gate

    def estimate(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"], times: Float[np.ndarray, "frame"]
    ) -> Velocities:
        """Velocities of the next frames."""
        one, other = self.learned.estimate(spectrum, times), self.doppler.estimate(spectrum, times)
        apart = (one.velocity - other.velocity)[:, :, None]
        total = one.covariance + other.covariance
        distance = (apart.mT @ np.linalg.solve(total, apart))[:, 0, 0]
        weight = one.covariance @ np.linalg.inv(total)
        velocity = one.velocity - (weight @ apart)[:, :, 0]
        covariance = (one.covariance - weight @ one.covariance) * np.maximum(distance / self.gate, 1.0)[:, None, None]
        return Velocities(velocity, covariance, other.inliers, one.seen | other.seen)
