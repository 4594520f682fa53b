"""Velocity and turns by the networks (paper, sections 4.2 and 4.3), as estimators like any others.

Networks know the frame rate they were trained at; a radar whose frames come twice as often shows them every second one.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Complex64, Float

from radarize.nets.weights import load, shipped
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import Rotations
from radarize.training.maps import MapMaker


class Windows:
    """A network of one kind, fed with windows of a stream's frames.

    Args:
        maker: makes the maps; estimators that share it share the maps.
        kind: of the network.
        weights: file; the shipped ones if None.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, maker: MapMaker, kind: str, weights: Path | None = None):
        self.net, self.header = load(weights or shipped(kind), maker.heatmaps.config)
        self.stride = self.header.stride(maker.heatmaps.config)
        self._maker = maker
        self._past: torch.Tensor | None = None

    def push(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"], spacings: Sequence[int] = (1,)
    ) -> list[Float[torch.Tensor, "frame window map row azimuth"]]:
        """Windows that end at the next frames, for each spacing (frames of the network's) between their frames.

        Before the stream began everything looked as in its first frame.
        """
        made = self._maker.of(spectrum, self.header.maps)
        new = torch.stack([torch.from_numpy(made[name]) for name in self.header.maps], dim=1).float()
        reach = (self.header.frames - 1) * self.stride * max(self.header.spacings)
        past = new[:1].expand(reach, -1, -1, -1) if self._past is None else self._past
        everything = torch.cat([past, new])
        self._past = everything[len(everything) - reach :]
        newest = torch.arange(reach, reach + len(new))[:, None]
        back = torch.arange(self.header.frames - 1, -1, -1) * self.stride
        return [everything[newest - back * spacing] for spacing in spacings]


class LearnedVelocity:
    """Velocity estimator by `radarize.nets.TranslationNet`.

    Args:
        maker: see `Windows`.
        weights: file; the shipped ones if None.
    """

    def __init__(self, maker: MapMaker, weights: Path | None = None):
        self._windows = Windows(maker, "translation", weights)

    @torch.inference_mode()
    def estimate(self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]) -> Velocities:
        """Velocities of the next frames; no echoes are counted."""
        mean, covariance = self._windows.net.estimate(self._windows.push(spectrum)[0])
        return Velocities(mean.double().numpy(), covariance.double().numpy(), np.zeros(len(mean), int))


class LearnedRotation:
    """Rotation estimator by `radarize.nets.RotationNet`: turns over several spacings, reconciled by a filter.

    The paper sums turns of one spacing in interleaved chains, which drift apart. Here the yaws of the last frames are
    one Gaussian state: a measured turn ties two of them, and all that are tied to them move along.

    Args:
        maker: see `Windows`.
        weights: file; the shipped ones if None.
        spacings: of the network's frames, over which turns are measured; some of those it was trained on.
        jerk: rad/s, standard deviation of the change of turning rate from frame to frame.
    """

    def __init__(
        self,
        maker: MapMaker,
        weights: Path | None = None,
        spacings: Sequence[int] = (1, 2, 4),
        jerk: float = np.radians(12.0),
    ):
        self._windows = Windows(maker, "rotation", weights)
        known = self._windows.header.spacings
        self.spacings, self.jerk = [s for s in spacings if s in known] or list(known), jerk
        size = max(self.spacings) * self._windows.stride + 1
        self._yaws, self._covariance = np.zeros(size), np.zeros((size, size))  # oldest first
        self._seen, self._time = 0, 0.0

    @torch.inference_mode()
    def estimate(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        times: Float[np.ndarray, "frame"],
        velocities: Velocities | None = None,
    ) -> Rotations:
        """Yaw increments of the next frames; their variances add up to that of the yaw since the beginning."""
        windows = self._windows.push(spectrum, self.spacings)
        mean, variance = self._windows.net.estimate(torch.cat(windows))
        turns = np.stack([mean[:, 0].double().numpy(), variance[:, 0, 0].double().numpy()], axis=-1)
        turns = turns.reshape(len(windows), len(times), 2)
        yaw, growth = np.zeros(len(times)), np.zeros(len(times))
        for i, time in enumerate(times):
            before, known = self._yaws[-1], self._covariance[-1, -1]
            self._predict(float(time))
            for spacing, (turn, noise) in zip(self.spacings, turns[:, i], strict=True):
                if (back := spacing * self._windows.stride) < self._seen:
                    self._tie(back, turn, noise)
            yaw[i] = self._yaws[-1] - before
            growth[i] = max(self._covariance[-1, -1] - known, 1e-8)
        return Rotations(yaw, growth, np.zeros(len(times)))

    def _predict(self, time: float) -> None:
        """The next yaw goes on at the last rate, more or less."""
        if self._seen == 0:
            move, noise = np.eye(len(self._yaws)), 0.0
        else:
            move = np.eye(len(self._yaws), k=1)
            move[-1, -1] = 1.0
            if self._seen > 1:
                move[-1, -2:] = -1.0, 2.0
            noise = (self.jerk * (time - self._time)) ** 2 if self._seen > 1 else 0.1
        self._yaws = move @ self._yaws
        self._covariance = move @ self._covariance @ move.T
        self._covariance[-1, -1] += noise
        self._seen, self._time = min(self._seen + 1, len(self._yaws)), time

    def _tie(self, back: int, turn: float, noise: float) -> None:
        """Kalman update by a turn from `back` frames ago to now."""
        row = np.zeros(len(self._yaws))
        row[-1], row[-1 - back] = 1.0, -1.0
        spread = self._covariance @ row
        gain = spread / (row @ spread + noise)
        self._yaws = self._yaws + gain * (turn - row @ self._yaws)
        self._covariance = self._covariance - np.outer(gain, spread)
