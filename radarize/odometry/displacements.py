"""Path from displacements over several frames, of which every frame brings a new one.

A smoother over the positions of the last frames fuses them (`FixedLagSmoother`), as in filters with cloned states. The
windows of consecutive displacements overlap, so their errors are correlated: all windows that fit into one together
have the weight of one.
"""

import numpy as np

from radarize.io.pose import between
from radarize.learning.features.windows import spaced
from radarize.odometry.integration import Track
from radarize.odometry.smoother import FixedLagSmoother
from radarize.odometry.uncertainty import ErrorModel

#: Result of `DisplacementIntegrator.update`.
Update = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]

#: Random walk of the speed of a walker, m/s^1.5, and standard deviation of the speed before any measurement, m/s.
_WANDER, _FASTEST = 0.37, 1.0


class DisplacementIntegrator:
    """Smoother over the positions of the last frames, and the track of its newest ones.

    Args:
        duration: s, of a displacement.
        period: s, from frame to frame if none is lost.

    Attributes:
        reach: number of frames in that time.
        time: s, of the newest frame.
    """

    def __init__(self, duration: float, period: float):
        self.reach = max(1, round(duration / period))
        self._duration, self._period = self.reach * period, period
        self._axes = [FixedLagSmoother(self.reach + 1, _WANDER, _FASTEST) for _ in range(2)]
        self._times = np.zeros(0)
        self._first: np.ndarray | None = None
        self._pose = np.zeros(3)

    @property
    def time(self) -> float | None:
        """Time of the newest frame, s; None before the first one."""
        return float(self._times[-1]) if len(self._times) else None

    def add_frame(self, time: float) -> int:
        """Add the next frame; returns the number of frames since the start of the displacement that ends there, 0 if
        that frame was lost."""
        self._times = np.append(self._times[-self.reach :], time)
        rows, there = spaced(self._times, 1, 2, self._duration, self._period)
        return int(rows[0, 1] - rows[0, 0]) if there.all() else 0

    def update(
        self, dt: float, back: int, displacement: np.ndarray, covariance: np.ndarray, yaw: float, yaw_variance: float
    ) -> Update:
        """Return pose, step, covariance of the step, velocity, its covariance, and whether a displacement observes the
        motion, of the frame just added.

        Args:
            dt: s, since the previous frame.
            back: number of frames since the start of the displacement, 0 if there is no displacement.
            displacement: m, on axes that do not turn with the sensor.
            covariance: of the displacement, m^2.
            yaw: rad, of the sensor on these axes.
            yaw_variance: rad^2, of the yaw increment since the previous frame.
        """
        for axis, smoother in enumerate(self._axes):
            smoother.predict(dt)
            smoother.add_relative_motion(back, displacement[axis], self.reach * covariance[axis, axis])
        position = np.array([*(each.values[-1] for each in self._axes), yaw])
        self._first = position if self._first is None else self._first
        previous, self._pose = self._pose, between(self._first, position)
        spread = np.diag([*(each.variance_since(1) for each in self._axes), 0.0])
        cos, sin = np.cos(yaw), np.sin(yaw)
        rotation = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        spread = rotation @ spread @ rotation.T + np.diag([1e-8, 1e-8, min(yaw_variance, np.pi**2)])
        rate = rotation[:2, :2] @ [each.rate for each in self._axes]
        velocity_covariance = (
            rotation[:2, :2] @ np.diag([each.covariance[-1, -1] for each in self._axes]) @ rotation[:2, :2].T
        )
        return self._pose, between(previous, self._pose), spread, rate, velocity_covariance, back > 0


def as_track(times: np.ndarray, track: list[Update], turn_seen: bool = False) -> Track:
    """Track of the results of `DisplacementIntegrator.update` of every frame. Its yaw increments are observed where
    displacements are, or always."""
    pose, step, spread, velocity, covariance, seen = (np.stack(each) for each in zip(*track, strict=True))
    return Track(times, pose, step, velocity, covariance, seen, seen | turn_seen, ErrorModel.independent(spread))
