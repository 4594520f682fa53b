"""A path from displacements over longer than a frame, told anew at every frame.

They are reconciled as positions of the last frames that the differences tie together (`Ties`), as in filters with
cloned states. Windows overlap, so that as many of them as fit into one are believed as much as one.
"""

import numpy as np

from radarize.odometry.ties import Ties
from radarize.pose import between

#: m/s^2 and m/s: standard deviations of a walker's acceleration, and of a speed that nothing is known of.
_ACCELERATION, _FASTEST = 2.0, 1.0


class Displacements:
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
