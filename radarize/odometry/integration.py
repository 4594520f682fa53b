"""Planar odometry: velocities at burst centres and yaw increments between them, integrated to a trajectory."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.pose import compose, exponential
from radarize.io.stopwatch import stage
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import Rotations
from radarize.odometry.uncertainty import ErrorModel, half_turned
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch

#: m/s^1.5 and s: between two frames velocity is a random walk whose ends are known, and a smooth one over less than a
#: second. What that adds to a step is within a fifth of what true velocities by hand do, over 0.2 to 2 s (data set
#: odometry-choice: four handheld walks of 20 s in buildings A to D of seed 201).
_BRIDGED, _SMOOTH = 0.32, 1.0
#: s, over which turns are averaged to a rate.
_STEADY = 0.1
#: s, time constant of the correlation of errors of velocities, those in a row being of the same echoes (chosen on 12
#: walks of 60 s: handheld, cart and robot in A to D of seeds 301 to 304).
LASTING = 1.0


class VelocityEstimator(Protocol):
    """Sensor velocities at burst centres.

    Attributes:
        lever: m, how far to the left of the sensor's origin the point lies whose velocity this is.
    """

    lever: float

    def estimate(self, batch: Batch) -> Velocities: ...


class RotationEstimator(Protocol):
    """Yaw increments from frame to frame, given the filtered velocities.

    Attributes:
        lag: standard deviation of a turn as a share of it, beside its own. Who lags in a turn lags in all of its
            frames: errors of up to 6 deg a corner add up instead of averaging out.
    """

    lag: float

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations: ...


@dataclass(frozen=True)
class Track:
    """Poses of consecutive frames.

    Attributes:
        time: (frame,) burst centres, s.
        pose: (frame, 3) x, y (m) and yaw (rad, wrapped), the first frame of all being the origin.
        step: (frame, 3) motion since the frame before, in its sensor frame: x, y (m), yaw (rad).
        velocity: (frame, 2) filtered, m/s, sensor frame.
        velocity_covariance: (frame, 2, 2), m^2/s^2.
        velocity_seen, turn_seen: (frame,) False where odometry was blind: nothing determined the velocity at the frame,
            or the turn since the one before; what stands there is what went before.
        errors: of the steps.
    """

    time: Float[np.ndarray, "frame"]
    pose: Float[np.ndarray, "frame 3"]
    step: Float[np.ndarray, "frame 3"]
    velocity: Float[np.ndarray, "frame 2"]
    velocity_covariance: Float[np.ndarray, "frame 2 2"]
    velocity_seen: Bool[np.ndarray, "frame"]
    turn_seen: Bool[np.ndarray, "frame"]
    errors: ErrorModel


class VelocityConfig(Frozen):
    """Kalman filter of velocities (`VelocityFilter`)."""

    wander: float = setting(0.73, "random-walk density of the velocity of a handheld radar", "m/s^1.5", gt=0)
    fastest: float = setting(2.0, "standard deviation of an unknown velocity", "m/s", gt=0)
    gate: float = setting(
        9.0, "squared Mahalanobis distance above which a measurement is down-weighted (Huber)", "1", gt=0
    )


class VelocityFilter:
    """Causal Kalman filter of the planar velocity as a random walk; what is far off its prediction counts less."""

    def __init__(self, settings: VelocityConfig | None = None):
        self.settings = settings or VelocityConfig()
        self._time: float | None = None
        self._velocity, self._covariance = np.zeros(2), self.settings.fastest**2 * np.eye(2)

    def filter(self, times: Float[np.ndarray, "frame"], measured: Velocities) -> Velocities:
        """Filtered velocities of the next frames."""
        s = self.settings
        velocity, covariance = np.empty_like(measured.velocity), np.empty_like(measured.covariance)
        for i, time in enumerate(times):
            dt = 0.0 if self._time is None else time - self._time
            self._time = float(time)
            self._covariance = np.minimum(self._covariance + s.wander**2 * dt * np.eye(2), s.fastest**2)
            innovation = measured.velocity[i] - self._velocity
            total = self._covariance + measured.covariance[i]
            distance = innovation @ np.linalg.solve(total, innovation)
            if distance > s.gate:
                total = self._covariance + measured.covariance[i] * (distance / s.gate) ** 2
            gain = self._covariance @ np.linalg.inv(total)
            self._velocity = self._velocity + gain @ innovation
            self._covariance = (np.eye(2) - gain) @ self._covariance
            self._covariance = (self._covariance + self._covariance.T) / 2
            velocity[i], covariance[i] = self._velocity, self._covariance
        return Velocities(velocity, covariance, measured.inliers, measured.seen)


class Odometry:
    """Radar odometry in a stream. Memory does not grow."""

    def __init__(
        self,
        radar: RadarConfig,
        velocity: VelocityEstimator,
        rotation: RotationEstimator,
        settings: VelocityConfig | None = None,
    ):
        self.config, self.velocity, self.rotation = radar, velocity, rotation
        self._filter = VelocityFilter(settings)
        self._rate = 0.0  # of turning, rad/s, without the matches' jitter
        self._pose = np.zeros(3)
        self._last: tuple[float, np.ndarray, np.ndarray] | None = None  # time, velocity, covariance

    def update(self, batch: Batch) -> Track:
        """Poses of the next frames.

        Raises:
            InputError: stamps that do not increase.
        """
        steps = intervals(batch.centers, None if self._last is None else self._last[0])
        with stage("translation"):
            velocities = self._filter.filter(batch.centers, self.velocity.estimate(batch))
        with stage("rotation"):
            rotations = self.rotation.estimate(batch, velocities)
        return self._integrate(batch.centers, self._at_origin(steps, velocities, rotations), rotations)

    def _at_origin(self, steps: np.ndarray, measured: Velocities, rotations: Rotations) -> Velocities:
        """Velocities of the sensor's origin, which does not swing about it as the estimator's point does."""
        velocity = measured.velocity.copy()
        for i, (dt, yaw) in enumerate(zip(steps, rotations.yaw, strict=True)):
            self._rate += -np.expm1(-dt / _STEADY) * (yaw / dt - self._rate)
            velocity[i, 0] += self.velocity.lever * self._rate
        return replace(measured, velocity=velocity)

    def _integrate(self, times: np.ndarray, velocities: Velocities, rotations: Rotations) -> Track:
        frames = len(times)
        pose, step, duration = np.empty((frames, 3)), np.zeros((frames, 3)), np.zeros(frames)
        noise, correlation, variance = np.zeros((frames, 3, 3)), np.ones((frames, 2)), np.zeros((frames, 3, 3))
        correlation[:, 0], variance[:, 0, 0], variance[:, 1:, 1:] = (
            rotations.correlation, rotations.variance, velocities.covariance
        )  # fmt: skip
        for i in range(frames):
            velocity, spread = velocities.velocity[i], velocities.covariance[i]
            if self._last is not None:
                time, last_velocity, last_spread = self._last
                dt = duration[i] = times[i] - time
                step[i] = exponential(dt * (last_velocity + velocity) / 2, rotations.yaw[i])
                half, lag = half_turned(step[i]), (self.rotation.lag * rotations.yaw[i]) ** 2
                noise[i] = min(rotations.noise[i] + lag, np.pi**2) * np.outer(half, half)
                noise[i, :2, :2] += np.eye(2) * _BRIDGED**2 * dt**3 / 12 * dt**2 / (dt**2 + _SMOOTH**2)
                correlation[i, 1] = _correlation(dt, last_spread, spread)
            self._last = (times[i], velocity, spread)
            self._pose = pose[i] = compose(self._pose, step[i])
        errors = ErrorModel(duration, noise, correlation, variance)
        seen = velocities.seen, rotations.seen
        return Track(times, pose, step, velocities.velocity, velocities.covariance, *seen, errors)


def _correlation(dt: float, before: Float[np.ndarray, "2 2"], now: Float[np.ndarray, "2 2"]) -> float:
    """Share of a velocity's error that goes on for `dt` s: no more than leaves the covariance that it has now."""
    least = np.linalg.eigvals(np.linalg.solve(before, now)).real.min()
    return float(np.exp(-dt / LASTING) * np.sqrt(np.clip(least, 0.0, 1.0)))


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
