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
from radarize.nets.windows import spaced
from radarize.odometry.integration import Track, intervals
from radarize.odometry.ties import Ties
from radarize.points import DENSE, PointClouds
from radarize.pose import between, compose, wrap
from radarize.recording import Recording

#: m/s^1.5 and m/s: by how much a walker's speed wanders in a second, and standard deviation of one not known at all.
_WANDER, _FASTEST = 0.37, 1.0
#: rad/s^1.5 and rad/s: the same of turning.
_TWIST, _FASTEST_TURN = np.radians(33.0), np.radians(60.0)
#: rad, by how much a heading integrated from angular velocities drifts in a second.
_DRIFT = np.radians(0.1)


class _Path:
    """Positions of the last frames, and the track that the newest ones make.

    Args:
        lasts: s, over which displacements are told.
        period: s, from frame to frame, as far as none is lost.

    Attributes:
        reach: frames in that time.
        time: s, of the newest frame.
    """

    def __init__(self, lasts: float, period: float):
        self.reach = max(1, round(lasts / period))
        self._apart, self._period = self.reach * period, period
        self._axes = [Ties(self.reach + 1, _WANDER, _FASTEST) for _ in range(2)]
        self._times = np.zeros(0)
        self._first: np.ndarray | None = None
        self._pose = np.zeros(3)

    @property
    def time(self) -> float | None:
        return float(self._times[-1]) if len(self._times) else None

    def arrive(self, time: float) -> int:
        """The next frame; how many frames ago displacements until it began, 0 if that frame was lost."""
        self._times = np.append(self._times[-self.reach :], time)
        rows, there = spaced(self._times, 1, 2, self._apart, self._period)
        return int(rows[0, 1] - rows[0, 0]) if there.all() else 0

    def next(
        self, dt: float, back: int, displacement: np.ndarray, covariance: np.ndarray, yaw: float, doubt: float
    ) -> tuple[np.ndarray, ...]:
        """Pose, step, its covariance, velocity, its covariance, and whether a displacement told of it, of the frame
        that has arrived.

        Args:
            dt: s, since the frame before.
            back: frames ago that the displacement began, 0 if it tells nothing.
            displacement: m, since then, on axes that do not turn with the sensor.
            covariance: of it.
            yaw: rad, on these axes; doubt: variance of its change since the frame before.
        """
        for axis, ties in enumerate(self._axes):
            ties.predict(dt)
            ties.tie(back, displacement[axis], self.reach * covariance[axis, axis])
        place = np.array([*(ties.values[-1] for ties in self._axes), yaw])
        self._first = place if self._first is None else self._first
        before, self._pose = self._pose, between(self._first, place)
        spread = np.diag([*(ties.variance(1) for ties in self._axes), 0.0])
        cos, sin = np.cos(yaw), np.sin(yaw)
        turned = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        spread = turned @ spread @ turned.T + np.diag([1e-8, 1e-8, min(doubt, np.pi**2)])
        rate = turned[:2, :2] @ [ties.rate for ties in self._axes]
        known = turned[:2, :2] @ np.diag([ties.covariance[-1, -1] for ties in self._axes]) @ turned[:2, :2].T
        return self._pose, between(before, self._pose), spread, rate, known, back > 0


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
        self._path = _Path(PAIR, self.config.frame_period)
        self._yaw = Ties(self._path.reach + 1, _TWIST, _FASTEST_TURN)
        self._frames = header.frames
        self._past: tuple[np.ndarray, np.ndarray] | None = None  # stamps and panoramas

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
            stamps = centers
            if self._past is not None:
                stamps, shown = (np.concatenate(each) for each in zip(self._past, (centers, shown), strict=True))
            kept = max(len(stamps) - self._path.reach * (self._frames - 1), 0)
            self._past = stamps[kept:], shown[kept:]
            period = self.config.frame_period
            apart = self._path.reach * period
            # What is older than the newest pair is memory only: where it is missing, the rest tells the displacement.
            rows, _ = spaced(stamps, len(centers), self._frames, apart, period)
            ago = centers[:, None] - apart * np.arange(self._frames - 1, -1, -1)
            imu = self._imu.latest(ago.ravel(), milliego.SAMPLES).reshape(*ago.shape, milliego.SAMPLES, 6)
            found = [
                self.net.estimate(torch.from_numpy(shown[window][None]).float(), torch.from_numpy(turns[None]).float())
                for window, turns in zip(rows, imu, strict=True)
            ]
            track = [
                self._next(time, dt, mean[0].double().numpy(), covariance[0].double().numpy())
                for time, dt, (mean, covariance) in zip(centers, steps, found, strict=True)
            ]
        return _track(centers, track)

    def _next(self, time: float, dt: float, motion: np.ndarray, covariance: np.ndarray) -> tuple[np.ndarray, ...]:
        back = self._path.arrive(time)
        self._yaw.predict(dt)
        self._yaw.tie(back, motion[2], self._path.reach * covariance[2, 2])
        older = compose(np.array([0, 0, self._yaw.values[-1 - back]]), np.array([*motion[:2], 0]))
        return self._path.next(dt, back, older[:2], covariance, self._yaw.values[-1], self._yaw.variance(1))


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
        self._path = _Path(rnin.LASTS, self.config.frame_period)

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
                self._path.next(dt, self._path.arrive(center), *self._displacement(center), heading, _DRIFT**2 * dt)
                for dt, center, heading in zip(steps, centers, yaw, strict=True)
            ]
        return _track(centers, track, turn_seen=True)

    def _displacement(self, instant: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in the last window, and its covariance, from as many windows as there are by now."""
        there = self._ago <= max(instant - self._imu.time[0], 0.0)
        windows = self._imu.levelled(instant - self._ago[there], rnin.SAMPLES)
        mean, covariance = self.net.estimate(torch.from_numpy(windows[None]).float())
        return mean[0].double().numpy(), covariance[0].double().numpy()


def _track(times: np.ndarray, track: list[tuple[np.ndarray, ...]], turn_seen: bool = False) -> Track:
    """What `_Path.next` said of every frame; turns are seen with displacements, or always."""
    *values, seen = (np.stack(each) for each in zip(*track, strict=True))
    return Track(times, *values, seen, seen | turn_seen)
