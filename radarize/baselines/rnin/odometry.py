"""RNIN as odometry of a stream of frames: displacements over a second, told anew at every frame."""

import numpy as np
import torch

from radarize.baselines.inertial import InertialOdometry
from radarize.baselines.rnin.network import LASTS, SAMPLES, RninNet
from radarize.io.pose import wrap
from radarize.io.stopwatch import stage
from radarize.odometry.displacements import as_track
from radarize.odometry.integration import Track, intervals
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch

#: rad, by how much a heading integrated from angular velocities drifts in a second.
_DRIFT = np.radians(0.1)


class RninOdometry(InertialOdometry):
    """Odometry by `RninNet`: from an IMU alone; the radar's frames are only the clock."""

    network, lasts = RninNet, LASTS

    def __init__(self, inputs: Inputs):
        super().__init__(inputs)
        self._ago = LASTS * np.arange(self.header.frames - 1, -1, -1)  # ends of windows before now

    @torch.inference_mode()
    def update(self, batch: Batch) -> Track:
        """Poses of the next frames."""
        centers = batch.centers
        steps = intervals(centers, self.path.time)
        with stage("translation"):
            yaw = wrap(self.imu.yaw(centers))
            track = [
                self.path.update(dt, self.path.add_frame(center), *self._displacement(center), heading, _DRIFT**2 * dt)
                for dt, center, heading in zip(steps, centers, yaw, strict=True)
            ]
        return as_track(centers, track, turn_seen=True)

    def _displacement(self, instant: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in the last window, and its covariance, from as many windows as there are by now."""
        there = self._ago <= max(instant - self.imu.time[0], 0.0)
        windows = self.imu.levelled(instant - self._ago[there], SAMPLES)
        mean, covariance = self.net.estimate(torch.from_numpy(windows[None]).float())
        return mean[0].double().numpy(), covariance[0].double().numpy()


METHOD = Method("RNIN", RninOdometry, ("rnin",))
