"""milliEgo as odometry of a stream of frames: motions over 0.2 s, estimated at every frame."""

import numpy as np
import torch

from radarize.baselines.inertial import InertialOdometry
from radarize.baselines.milliego.network import PAIR, SAMPLES, MilliEgoNet
from radarize.baselines.milliego.panorama import panoramas
from radarize.io.pose import compose
from radarize.io.stopwatch import stage
from radarize.learning.features.windows import spaced
from radarize.odometry.displacements import Update, as_track
from radarize.odometry.integration import Track, intervals
from radarize.odometry.smoother import FixedLagSmoother
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch

#: Yaw-rate random walk of a person, rad/s^1.5; standard deviation of an unknown yaw rate, rad/s.
_TWIST, _FASTEST_TURN = np.radians(33.0), np.radians(60.0)


class MilliEgoOdometry(InertialOdometry):
    """Odometry by `MilliEgoNet` from sparse points and an IMU."""

    network, lasts = MilliEgoNet, PAIR

    def __init__(self, inputs: Inputs):
        super().__init__(inputs)
        self._period, self._frames = inputs.radar.frame_period, self.header.frames
        self._yaw = FixedLagSmoother(self.path.reach + 1, _TWIST, _FASTEST_TURN)
        self._past: tuple[np.ndarray, np.ndarray] | None = None  # stamps and panoramas

    @torch.inference_mode()
    def update(self, batch: Batch) -> Track:
        """Estimate poses of the next frames."""
        centers = batch.centers
        steps = intervals(centers, self.path.time)
        shown = panoramas(*batch.points, len(batch))
        with stage("translation"):
            stamps = centers
            if self._past is not None:
                stamps, shown = (np.concatenate(each) for each in zip(self._past, (centers, shown), strict=True))
            kept = max(len(stamps) - self.path.reach * (self._frames - 1), 0)
            self._past = stamps[kept:], shown[kept:]
            apart = self.path.reach * self._period
            # Frames before the newest pair are memory only: without them, the displacement follows from the pair.
            rows, _ = spaced(stamps, len(centers), self._frames, apart, self._period)
            ago = centers[:, None] - apart * np.arange(self._frames - 1, -1, -1)
            imu = self.imu.latest(ago.ravel(), SAMPLES).reshape(*ago.shape, SAMPLES, 6)
            found = [
                self.net.estimate(torch.from_numpy(shown[window][None]).float(), torch.from_numpy(turns[None]).float())
                for window, turns in zip(rows, imu, strict=True)
            ]
            track = [
                self._next(time, dt, mean[0].double().numpy(), covariance[0].double().numpy())
                for time, dt, (mean, covariance) in zip(centers, steps, found, strict=True)
            ]
        return as_track(centers, track)

    def _next(self, time: float, dt: float, motion: np.ndarray, covariance: np.ndarray) -> Update:
        back = self.path.add_frame(time)
        self._yaw.predict(dt)
        self._yaw.add_relative_motion(back, motion[2], self.path.reach * covariance[2, 2])
        older = compose(np.array([0, 0, self._yaw.values[-1 - back]]), np.array([*motion[:2], 0]))
        return self.path.update(dt, back, older[:2], covariance, self._yaw.values[-1], self._yaw.variance_since(1))


METHOD = Method("milliEgo", MilliEgoOdometry, ("milliego",))
