"""milliEgo and RNIN as odometry of a stream of frames.

Both tell differences over longer than a frame, 0.2 s and 1 s, anew at every frame. They are reconciled as positions of
the last frames that the differences tie together (`Ties`), as in filters with cloned states. Windows overlap, so that
one second's worth of them is believed as much as one window.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Complex64, Float

from radarize.baselines import milliego, rnin
from radarize.baselines.inertial import Imu
from radarize.baselines.panorama import panoramas
from radarize.baselines.tasks import PAIR
from radarize.heatmaps import Heatmaps
from radarize.nets.weights import load, shipped
from radarize.odometry.integration import Track, intervals
from radarize.odometry.ties import Ties
from radarize.points import DENSE, PointClouds
from radarize.pose import between, compose, wrap
from radarize.recording import Recording

#: m/s^2 and m/s: standard deviations of a walker's acceleration, and of a speed that nothing is known of.
_ACCELERATION, _FASTEST = 2.0, 1.0
#: rad/s^2 and rad/s: the same of turning.
_TWIST, _FASTEST_TURN = np.radians(180.0), np.radians(60.0)
#: rad, by how much a heading integrated from angular velocities drifts in a second.
_DRIFT = np.radians(0.1)


class _Path:
    """Positions of the last frames, and the track that the newest ones make.

    Args:
        reach: frames over which displacements are told.
        period: s, from frame to frame.
    """

    def __init__(self, reach: int, period: float):
        self.reach, self._period = reach, period
        self._axes = [Ties(reach + 1, _ACCELERATION * period, _FASTEST) for _ in range(2)]
        self._first: np.ndarray | None = None
        self._pose = np.zeros(3)
        self.time: float | None = None

    def next(
        self, dt: float, displacement: np.ndarray, covariance: np.ndarray, yaw: float, doubt: float
    ) -> tuple[np.ndarray, ...]:
        """Pose, step, its covariance, velocity and its covariance of the next frame.

        Args:
            dt: s, since the frame before.
            displacement: m, since `reach` frames ago, on axes that do not turn with the sensor.
            covariance: of it.
            yaw: rad, on these axes; doubt: variance of its change since the frame before.
        """
        for axis, ties in enumerate(self._axes):
            ties.predict(dt)
            ties.tie(self.reach, displacement[axis], self.reach * covariance[axis, axis])
        place = np.array([*(ties.values[-1] for ties in self._axes), yaw])
        self._first = place if self._first is None else self._first
        before, self._pose = self._pose, between(self._first, place)
        spread = np.diag([*(ties.variance(1) for ties in self._axes), 0.0])
        cos, sin = np.cos(yaw), np.sin(yaw)
        turned = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        spread = turned @ spread @ turned.T
        rate = turned[:2, :2] @ [ties.values[-1] - ties.values[-2] for ties in self._axes] / self._period
        known = spread[:2, :2] / self._period**2
        return self._pose, between(before, self._pose), spread + np.diag([1e-8, 1e-8, doubt]), rate, known


class MilliEgoOdometry:
    """Odometry by `MilliEgoNet`: from sparse points and an IMU.

    Args:
        heatmaps: make the spectra.
        recording: with the IMU.
        weights: file; the shipped ones if None.

    Raises:
        InputError: no IMU, or no such weights.
    """

    def __init__(self, heatmaps: Heatmaps, recording: Recording, weights: Path | None = None):
        self.config, self._heatmaps, self._imu = heatmaps.config, heatmaps, Imu.of(recording)
        self._clouds = PointClouds(self.config, DENSE)
        self.net, header = load(weights or shipped("milliego"))
        period = self.config.frame_period
        self._back = max(1, round(PAIR / period)) * np.arange(header.frames - 1, -1, -1)
        self._path = _Path(int(self._back[-2]), period)
        self._yaw = Ties(self._path.reach + 1, _TWIST * period, _FASTEST_TURN)
        self._past: np.ndarray | None = None

    @torch.inference_mode()
    def follow(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        times: Float[np.ndarray, "frame"],
        stage: Callable[[str], AbstractContextManager] = nullcontext,
    ) -> Track:
        """Poses of the next frames, see `Odometry.follow`."""
        centers = np.asarray(times, float) + self.config.burst_center
        steps = intervals(centers, self._path.time)
        with stage("points"):
            shown = panoramas(*self._clouds.of(self._heatmaps, spectrum), len(spectrum))
        with stage("translation"):
            past = np.repeat(shown[:1], self._back[0], axis=0) if self._past is None else self._past
            shown = np.concatenate([past, shown])
            self._past = shown[len(shown) - self._back[0] :]
            ago = centers[:, None] - self._back * self.config.frame_period
            imu = self._imu.latest(ago.ravel(), milliego.SAMPLES).reshape(*ago.shape, milliego.SAMPLES, 6)
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


class RninOdometry:
    """Odometry by `RninNet`: from an IMU alone; the radar's frames are only the clock.

    Args:
        heatmaps: of the radar whose frames come.
        recording: with the IMU.
        weights: file; the shipped ones if None.

    Raises:
        InputError: no IMU, or no such weights.
    """

    def __init__(self, heatmaps: Heatmaps, recording: Recording, weights: Path | None = None):
        self.config, self._imu = heatmaps.config, Imu.of(recording)
        self.net, header = load(weights or shipped("rnin"))
        self._ago = rnin.LASTS * np.arange(header.frames - 1, -1, -1)  # ends of windows before now
        self._path = _Path(max(1, round(rnin.LASTS / self.config.frame_period)), self.config.frame_period)

    @torch.inference_mode()
    def follow(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        times: Float[np.ndarray, "frame"],
        stage: Callable[[str], AbstractContextManager] = nullcontext,
    ) -> Track:
        """Poses of the next frames, see `Odometry.follow`."""
        centers = np.asarray(times, float) + self.config.burst_center
        steps = intervals(centers, self._path.time)
        with stage("translation"):
            yaw = wrap(self._imu.yaw(centers))
            track = [
                self._path.next(dt, *self._displacement(center), heading, _DRIFT**2 * dt)
                for dt, center, heading in zip(steps, centers, yaw, strict=True)
            ]
        self._path.time = centers[-1]
        return Track(centers, *(np.stack(each) for each in zip(*track, strict=True)))

    def _displacement(self, instant: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in the last window, and its covariance, from as many windows as there are by now."""
        there = self._ago <= max(instant - self._imu.time[0], 0.0)
        windows = self._imu.levelled(instant - self._ago[there], rnin.SAMPLES)
        mean, covariance = self.net.estimate(torch.from_numpy(windows[None]).float())
        return mean[0].double().numpy(), covariance[0].double().numpy()
