"""Errors of odometry, and the covariance of a motion between any two frames: one model for SLAM, run folders, reports.

Errors of headings and velocities last. A heading that was off is corrected later, so a turn is off by the difference
of the errors at its ends, not by the sum of what each step adds. Velocities of frames in a row come from the same
echoes, so their errors add up along the way. Both are states of the error: first-order Gauss-Markov processes
(Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 8.2).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from jaxtyping import Float, Int

from radarize.io.pose import adjoint, between, inverse

#: Standard deviation of the scale of odometry: handheld, where the sensor nods, ways are 0.4 to 0.5 % too short (chosen
#: on the walks of `radarize.evaluation.benchmark.choices.CLAIMS`).
SCALE = 0.004


@dataclass(frozen=True)
class ErrorModel:
    """Errors of consecutive steps, from each frame to the next.

    A step has noise of its own. Beside it there are three errors that last, of the heading (rad) and of the velocity
    (m/s, forward and left): each goes on from frame to frame as correlation * error, and noise is added to it such that
    its covariance becomes `variance`.

    Attributes:
        duration: (frame,) s, of the step that ends at the frame.
        noise: (frame, 3, 3) covariance of what each step adds, x, y (m) and yaw (rad) in the frame at its end.
        correlation: (frame, 2) share of the heading's and of the velocity's error before that goes on.
        variance: (frame, 3, 3) covariance of the errors of heading and velocity at the frame.
    """

    duration: Float[np.ndarray, "*frame"]
    noise: Float[np.ndarray, "*frame 3 3"]
    correlation: Float[np.ndarray, "*frame 2"]
    variance: Float[np.ndarray, "*frame 3 3"]

    @classmethod
    def independent(cls, covariance: Float[np.ndarray, "*frame 3 3"]) -> Self:
        """Of steps whose errors are independent."""
        steps = covariance.shape[:-2]
        return cls(np.ones(steps), covariance, np.zeros((*steps, 2)), np.zeros(covariance.shape))

    @classmethod
    def joined(cls, parts: "list[ErrorModel]") -> Self:
        """Of consecutive batches as one."""
        return cls(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(cls)))

    def __getitem__(self, frame: int | slice | Int[np.ndarray, "_"]) -> Self:
        """Of some frames."""
        return type(self)(*(np.asarray(getattr(self, each.name)[frame]) for each in fields(self)))

    def __iter__(self) -> Iterator[Self]:
        return (self[frame] for frame in range(len(self)))

    def __len__(self) -> int:
        return len(self.duration)

    def part(self, share: float) -> Self:
        """Of a part of a step, up to its end."""
        duration = np.asarray(self.duration * share)
        return type(self)(duration, self.noise * share, self.correlation**share, self.variance)

    def turns(self, length: int) -> Float[np.ndarray, "window"]:
        """Variance of the turn over so many steps after every frame that has as many after it, rad^2."""
        first, last = slice(None, -length), slice(length, None)
        noise, error = np.cumsum(self.noise[:, 2, 2]), self.variance[:, 0, 0]
        kept = np.cumsum(np.log(np.maximum(self.correlation[:, 0], 1e-300)))
        shared = error[first] * np.exp(kept[last] - kept[first])
        return noise[last] - noise[first] + error[first] + error[last] - 2 * shared

    def motions(
        self, poses: Float[np.ndarray, "frame 3"], starts: Int[np.ndarray, "window"], length: int
    ) -> Float[np.ndarray, "window 3 3"]:
        """Covariance of the motions over so many steps after some frames, in the frame at their ends."""
        motion = MotionCovariance(self.variance[starts])
        for k in (starts + i for i in range(1, length + 1)):
            motion.step(between(poses[k - 1], poses[k]), self[k])
        return motion.covariance

    def since_start(self, poses: Float[np.ndarray, "frame 3"]) -> Float[np.ndarray, "frame 3 3"]:
        """Covariance of each pose in its own frame, given the first one."""
        found, motion = np.zeros((len(poses), 3, 3)), MotionCovariance(self.variance[0])
        for k in range(1, len(poses)):
            motion.step(between(poses[k - 1], poses[k]), self[k])
            found[k] = motion.covariance
        return found


class MotionCovariance:
    """Covariance of a motion, step by step; or of several side by side, along a leading axis.

    Args:
        variance: of the errors of heading and velocity at the start.
        scale: standard deviation of the scale of odometry.
    """

    def __init__(self, variance: Float[np.ndarray, "*window 3 3"], scale: float = SCALE):
        before, self._scale = variance.shape[:-2], scale
        self._way = np.zeros((*before, 3))  # back to the start, seen from the end
        # Of the motion (x, y, yaw) in the frame at its end, and of the errors of heading and velocity there.
        self._joint = np.zeros((*before, 6, 6))
        self._joint[..., 3:, 3:] = variance

    def step(self, motion: Float[np.ndarray, "*window 3"], errors: ErrorModel) -> None:
        """Go on by a step."""
        half = np.asarray(errors.duration)[..., None] / 2
        kept = errors.correlation[..., [0, 1, 1]]
        moved = np.zeros((*self._joint.shape[:-2], 3, 3))  # by errors of heading and velocity
        moved[..., 0], moved[..., :2, 1:] = half_turned(motion), _half_way(motion) * half[..., None]
        carry, news = np.zeros_like(self._joint), np.concatenate([moved, np.broadcast_to(np.eye(3), moved.shape)], -2)
        carry[..., :3, :3] = adjoint(inverse(motion))
        # A heading that was off and is no longer has turned; a velocity is the mean of those at both ends.
        carry[..., :3, 3:] = moved * (kept + [-1.0, 1.0, 1.0])[..., None, :]
        carry[..., [3, 4, 5], [3, 4, 5]] = kept
        added = errors.variance - kept[..., :, None] * kept[..., None, :] * self._joint[..., 3:, 3:]
        self._joint = carry @ self._joint @ carry.mT + news @ _positive(added) @ news.mT
        self._joint[..., :3, :3] += errors.noise
        self._way = (adjoint(inverse(motion)) @ self._way[..., None])[..., 0] + inverse(motion) * [1.0, 1.0, 0.0]

    @property
    def covariance(self) -> Float[np.ndarray, "*window 3 3"]:
        """Of (x, y, yaw), m and rad, in the frame at the end."""
        return self._joint[..., :3, :3] + self._scale**2 * self._way[..., :, None] * self._way[..., None, :]


def half_turned(motion: Float[np.ndarray, "*window 3"]) -> Float[np.ndarray, "*window 3"]:
    """Derivative of a motion, in the frame at its end, by an error of its turn: half of the turn comes before the way,
    so that the way goes into another direction, too."""
    x, y, _ = np.moveaxis(inverse(motion), -1, 0)
    return np.stack([y / 2, -x / 2, np.ones_like(x)], axis=-1)


def _half_way(motion: Float[np.ndarray, "*window 3"]) -> Float[np.ndarray, "*window 2 2"]:
    """Turns a velocity in the middle of a motion into the frame at its end."""
    cos, sin = np.cos(motion[..., 2] / 2), np.sin(motion[..., 2] / 2)
    return np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)


def _positive(matrix: Float[np.ndarray, "*window 3 3"]) -> Float[np.ndarray, "*window 3 3"]:
    """Where errors shrink faster than `correlation` has it, nothing is added."""
    found = np.zeros_like(matrix)
    found[..., 0, 0] = np.maximum(matrix[..., 0, 0], 0.0)
    velocity = matrix[..., 1:, 1:]
    both = np.all(np.diagonal(velocity, axis1=-2, axis2=-1) >= 0, axis=-1)
    found[..., 1:, 1:] = np.where(np.asarray(both)[..., None, None], velocity, 0.0)
    return found
