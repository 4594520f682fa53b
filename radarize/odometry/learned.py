"""Velocity and rotation estimators by the networks (paper, sections 4.2 and 4.3)."""

from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from radarize.learning.nets.compiled import compiled
from radarize.learning.nets.motion import RotationNet, TranslationNet
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import LAG, Rotations
from radarize.odometry.settings import TurnConfig
from radarize.odometry.smoother import FixedLagSmoother
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch

#: Covariance of a velocity without network output, (m/s)^2.
ANY_VELOCITY = 2.0**2 * np.eye(2)
#: Minimum weight of the measurement in the network's estimate of a turn (`LearnedRotation`).
_LEAST_WEIGHT = 0.25


class LearnedVelocity:
    """Velocity estimator by `TranslationNet`.

    Attributes:
        limit: m/s, maximum speed that the network covers.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    #: m, see `VelocityEstimator`: the network is trained on the velocity of the origin.
    lever = 0.0

    def __init__(self, radar: RadarConfig, weights: Path):
        self._net, header = compiled(weights, TranslationNet, radar)
        self._windows = header.windows(radar, TranslationNet.maker)
        self.limit = header.map_grid.reach / 2

    @torch.inference_mode()
    def estimate(self, batch: Batch, requested: Bool[np.ndarray, "frame"] | None = None) -> Velocities:
        """Return the velocities of the next frames, or of the requested ones only; inliers are zero."""
        measured = np.asarray(~batch.aliases.any(axis=1))  # the network is trained on speeds without aliasing
        if requested is not None:
            measured &= requested
        velocity = np.zeros((len(batch), 2))
        covariance = np.tile(ANY_VELOCITY, (len(batch), 1, 1))
        self._windows.announce(partial(batch.maps, self._windows.maps), batch.stamps)
        if measured.any():
            (shown,) = self._windows.wanted()
            measured &= shown.whole
        if measured.any():
            mean, spread = self._net.estimate(shown.maps[measured])
            velocity[measured], covariance[measured] = mean.double().numpy(), spread.double().numpy()
        return Velocities(velocity, covariance, np.zeros(len(batch), int), measured)


class LearnedRotation:
    """Rotation estimator by `RotationNet`: yaw increments over several frame spacings, fused by a smoother.

    The paper sums the increments of one spacing in interleaved chains, which drift apart. Here the yaws of the last
    frames are states of a `FixedLagSmoother`, which predicts with the yaw rate where frames are lost.

    Attributes:
        lag: see `RotationEstimator`.
        spacings: spacings of the increments, in frames of the radar, ascending.
    """

    lag = LAG

    def __init__(self, radar: RadarConfig, weights: Path, settings: TurnConfig | None = None):
        settings = settings or TurnConfig()
        self._net, header = compiled(weights, RotationNet, radar)
        trained = header.spacings
        spacings = [s for s in settings.spacings if s in trained] or trained
        self._windows = header.windows(radar, RotationNet.maker, spacings)
        self.spacings = self._windows.spacings
        size = self.spacings[-1] + 1
        self._longest = (size - 0.5) * radar.frame_period
        self._velocities, self._times = np.zeros((0, 2)), np.zeros(0)  # of the last `size` frames
        self._yaws = FixedLagSmoother(size, settings.wander, settings.fastest)
        self._inflation, self._trained = settings.variance_factor, settings.trained

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations:
        """Return the yaw increments of the next frames; their variances add up to that of the yaw since the start."""
        times = batch.centers
        before = self._times[-1] if len(self._times) else times[0]
        turns, back = self.turns(batch, velocities)
        yaw, growth = np.zeros(len(times)), np.zeros(len(times))
        for i, dt in enumerate(np.diff(times, prepend=before)):
            last, variance = self._yaws.values[-1], self._yaws.covariance[-2, -2]
            self._yaws.predict(float(dt))
            if dt > self._longest:
                # Measurements after a gap would also correct the yaw increment of the gap, but that correction would
                # appear as an increment of a later frame. So the filter forgets the correlation with earlier frames.
                self._yaws.decouple()
            for ago, (turn, noise) in zip(back[:, i], turns[:, i], strict=True):
                self._yaws.add_relative_motion(int(ago), turn, noise)
            yaw[i] = self._yaws.values[-1] - last
            growth[i] = max(self._yaws.covariance[-2, -2] - variance, 1e-8)
        measured = np.asarray((back > 0).any(axis=0))
        growth[measured] *= self._inflation
        return Rotations.independent(yaw, growth, measured)

    @torch.inference_mode()
    def turns(
        self, batch: Batch, velocities: Velocities
    ) -> tuple[Float[np.ndarray, "spacing frame 2"], Int[np.ndarray, "spacing frame"]]:
        """Return the yaw increments that the network estimates for the next frames.

        Returns:
            Yaw increments (rad) over each spacing and their variances (rad^2); NaN where a window lacks frames.
            Number of frames that each increment spans; 0 where a window lacks frames.
        """
        windows = self._windows.push(batch.maps(self._windows.maps), batch.stamps)
        whole = np.stack([shown.whole for shown in windows])
        back = np.where(whole, np.stack([shown.back for shown in windows]), 0)
        turns = np.full((*back.shape, 2), np.nan)
        duration, travel = (each[whole] for each in self._travel(batch.centers, velocities.velocity, back))
        if whole.any():
            shown = torch.cat([shown.maps[shown.whole] for shown in windows])
            mean, variance = self._net.estimate(shown, torch.from_numpy(travel).float())
            turns[whole] = torch.stack([mean[:, 0], variance[:, 0, 0]], dim=1).double().numpy()
            turns[whole] /= self._weight(turns[whole][:, 1], duration)[:, None]
        return turns, back

    def _weight(
        self, variance: Float[np.ndarray, "window"], duration: Float[np.ndarray, "window"]
    ) -> Float[np.ndarray, "window"]:
        """Weight of the measurement in the network's estimate, the mean of a posterior: the rest is the prior, zero.
        Divided by it, mean and variance are those of the measurement alone (product of Gaussians)."""
        return np.maximum(1 - variance / (self._trained * duration) ** 2, _LEAST_WEIGHT)

    def _travel(
        self, times: np.ndarray, velocities: np.ndarray, back: np.ndarray
    ) -> tuple[Float[np.ndarray, "spacing frame"], Float[np.ndarray, "spacing frame 2"]]:
        """Duration of each window, and displacement over it from the velocities, an input of `RotationNet`."""
        kept = 1 - len(self._yaws.values)
        self._times = np.concatenate([self._times[kept:], times])
        self._velocities = np.concatenate([self._velocities[kept:], velocities])
        newest = np.arange(len(self._times) - len(times), len(self._times))
        first = newest - back
        duration = self._times[newest] - self._times[first]
        return duration, duration[..., None] * (self._velocities[newest] + self._velocities[first]) / 2
