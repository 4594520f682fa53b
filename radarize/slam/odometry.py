"""Odometry as a function of time: poses, and covariances of motions between any two times."""

from collections import deque
from collections.abc import Sequence
from copy import copy
from itertools import islice

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.pose import adjoint, between, interpolate
from radarize.odometry.uncertainty import ErrorModel, MotionCovariance
from radarize.slam.config import OdometryConfig
from radarize.slam.rows import Rows

#: Maximum magnitude of input poses (m) and angles (rad): their cells stay within the integers of the compiled loops.
FARTHEST = 1e6


class Odometry:
    """Poses in an odometry frame, in order of time.

    Args:
        config: uncertainty of steps without an error model.
        endless: keep only the poses that later motions need.
    """

    def __init__(self, config: OdometryConfig, endless: bool = False):
        self.config, self.endless = config, endless
        self._times, self._poses = Rows(), Rows(3)
        self._errors: deque[ErrorModel | None] = deque()  # of the latest entries, as far as later motions need them
        self._released: tuple[float, float, MotionCovariance] | None = None  # start, end and covariance of a motion

    def __len__(self) -> int:
        return len(self._times)

    @property
    def times(self) -> Float[np.ndarray, "entry"]:
        """Times of the entries, s."""
        return self._times.values

    def add(
        self, time: float, pose: Float[np.ndarray, "3"], errors: ErrorModel | Float[np.ndarray, "3 3"] | None
    ) -> bool:
        """Append a pose and the error model, or the covariance, of the step since the previous one; False if its time
        is not later.

        Raises:
            InputError: a value is not within `FARTHEST`, or a covariance is not symmetric and positive semidefinite.
        """
        pose = np.asarray(pose, float)
        if pose.shape != (3,) or not (np.abs(pose) <= FARTHEST).all() or not np.isfinite(time):
            raise InputError(
                f"odometry at {time}: pose is {pose}, expected finite time, and x, y, yaw within {FARTHEST:g} m or rad"
            )
        if errors is not None and not isinstance(errors, ErrorModel):
            errors = ErrorModel.independent(np.asarray(errors, float))
        if errors is not None:
            _check_covariance(time, errors.noise)
        if len(self) and time <= self.times[-1]:
            return False
        self._times.append(float(time))
        self._poses.append(pose)
        self._errors.append(errors)
        return True

    def covers(self, time: float) -> bool:
        """Whether the pose at a time is known, without extrapolation."""
        return bool(len(self)) and bool(self.times[-1] >= time)

    def pose(self, time: float | Float[np.ndarray, "instant"]) -> Float[np.ndarray, "*instant 3"]:
        """Return the pose at a time, interpolated; before the first entry and after the last one it is constant."""
        times, poses, last = self.times, self._poses.values, len(self) - 1
        after = np.searchsorted(times, time)
        right = np.clip(after, min(1, last), last)
        left = np.maximum(right - 1, 0)
        inside = (after > 0) & (after <= last)
        share = (time - times[left]) / np.where(inside, times[right] - times[left], 1.0)
        between_entries = interpolate(poses[left], poses[right], share)
        return np.where(inside[..., None], between_entries, poses[np.minimum(after, last)])

    def motion(self, start: float, end: float) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """Return the motion from start to end (s) in the frame at the start, and its covariance in the frame at the
        end.

        After a `release` no motion may begin before its `start`.
        """
        whole = between(self.pose(start), self.pose(end))
        errors = self._covariance(start, end)
        if errors is None:
            return whole, self.model(whole)
        # A minimum covariance keeps the graph solvable where odometry has a covariance of zero (a sensor at rest).
        shared = 1e-4 + self.config.scale * np.hypot(whole[0], whole[1])
        return whole, errors.covariance + np.diag([shared, shared, 1e-4]) ** 2

    def release(self, start: float, until: float) -> None:
        """Discard error models up to `until`, except the covariance of the motion since `start` (s). Later motions
        begin at `start`, or at `until` or later. An endless session also discards the poses before `start` and between
        the two."""
        errors = self._covariance(start, until) if until > start else None
        self._released = None if errors is None else (start, until, errors)
        first = int(np.searchsorted(self.times, until))
        while len(self) - len(self._errors) < first:
            self._errors.popleft()
        if self.endless:
            after = int(np.searchsorted(self.times, start))
            for low, high in ((after + 1, first - 1), (0, after - 1)):
                self._times.drop(low, high)
                self._poses.drop(low, high)

    def _covariance(self, start: float, end: float) -> MotionCovariance | None:
        """Covariance of a motion; None if one of its steps has no error model. The errors at the start are those of the
        first entry that is not before it."""
        times, motion_so_far = self.times, None
        if self._released and self._released[0] == start and self._released[1] <= end:
            _, start, motion_so_far = self._released
        low, high = np.searchsorted(times, (start, end))
        discarded, last = len(self) - len(self._errors), min(high, len(self) - 1)
        if low < discarded:
            return None
        steps = list(islice(self._errors, max(low - discarded, 0), max(last + 1 - discarded, 0)))
        if not (steps or motion_so_far) or any(errors is None for errors in steps[not low :]):
            return None
        start_errors = steps[0].variance if steps and steps[0] is not None else np.zeros((3, 3))
        found = copy(motion_so_far) if motion_so_far is not None else MotionCovariance(start_errors, scale=0.0)
        for k, errors in enumerate(steps, low):
            begin, finish = max(start, times[max(k - 1, 0)]), min(end, times[k])
            if errors is not None and finish > begin:
                motion = between(self.pose(begin), self.pose(finish))
                found.step(motion, errors.part((finish - begin) / (times[k] - times[k - 1])))
        return found

    def model(self, step: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of a step from the configured standard deviations."""
        c, distance, angle = self.config, np.hypot(step[0], step[1]), abs(step[2])
        translation = np.hypot(c.translation, c.translation_per_metre * distance)
        rotation = np.linalg.norm([c.rotation, c.rotation_per_metre * distance, c.rotation_per_radian * angle])
        return np.diag([translation, translation, rotation]) ** 2


def _check_covariance(time: float, covariance: Float[np.ndarray, "3 3"]) -> None:
    """Check a covariance.

    Raises:
        InputError: it has another shape, is not finite, not symmetric, or not positive semidefinite.
    """
    if covariance.shape != (3, 3) or not (np.abs(covariance) <= FARTHEST**2).all():
        raise InputError(
            f"odometry at {time}: covariance is {covariance.tolist()}, expected a 3 x 3 within {FARTHEST**2:g}"
        )
    slack = 1e-6 * np.abs(covariance).max()
    if np.abs(covariance - covariance.T).max() > slack or np.linalg.eigvalsh(covariance)[0] < -slack:
        raise InputError(
            f"odometry at {time}: covariance is {covariance.tolist()}, "
            "expected it symmetric and without negative eigenvalues"
        )


class Drift:
    """Covariance of the odometry between any two nodes, from cumulative sums over its steps."""

    def __init__(self, scale: float):
        self.scale = scale
        self._inverse: list[np.ndarray] = []
        self._sums: list[np.ndarray] = []
        self._lengths: list[float] = []

    def add(self, pose: Float[np.ndarray, "3"], covariance: Float[np.ndarray, "3 3"], length: float) -> None:
        """Append a node: pose in a frame without jumps, covariance (in the frame of the node) and length of the last
        step."""
        carry = adjoint(pose)
        self._inverse.append(np.linalg.inv(carry))
        self._sums.append((self._sums[-1] if self._sums else 0) + carry @ covariance @ carry.T)
        self._lengths.append((self._lengths[-1] if self._lengths else 0.0) + length)

    def keep(self, numbers: Sequence[int]) -> None:
        """Remove all other nodes."""
        self._inverse, self._sums = ([rows[k] for k in numbers] for rows in (self._inverse, self._sums))
        self._lengths = [self._lengths[k] for k in numbers]

    def between(self, first: int, second: int) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of the motion between two nodes, in the frame of the later one."""
        low, high = min(first, second), max(first, second)
        home = self._inverse[high]
        shared = self.scale * (self._lengths[high] - self._lengths[low])
        return home @ (self._sums[high] - self._sums[low]) @ home.T + np.diag([shared, shared, 0.0]) ** 2


class ConstantMotion(Odometry):
    """Substitute for missing odometry: the last motion that the matcher found is assumed to continue."""

    def __init__(self, config: OdometryConfig):
        super().__init__(config)
        self.last = np.zeros(3)

    def pose(self, time: float | Float[np.ndarray, "instant"]) -> Float[np.ndarray, "*instant 3"]:
        """Return the origin: all scans of one node have the same pose."""
        return np.zeros((*np.shape(time), 3))

    def motion(self, start: float, end: float) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
        """Return the last motion, with the large covariance of missing odometry."""
        c = self.config
        return self.last, np.diag([c.missing_translation, c.missing_translation, c.missing_rotation]) ** 2
