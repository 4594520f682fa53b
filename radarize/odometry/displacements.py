"""A path from displacements over longer than a frame, told anew at every frame.

They are reconciled as positions of the last frames (`FixedLagSmoother`), as in filters with cloned states. Windows
overlap, so that as many of them as fit into one are believed as much as one.
"""

import numpy as np

from radarize.io.pose import between
from radarize.learning.features.windows import spaced
from radarize.odometry.integration import Track
from radarize.odometry.smoother import FixedLagSmoother
from radarize.odometry.uncertainty import ErrorModel

#: m/s^1.5 and m/s: by how much a walker's speed wanders in a second, and standard deviation of one not known at all.
_WANDER, _FASTEST = 0.37, 1.0


class DisplacementIntegrator:
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
        self._axes = [FixedLagSmoother(self.reach + 1, _WANDER, _FASTEST) for _ in range(2)]
        self._times = np.zeros(0)
        self._first: np.ndarray | None = None
        self._pose = np.zeros(3)

    @property
    def time(self) -> float | None:
        return float(self._times[-1]) if len(self._times) else None

    def add_frame(self, time: float) -> int:
        """The next frame; how many frames ago displacements until it began, 0 if that frame was lost."""
        self._times = np.append(self._times[-self.reach :], time)
        rows, there = spaced(self._times, 1, 2, self._apart, self._period)
        return int(rows[0, 1] - rows[0, 0]) if there.all() else 0

    def update(
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
        for axis, smoother in enumerate(self._axes):
            smoother.predict(dt)
            smoother.add_relative_motion(back, displacement[axis], self.reach * covariance[axis, axis])
        place = np.array([*(each.values[-1] for each in self._axes), yaw])
        self._first = place if self._first is None else self._first
        before, self._pose = self._pose, between(self._first, place)
        spread = np.diag([*(each.variance_since(1) for each in self._axes), 0.0])
        cos, sin = np.cos(yaw), np.sin(yaw)
        turned = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        spread = turned @ spread @ turned.T + np.diag([1e-8, 1e-8, min(doubt, np.pi**2)])
        rate = turned[:2, :2] @ [each.rate for each in self._axes]
        known = turned[:2, :2] @ np.diag([each.covariance[-1, -1] for each in self._axes]) @ turned[:2, :2].T
        return self._pose, between(before, self._pose), spread, rate, known, back > 0


def as_track(times: np.ndarray, track: list[tuple[np.ndarray, ...]], turn_seen: bool = False) -> Track:
    """What `DisplacementIntegrator.next` said of every frame; turns are seen with displacements, or always."""
    *values, seen = (np.stack(each) for each in zip(*track, strict=True))
    pose, step, spread, *velocity = values
    return Track(times, pose, step, *velocity, seen, seen | turn_seen, ErrorModel.independent(spread))
