"""Planar odometry: velocities at burst centres and yaw increments between them, integrated to a trajectory."""

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.pose import compose, exponential
from radarize.io.stopwatch import stage
from radarize.odometry.doppler import Velocities
from radarize.odometry.rotation import RotationEstimator, Rotations
from radarize.odometry.uncertainty import ErrorModel, half_turned
from radarize.radar.config import RadarConfig
from radarize.signal.batch import Batch

#: Interpolation error of the velocity between two frames: random walk of the velocity, m/s^1.5, given its value at both
#: ends, and the time below which the velocity is smooth, s. The error of a step agrees within 20 % with true velocities
#: of handheld walks, over 0.2 to 2 s (data set odometry-choice: four handheld walks of 20 s in buildings A to D of seed
#: 201).
_VELOCITY_WALK, _SMOOTH_TIME = 0.32, 1.0
#: Time constant of the low-pass filter of the yaw rate, s.
_YAW_RATE_TIME = 0.1
#: Time constant of the correlation of velocity errors, s: consecutive velocities come from the same echoes (chosen on
#: 12 walks of 60 s: handheld, cart and robot in A to D of seeds 301 to 304).
CORRELATION_TIME = 1.0


class VelocityEstimator(Protocol):
    """Estimator of the sensor velocity at burst centres.

    Attributes:
        lever: m, lever arm: y of the point whose velocity is estimated, in the sensor frame.
    """

    lever: float

    def estimate(self, batch: Batch) -> Velocities: ...


@dataclass(frozen=True)
class Track:
    """Poses of consecutive frames.

    Attributes:
        time: (frame,) burst centres, s.
        pose: (frame, 3) x, y (m) and yaw (rad, wrapped), relative to the first frame of the recording.
        step: (frame, 3) motion since the previous frame, in the sensor frame there: x, y (m), yaw (rad).
        velocity: (frame, 2) filtered velocity, m/s, sensor frame.
        velocity_covariance: (frame, 2, 2), m^2/s^2.
        velocity_seen, turn_seen: (frame,) False where the velocity at the frame, or the yaw increment since the
            previous frame, was unobservable; the values there are predictions.
        errors: error model of the steps.
    """

    time: Float[np.ndarray, "frame"]
    pose: Float[np.ndarray, "frame 3"]
    step: Float[np.ndarray, "frame 3"]
    velocity: Float[np.ndarray, "frame 2"]
    velocity_covariance: Float[np.ndarray, "frame 2 2"]
    velocity_seen: Bool[np.ndarray, "frame"]
    turn_seen: Bool[np.ndarray, "frame"]
    errors: ErrorModel

    @classmethod
    def from_rates(
        cls,
        time: Float[np.ndarray, "frame"],
        rates: Float[np.ndarray, "frame 3"],
        covariance: Float[np.ndarray, "frame 3 3"],
        previous: "Track | None" = None,
    ) -> "Track":
        """Integrate velocities and yaw rates to poses. Errors of different frames count as independent.

        Args:
            time: burst centres, s.
            rates: velocity forward and left, m/s, and yaw rate, rad/s, since the previous frame, in the sensor frame.
            covariance: covariance of the rates.
            previous: track of the frames before; None: these are the first ones, and the first pose is the origin.

        Raises:
            InputError: time stamps do not increase.
        """
        dt = intervals(time, None if previous is None else previous.time[-1])
        dt[0] *= previous is not None
        step = np.stack([exponential(t * rate[:2], t * rate[2]) for t, rate in zip(dt, rates, strict=True)])
        start = np.zeros(3) if previous is None else previous.pose[-1]
        pose = np.stack([*accumulate(step, compose, initial=start)][1:])
        seen, errors = np.ones(len(time), bool), ErrorModel.independent(dt[:, None, None] ** 2 * covariance)
        return cls(time, pose, step, rates[:, :2], covariance[:, :2, :2], seen, seen, errors)


