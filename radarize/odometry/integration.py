"""Planar odometry: velocities at burst centres and yaw increments between them, integrated to a trajectory."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float

from radarize.batch import Batch
from radarize.errors import InputError
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import Rotations
from radarize.pose import compose, exponential
from radarize.radar.config import RadarConfig
from radarize.stopwatch import stage

#: Standard deviation of a step's heading as a share of its turn, on top of the estimator's own. A local map that lags
#: in a turn lags in all its frames: errors of up to 6 deg a corner add up instead of averaging out, and independent
#: steps can only say so if each claims more.
TURN_SPREAD = 0.2


class VelocityEstimator(Protocol):
    """Sensor velocities at burst centres."""

    def estimate(self, batch: Batch) -> Velocities: ...


class RotationEstimator(Protocol):
    """Yaw increments from frame to frame, given the filtered velocities."""

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations: ...


@dataclass(frozen=True)
class Track:
    """Poses of consecutive frames.

    Attributes:
        time: (frame,) burst centres, s.
        pose: (frame, 3) x, y (m) and yaw (rad, wrapped), the first frame of all being the origin.
        step: (frame, 3) motion since the frame before, in its sensor frame: x, y (m), yaw (rad).
        covariance: (frame, 3, 3) of `step`.
        velocity: (frame, 2) filtered, m/s, sensor frame.
        velocity_covariance: (frame, 2, 2), m^2/s^2.
    """

    time: Float[np.ndarray, "frame"]
    pose: Float[np.ndarray, "frame 3"]
    step: Float[np.ndarray, "frame 3"]
    covariance: Float[np.ndarray, "frame 3 3"]
    velocity: Float[np.ndarray, "frame 2"]
    velocity_covariance: Float[np.ndarray, "frame 2 2"]


class VelocityFilter:
    """Causal Kalman filter of the planar velocity as a random walk; measurements far off their prediction count less.

    Args:
        acceleration: m/s^2, standard deviation that a handheld radar's velocity wanders with.
        gate: squared Mahalanobis distance from which a measurement's covariance is inflated to fit (Huber-like).
    """

    def __init__(self, acceleration: float = 4.0, gate: float = 9.0):
        self.acceleration, self.gate = acceleration, gate
        self._time: float | None = None
        self._velocity, self._covariance = np.zeros(2), np.eye(2)

    def filter(self, times: Float[np.ndarray, "frame"], measured: Velocities) -> Velocities:
        """Filtered velocities of the next frames."""
        velocity, covariance = np.empty_like(measured.velocity), np.empty_like(measured.covariance)
        for i, time in enumerate(times):
            dt = 0.0 if self._time is None else time - self._time
            self._time = float(time)
            # A random walk of dt, and of no less than a frame's worth of it, never beyond walking speeds.
            self._covariance = np.minimum(self._covariance + np.eye(2) * (self.acceleration * dt) ** 2, 4.0)
            innovation = measured.velocity[i] - self._velocity
            total = self._covariance + measured.covariance[i]
            distance = innovation @ np.linalg.solve(total, innovation)
            if distance > self.gate:
                total = self._covariance + measured.covariance[i] * (distance / self.gate) ** 2
            gain = self._covariance @ np.linalg.inv(total)
            self._velocity = self._velocity + gain @ innovation
            self._covariance = (np.eye(2) - gain) @ self._covariance
            self._covariance = (self._covariance + self._covariance.T) / 2
            velocity[i], covariance[i] = self._velocity, self._covariance
        return Velocities(velocity, covariance, measured.inliers)


class Odometry:
    """Radar odometry in a stream. Memory does not grow.

    Args:
        radar: configuration.
        velocity, rotation: estimators.
    """

    def __init__(self, radar: RadarConfig, velocity: VelocityEstimator, rotation: RotationEstimator):
        self.config, self.velocity, self.rotation = radar, velocity, rotation
        self._filter = VelocityFilter()
        self._pose = np.zeros(3)
        self._last: tuple[float, np.ndarray, np.ndarray] | None = None  # time, velocity, covariance

    def follow(self, batch: Batch) -> Track:
        """Poses of the next frames.

        Raises:
            InputError: stamps that do not increase.
        """
        intervals(batch.centers, None if self._last is None else self._last[0])
        with stage("translation"):
            velocities = self._filter.filter(batch.centers, self.velocity.estimate(batch))
        with stage("rotation"):
            rotations = self.rotation.estimate(batch, velocities)
        return self._integrate(batch.centers, velocities, rotations)

    def _integrate(self, times: np.ndarray, velocities: Velocities, rotations: Rotations) -> Track:
        frames = len(times)
        pose, step, covariance = np.empty((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3, 3))
        for i in range(frames):
            velocity, spread = velocities.velocity[i], velocities.covariance[i]
            if self._last is not None:
                time, last_velocity, last_spread = self._last
                dt = times[i] - time
                step[i] = exponential(dt * (last_velocity + velocity) / 2, rotations.yaw[i])
                covariance[i, :2, :2] = dt**2 * (last_spread + spread) / 2
                covariance[i, 2, 2] = rotations.variance[i] + (TURN_SPREAD * rotations.yaw[i]) ** 2
                # Across lost frames velocity is only known to lead from one end to the other, at the filter's pace.
                gap = dt if dt > 1.5 * self.config.frame_period else 0.0
                covariance[i, :2, :2] += np.eye(2) * min(self._filter.acceleration * gap, 2.0) ** 2 * gap**2 / 12
            self._last = (times[i], velocity, spread)
            self._pose = pose[i] = compose(self._pose, step[i])
        return Track(times, pose, step, covariance, velocities.velocity, velocities.covariance)


def intervals(times: Float[np.ndarray, "frame"], last: float | None) -> Float[np.ndarray, "frame"]:
    """Seconds since the frame before, a frame of any batch before at `last`; 1 if there is none.

    Raises:
        InputError: stamps that do not increase.
    """
    steps = np.diff(times, prepend=times[0] - 1 if last is None else last)
    if not (steps > 0).all():
        bad = int(np.argmin(steps > 0))
        raise InputError(f"frame times step by {steps[bad]:.6f} s before {times[bad]:.6f} s, expected ascending times")
    return steps
