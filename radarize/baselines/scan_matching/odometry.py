"""Odometry from scans: each is matched with a grid of the last few, where constant velocity puts it."""

from collections import deque
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from radarize.io.pose import between, compose, exponential, transform
from radarize.io.stopwatch import stage
from radarize.odometry.integration import Track, intervals
from radarize.odometry.smoother import random_walk_covariance
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS
from radarize.slam.config import SlamConfig
from radarize.slam.grid import OccupancyGrid
from radarize.slam.matcher import match
from radarize.slam.node import Node, Scan

#: m/s^1.5 and rad/s^1.5: by how much velocity and rate of turn wander in a second.
_WANDER = np.array([1.0, 1.0, 2.0])
#: m/s and rad/s: standard deviations of a motion that nothing is known of.
_ANY_RATE = np.array([1.0, 1.0, 1.0])
#: Scans in the grid, each added once the sensor has moved by as much as the settings make a node of; and as of `match`:
#: a scan's errors are much the same in the next, so each counts little.
_KEYS, _SIGMA = 12, 3.0


class ScanMatching:
    """Odometry of a stream of frames: a Kalman filter of pose and velocity, whose measurement is the match.

    Args:
        settings: of node, grid and matcher.
        rates: says rate of turning (rad/s) and its variance of each frame, NaN where it does not know; None: nobody.
        bearings: of the scans, rad.
    """

    def __init__(
        self,
        settings: SlamConfig | None = None,
        rates: Callable[[Batch], Float[np.ndarray, "frame 2"]] | None = None,
        bearings: Float[np.ndarray, "bearing"] = BEARINGS,
    ):
        self.settings, self.rates = settings or SlamConfig.preset("lidar"), rates
        self.bearings = bearings
        self._keys: deque[tuple[np.ndarray, Node]] = deque(maxlen=_KEYS)
        self._grid = OccupancyGrid.empty(self.settings.grid.resolution)
        self._time: float | None = None
        self._pose = np.zeros(3)
        self._rate = np.zeros(3)  # m/s and rad/s, in the sensor's frame
        self._spread = np.diag([*np.zeros(3), *_ANY_RATE**2])  # of pose and rate, in the sensor's frame

    def update(self, batch: Batch) -> Track:
        """Poses of the next frames."""
        centers = batch.centers
        steps = intervals(centers, self._time)
        ranges = batch.ranges
        assert ranges is not None  # the pipeline extracts scans first
        turning = np.full((len(centers), 2), np.nan) if self.rates is None else self.rates(batch)
        moved, seen = np.zeros((len(centers), 3)), np.zeros(len(centers), bool)
        poses, rates, spreads = moved.copy(), moved.copy(), np.zeros((len(centers), 3, 3))
        with stage("translation"):
            for i, (time, dt) in enumerate(zip(centers, steps, strict=True)):
                before = self._pose
                seen[i] = self._step(Scan(time, np.zeros(3), self.bearings, ranges[i]), dt, turning[i])
                poses[i], rates[i], spreads[i] = self._pose, self._rate, self._spread[3:, 3:]
                moved[i] = between(before, self._pose)
        spread = spreads * steps[:, None, None] ** 2
        errors = ErrorModel.independent(spread)
        return Track(centers, poses, moved, rates[:, :2], spreads[:, :2, :2], seen, seen, errors)

    def _step(self, scan: Scan, dt: float, turning: Float[np.ndarray, "2"]) -> bool:
        """Move on to the next scan, and to a rate of turning with its variance; whether there are points to match."""
        first, self._time = self._time is None, scan.time
        node = Node.gather([scan], self.settings)
        points = node.points
        seen = len(points) >= self.settings.node.min_points
        if first:
            self._add(node)
            return seen
        self._pose = compose(self._pose, exponential(self._rate[:2] * dt, self._rate[2] * dt))
        move = np.eye(6) + dt * np.eye(6, k=3)
        self._spread = move @ self._spread @ move.T + np.kron(random_walk_covariance(1.0, dt), np.diag(_WANDER**2))
        if np.isfinite(turning).all():
            self._turn(*turning)
        if seen:
            self._correct(points)
        x, y, yaw = between(self._keys[-1][0], self._pose)
        if np.hypot(x, y) >= self.settings.node.distance or abs(yaw) >= self.settings.node.angle:
            self._add(node)
        return seen

    def _turn(self, rate: float, variance: float) -> None:
        """Take in a rate of turning and its variance."""
        gain = self._spread[:, 5] / (self._spread[5, 5] + variance)
        change = gain * (rate - self._rate[2])
        self._rate = self._rate + change[3:]
        self._pose = compose(self._pose, change[:3])
        self._spread = self._spread - np.outer(gain, self._spread[5])

    def _correct(self, points: Float[np.ndarray, "point 2"]) -> None:
        """Fit the pose of a scan to the grid; the rate follows as much as its error goes along with the pose's."""
        prior = self._spread[:3, :3]
        found = match(self._grid, points, self._pose, sigma=_SIGMA, prior=self._pose, covariance=prior)
        fitted = np.linalg.inv(np.linalg.inv(prior) + found.information)
        along = self._spread[3:, :3] @ np.linalg.inv(prior)
        self._rate = self._rate + along @ between(self._pose, found.pose)
        rate = self._spread[3:, 3:] - along @ (prior - fitted) @ along.T
        self._spread = np.block([[fitted, fitted @ along.T], [along @ fitted, rate]])
        self._pose = found.pose

    def _add(self, node: Node) -> None:
        """A key scan joins the grid, which is drawn anew from those that are left."""
        self._keys.append((self._pose, node))
        self._grid = OccupancyGrid.empty(self.settings.grid.resolution)
        for pose, key in self._keys:
            origins, ends, hits = key.rays
            self._grid.insert(transform(pose, origins), transform(pose, ends), hits, self.settings.grid, spread=True)


def odometry(inputs: Inputs) -> ScanMatching:
    """By the pipeline's scans."""
    return ScanMatching()


METHOD = Method("scan matching", odometry, scans=True)
