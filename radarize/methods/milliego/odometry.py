"""milliEgo as odometry of a stream of frames: motions over 0.2 s, told anew at every frame."""

from pathlib import Path

import numpy as np
import torch

from radarize.batch import Batch
from radarize.methods.method import Inputs
from radarize.methods.milliego.network import PAIR, SAMPLES, MilliEgoNet
from radarize.methods.milliego.panorama import panoramas
from radarize.nets.weights import load
from radarize.odometry.displacements import Displacements
from radarize.odometry.inertial import Imu
from radarize.odometry.integration import Track, intervals
from radarize.odometry.ties import Ties
from radarize.pose import compose
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarize.stopwatch import stage

#: rad/s^2 and rad/s: standard deviations of a walker's turning, and of a rate that nothing is known of.
_TWIST, _FASTEST_TURN = np.radians(180.0), np.radians(60.0)


class MilliEgoOdometry:
    """Odometry by `MilliEgoNet`: from sparse points and an IMU.

    Args:
        radar: configuration.
        recording: with the IMU.
        weights: file.

    Raises:
        InputError: no IMU, or no such weights.
    """

    def __init__(self, radar: RadarConfig, recording: Recording, weights: Path):
        self._imu = Imu.of(recording)
        self.net, header = load(weights, MilliEgoNet)
        self._period = period = radar.frame_period
        self._back = max(1, round(PAIR / period)) * np.arange(header.frames - 1, -1, -1)
        self._path = Displacements(int(self._back[-2]), period)
        self._yaw = Ties(self._path.reach + 1, _TWIST * period, _FASTEST_TURN)
        self._past: np.ndarray | None = None

    @torch.inference_mode()
    def follow(self, batch: Batch) -> Track:
        """Poses of the next frames."""
        centers = batch.centers
        steps = intervals(centers, self._path.time)
        shown = panoramas(*batch.points, len(batch))
        with stage("translation"):
            past = np.repeat(shown[:1], self._back[0], axis=0) if self._past is None else self._past
            shown = np.concatenate([past, shown])
            self._past = shown[len(shown) - self._back[0] :]
            ago = centers[:, None] - self._back * self._period
            imu = self._imu.latest(ago.ravel(), SAMPLES).reshape(*ago.shape, SAMPLES, 6)
            newest = self._back[0] + np.arange(len(centers))[:, None]
            found = [
                self.net.estimate(torch.from_numpy(shown[rows][None]).float(), torch.from_numpy(turns[None]).float())
                for rows, turns in zip(newest - self._back, imu, strict=True)
            ]
            track = [self._next(dt, mean[0].double().numpy(), covariance[0].double().numpy())
                     for dt, (mean, covariance) in zip(steps, found, strict=True)]  # fmt: skip
        self._path.time = centers[-1]
        return Track(centers, *(np.stack(each) for each in zip(*track, strict=True)))

    def _next(self, dt: float, motion: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, ...]:
        reach = self._path.reach
        self._yaw.predict(dt)
        self._yaw.tie(reach, motion[2], reach * covariance[2, 2])
        older = compose(np.array([0, 0, self._yaw.values[0]]), np.array([*motion[:2], 0]))
        return self._path.next(dt, older[:2], covariance, self._yaw.values[-1], self._yaw.variance(1))


def odometry(inputs: Inputs) -> MilliEgoOdometry:
    """With the recording's IMU."""
    return MilliEgoOdometry(inputs.radar, inputs.imu("milliego"), inputs.weights.of("milliego"))
