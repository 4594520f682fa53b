"""Velocity and turns by the networks (paper, sections 4.2 and 4.3), as estimators like any others."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from radarize.batch import Batch
from radarize.features.windows import silent
from radarize.methods.radarize.motion import RotationNet, TranslationNet
from radarize.nets.weights import load
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import Rotations
from radarize.odometry.ties import Ties
from radarize.radar.config import RadarConfig

#: m/s and rad, standard deviations of what may have happened meanwhile.
_ANY_VELOCITY, _ANY_TURN = 2.0, 1.0


class LearnedVelocity:
    """Velocity estimator by `TranslationNet`.

    Args:
        radar: configuration.
        weights: file.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path):
        self._net, header = load(weights, TranslationNet, radar)
        self._windows = header.windows(radar)

    @torch.inference_mode()
    def estimate(self, batch: Batch) -> Velocities:
        """Velocities of the next frames; no echoes are counted."""
        shown = self._windows.push(batch)[0]
        mean, covariance = self._net.estimate(shown)
        lost = silent(shown)
        mean[lost], covariance[lost] = 0.0, _ANY_VELOCITY**2 * torch.eye(2)
        return Velocities(mean.double().numpy(), covariance.double().numpy(), np.zeros(len(mean), int))


class LearnedRotation:
    """Rotation estimator by `RotationNet`: turns over several spacings, reconciled by a filter.

    The paper sums turns of one spacing in interleaved chains, which drift apart. Here the yaws of the last frames are
    one Gaussian state (`Ties`).

    Args:
        radar: configuration.
        weights: file.
        spacings: of the network's frames, over which turns are measured; some of those it was trained on.
        jerk: rad/s, standard deviation of the change of turning rate from frame to frame.
        fastest: rad/s, standard deviation of the turning rate before anything is known.
    """

    def __init__(
        self,
        radar: RadarConfig,
        weights: Path,
        spacings: Sequence[int] = (1, 2, 4),
        jerk: float = np.radians(12.0),
        fastest: float = np.radians(60.0),
    ):
        self._net, header = load(weights, RotationNet, radar)
        self._windows, known = header.windows(radar), header.spacings
        self.spacings = [s for s in spacings if s in known] or list(known)
        size = max(self.spacings) * self._windows.stride + 1
        self._velocities, self._times = np.zeros((0, 2)), np.zeros(0)  # of as many frames
        self._yaws = Ties(size, jerk, fastest)

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations:
        """Yaw increments of the next frames; their variances add up to that of the yaw since the beginning."""
        times, turns = batch.centers, self.turns(batch, velocities)
        yaw, growth = np.zeros(len(times)), np.zeros(len(times))
        for i in range(len(times)):
            before, known = self._yaws.values[-1], self._yaws.covariance[-1, -1]
            now = len(self._times) - len(times) + i
            self._yaws.predict(float(self._times[now] - self._times[max(now - 1, 0)]))
            for spacing, (turn, noise) in zip(self.spacings, turns[:, i], strict=True):
                self._yaws.tie(spacing * self._windows.stride, turn, noise)
            yaw[i] = self._yaws.values[-1] - before
            growth[i] = max(self._yaws.covariance[-1, -1] - known, 1e-8)
        return Rotations(yaw, growth, np.zeros(len(times)))

    @property
    def stride(self) -> int:
        """The radar's frames from one of the network's to the next."""
        return self._windows.stride

    @torch.inference_mode()
    def turns(self, batch: Batch, velocities: Velocities) -> Float[np.ndarray, "spacing frame 2"]:
        """What the network says of the next frames: turns (rad) over each of `spacings` until them, and variances."""
        windows = self._windows.push(batch, self.spacings)
        travel = self._travel(batch.centers, velocities.velocity)
        shown = torch.cat(windows)
        mean, variance = self._net.estimate(shown, torch.from_numpy(travel).float())
        lost = silent(shown)
        mean[lost], variance[lost] = 0.0, _ANY_TURN**2
        return torch.stack([mean[:, 0], variance[:, 0, 0]], dim=1).double().numpy().reshape(len(windows), -1, 2)

    def _travel(self, times: np.ndarray, velocities: np.ndarray) -> Float[np.ndarray, "window 2"]:
        """What `RotationNet` wants to be told of the windows, spacing by spacing."""
        new, size = len(times), len(self._yaws.values)
        self._times = np.concatenate([self._times[1 - size :], times])
        self._velocities = np.concatenate([self._velocities[1 - size :], velocities])
        newest = np.arange(len(self._times) - new, len(self._times))
        first = [np.maximum(newest - spacing * self._windows.stride, 0) for spacing in self.spacings]
        lasting = [self._times[newest] - self._times[start] for start in first]
        mean = [(self._velocities[newest] + self._velocities[start]) / 2 for start in first]
        return np.concatenate(lasting)[:, None] * np.concatenate(mean)
