"""RNIN as odometry of a stream of frames: displacements over a second, told anew at every frame."""

from pathlib import Path

import numpy as np
import torch

from radarize.batch import Batch
from radarize.methods.method import Inputs
from radarize.methods.rnin.network import LASTS, SAMPLES, RninNet
from radarize.nets.weights import load
from radarize.odometry.displacements import Displacements, joined
from radarize.odometry.inertial import Imu
from radarize.odometry.integration import Track, intervals
from radarize.pose import wrap
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarize.stopwatch import stage

#: rad, by how much a heading integrated from angular velocities drifts in a second.
_DRIFT = np.radians(0.1)


class RninOdometry:
    """Odometry by `RninNet`: from an IMU alone; the radar's frames are only the clock.

    Args:
        radar: whose frames come.
        recording: with the IMU.
        weights: file.

    Raises:
        InputError: no IMU, or no such weights.
    """

    def __init__(self, radar: RadarConfig, recording: Recording, weights: Path):
        self._imu = Imu.of(recording)
        self.net, header = load(weights, RninNet)
        self._ago = LASTS * np.arange(header.frames - 1, -1, -1)  # ends of windows before now
        self._path = Displacements(LASTS, radar.frame_period)

    @torch.inference_mode()
    def follow(self, batch: Batch) -> Track:
        """Poses of the next frames."""
        centers = batch.centers
        steps = intervals(centers, self._path.time)
        with stage("translation"):
            yaw = wrap(self._imu.yaw(centers))
            track = [
                self._path.next(dt, self._path.arrive(center), *self._displacement(center), heading, _DRIFT**2 * dt)
                for dt, center, heading in zip(steps, centers, yaw, strict=True)
            ]
        return joined(centers, track, turn_seen=True)

    def _displacement(self, instant: float) -> tuple[np.ndarray, np.ndarray]:
        """Displacement in the last window, and its covariance, from as many windows as there are by now."""
        there = self._ago <= max(instant - self._imu.time[0], 0.0)
        windows = self._imu.levelled(instant - self._ago[there], SAMPLES)
        mean, covariance = self.net.estimate(torch.from_numpy(windows[None]).float())
        return mean[0].double().numpy(), covariance[0].double().numpy()


def odometry(inputs: Inputs) -> RninOdometry:
    """With the recording's IMU."""
    return RninOdometry(inputs.radar, inputs.imu("rnin"), inputs.weights.of("rnin"))