class VelocityConfig(Frozen):
    """Kalman filter of velocities (`VelocityFilter`)."""

    wander: float = setting(0.73, "random-walk density of the velocity of a handheld radar", "m/s^1.5", gt=0)
    fastest: float = setting(2.0, "standard deviation of an unknown velocity", "m/s", gt=0)
    gate: float = setting(
        9.0, "squared Mahalanobis distance above which a measurement is down-weighted (Huber)", "1", gt=0
    )


class VelocityFilter:
    """Causal Kalman filter of the planar velocity, modelled as a random walk. Outliers are down-weighted."""

    def __init__(self, settings: VelocityConfig | None = None):
        self.settings = settings or VelocityConfig()
        self._time: float | None = None
        self._velocity, self._covariance = np.zeros(2), self.settings.fastest**2 * np.eye(2)

    def filter(self, times: Float[np.ndarray, "frame"], measured: Velocities) -> Velocities:
        """Return the filtered velocities of the next frames."""
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
    """Radar odometry of a stream of frames, in constant memory."""

    def __init__(
        self,
        radar: RadarConfig,
        velocity: VelocityEstimator,
        rotation: RotationEstimator,
        settings: VelocityConfig | None = None,
    ):
        self.config, self.velocity, self.rotation = radar, velocity, rotation
        self._filter = VelocityFilter(settings)
        self._rate = 0.0  # yaw rate, rad/s, low-pass filtered
        self._pose = np.zeros(3)
        self._last: tuple[float, np.ndarray, np.ndarray] | None = None  # time, velocity, covariance

    def update(self, batch: Batch) -> Track:
        """Return the poses of the next frames.

        Raises:
            InputError: time stamps do not increase.
        """
        steps = intervals(batch.centers, None if self._last is None else self._last[0])
        with stage("translation"):
            velocities = self._filter.filter(batch.centers, self.velocity.estimate(batch))
        with stage("rotation"):
            rotations = self.rotation.estimate(batch, velocities)
        return self._integrate(batch.centers, self._at_origin(steps, velocities, rotations), rotations)

    def _at_origin(self, steps: np.ndarray, measured: Velocities, rotations: Rotations) -> Velocities:
        """Velocities of the sensor's origin: the lever arm times the yaw rate is removed."""
        velocity = measured.velocity.copy()
        for i, (dt, yaw) in enumerate(zip(steps, rotations.yaw, strict=True)):
            self._rate += -np.expm1(-dt / _YAW_RATE_TIME) * (yaw / dt - self._rate)
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
                noise[i, :2, :2] += np.eye(2) * _VELOCITY_WALK**2 * dt**3 / 12 * dt**2 / (dt**2 + _SMOOTH_TIME**2)
                correlation[i, 1] = _correlation(dt, last_spread, spread)
            self._last = (times[i], velocity, spread)
            self._pose = pose[i] = compose(self._pose, step[i])
        errors = ErrorModel(duration, noise, correlation, variance)
        seen = velocities.seen, rotations.seen
        return Track(times, pose, step, velocities.velocity, velocities.covariance, *seen, errors)


def _correlation(dt: float, previous: Float[np.ndarray, "2 2"], now: Float[np.ndarray, "2 2"]) -> float:
    """Share of a velocity error that persists for `dt` s, limited such that it does not exceed the covariance `now`."""
    least = np.linalg.eigvals(np.linalg.solve(previous, now)).real.min()
    return float(np.exp(-dt / CORRELATION_TIME) * np.sqrt(np.clip(least, 0.0, 1.0)))


def intervals(times: Float[np.ndarray, "frame"], last: float | None) -> Float[np.ndarray, "frame"]:
    """Seconds since the previous frame; for the first frame since `last`, the last frame of the previous batch, or 1 s
    if there is none.

    Raises:
        InputError: time stamps do not increase.
    """
    steps = np.diff(times, prepend=times[0] - 1 if last is None else last)
    if not (steps > 0).all():
        bad = int(np.argmin(steps > 0))
        raise InputError(f"frame times step by {steps[bad]:.6f} s before {times[bad]:.6f} s, expected ascending times")
    return steps
