"""Error model of odometry, and covariance of the motion between any two frames. SLAM, run folders and reports use it.

Errors of heading and velocity are correlated in time. A heading error is corrected later, so the error of a rotation is
the difference of the heading errors at its ends, not the sum of the errors of its steps. Consecutive velocities come
from the same echoes, so their errors add up along the path. Both are states of the error model: first-order
Gauss-Markov processes (Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001,
section 8.2).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from jaxtyping import Float, Int

from radarize.io.pose import adjoint, between, inverse

#: Standard deviation of the scale error of odometry. With a handheld sensor, which nods, distances are 0.4 to 0.5 % too
#: short (chosen on the tuning set for covariances, `radarize.evaluation.benchmark.choices`).
SCALE = 0.004


@dataclass(frozen=True)
class ErrorModel:
    """Errors of consecutive steps, from each frame to the next.

    Each step has noise of its own. In addition, three errors persist: of the heading (rad) and of the velocity (m/s,
    forward and left). From frame to frame, each becomes correlation * error, plus noise such that its covariance
    becomes `variance`.

    Attributes:
        duration: (frame,) s, of the step that ends at the frame.
        noise: (frame, 3, 3) covariance of the noise of each step, x, y (m) and yaw (rad) in the frame at its end.
        correlation: (frame, 2) share of the previous errors of heading and of velocity that persists.
        variance: (frame, 3, 3) covariance of the errors of heading and velocity at the frame.
    """

    duration: Float[np.ndarray, "*frame"]
    noise: Float[np.ndarray, "*frame 3 3"]
    correlation: Float[np.ndarray, "*frame 2"]
    variance: Float[np.ndarray, "*frame 3 3"]

    @classmethod
    def independent(cls, covariance: Float[np.ndarray, "*frame 3 3"]) -> Self:
        """Error model of steps with independent errors."""
        steps = covariance.shape[:-2]
        return cls(np.ones(steps), covariance, np.zeros((*steps, 2)), np.zeros(covariance.shape))

    @classmethod
    def joined(cls, parts: "list[ErrorModel]") -> Self:
        """Concatenate the error models of consecutive batches."""
        return cls(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(cls)))

    def __getitem__(self, frame: int | slice | Int[np.ndarray, "_"]) -> Self:
        """Error model of some frames."""
        return type(self)(*(np.asarray(getattr(self, each.name)[frame]) for each in fields(self)))

    def __iter__(self) -> Iterator[Self]:
        return (self[frame] for frame in range(len(self)))

    def __len__(self) -> int:
        return len(self.duration)

    def part(self, share: float) -> Self:
        """Error model of the last share (0...1) of a step."""
        duration = np.asarray(self.duration * share)
        return type(self)(duration, self.noise * share, self.correlation**share, self.variance)

    def turns(self, length: int) -> Float[np.ndarray, "window"]:
        """Return the variance of the rotation over `length` steps from every frame with as many steps after it,
        rad^2."""
        first, last = slice(None, -length), slice(length, None)
        noise, error = np.cumsum(self.noise[:, 2, 2]), self.variance[:, 0, 0]
        kept = np.cumsum(np.log(np.maximum(self.correlation[:, 0], 1e-300)))
        shared = error[first] * np.exp(kept[last] - kept[first])
        return noise[last] - noise[first] + error[first] + error[last] - 2 * shared

    def motions(
        self, poses: Float[np.ndarray, "frame 3"], starts: Int[np.ndarray, "window"], length: int
    ) -> Float[np.ndarray, "window 3 3"]:
        """Return the covariance of the motions over `length` steps from some frames, in the frames at their ends."""
        motion = MotionCovariance(self.variance[starts])
        for k in (starts + i for i in range(1, length + 1)):
            motion.step(between(poses[k - 1], poses[k]), self[k])
        return motion.covariance

    def since_start(self, poses: Float[np.ndarray, "frame 3"]) -> Float[np.ndarray, "frame 3 3"]:
        """Return the covariance of each pose in its own frame, given the first one."""
        found, motion = np.zeros((len(poses), 3, 3)), MotionCovariance(self.variance[0])
        for k in range(1, len(poses)):
            motion.step(between(poses[k - 1], poses[k]), self[k])
            found[k] = motion.covariance
        return found


class MotionCovariance:
    """Covariance of a motion, propagated step by step; or of several motions, along a leading axis.

    Args:
        variance: covariance of the errors of heading and velocity at the start.
        scale: standard deviation of the scale error.
    """

    def __init__(self, variance: Float[np.ndarray, "*window 3 3"], scale: float = SCALE):
        before, self._scale = variance.shape[:-2], scale
        self._to_start = np.zeros((*before, 3))  # vector from the end to the start, in the frame at the end
        # Joint covariance of the motion (x, y, yaw) in the frame at its end and of the errors of heading and velocity
        # there.
        self._joint = np.zeros((*before, 6, 6))
        self._joint[..., 3:, 3:] = variance

    def step(self, motion: Float[np.ndarray, "*window 3"], errors: ErrorModel) -> None:
        """Propagate by a step."""
        half = np.asarray(errors.duration)[..., None] / 2
        kept = errors.correlation[..., [0, 1, 1]]
        derivative = np.zeros((*self._joint.shape[:-2], 3, 3))  # of the step by the errors of heading and velocity
        derivative[..., 0], derivative[..., :2, 1:] = half_turned(motion), _half_way(motion) * half[..., None]
        noise_gain = np.concatenate([derivative, np.broadcast_to(np.eye(3), derivative.shape)], -2)
        transition = np.zeros_like(self._joint)
        transition[..., :3, :3] = adjoint(inverse(motion))
        # The error of a rotation is the change of the heading error; the velocity of a step is the mean of those at its
        # ends.
        transition[..., :3, 3:] = derivative * (kept + [-1.0, 1.0, 1.0])[..., None, :]
        transition[..., [3, 4, 5], [3, 4, 5]] = kept
        added = errors.variance - kept[..., :, None] * kept[..., None, :] * self._joint[..., 3:, 3:]
        self._joint = transition @ self._joint @ transition.mT + noise_gain @ _positive(added) @ noise_gain.mT
        self._joint[..., :3, :3] += errors.noise
        to_start = (adjoint(inverse(motion)) @ self._to_start[..., None])[..., 0]
        self._to_start = to_start + inverse(motion) * [1.0, 1.0, 0.0]

    @property
    def covariance(self) -> Float[np.ndarray, "*window 3 3"]:
        """Covariance of (x, y, yaw), m and rad, in the frame at the end."""
        return self._joint[..., :3, :3] + self._scale**2 * self._to_start[..., :, None] * self._to_start[..., None, :]


def half_turned(motion: Float[np.ndarray, "*window 3"]) -> Float[np.ndarray, "*window 3"]:
    """Derivative of a motion, in the frame at its end, by an error of its rotation: half of the rotation precedes the
    translation, so its direction changes too."""
    x, y, _ = np.moveaxis(inverse(motion), -1, 0)
    return np.stack([y / 2, -x / 2, np.ones_like(x)], axis=-1)


def _half_way(motion: Float[np.ndarray, "*window 3"]) -> Float[np.ndarray, "*window 2 2"]:
    """Rotation of a velocity in the middle of a motion into the frame at its end."""
    cos, sin = np.cos(motion[..., 2] / 2), np.sin(motion[..., 2] / 2)
    return np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1)], -2)


def _positive(matrix: Float[np.ndarray, "*window 3 3"]) -> Float[np.ndarray, "*window 3 3"]:
    """Covariance of the added noise; zero where the errors shrink faster than `correlation` allows."""
    found = np.zeros_like(matrix)
    found[..., 0, 0] = np.maximum(matrix[..., 0, 0], 0.0)
    velocity = matrix[..., 1:, 1:]
    both = np.all(np.diagonal(velocity, axis1=-2, axis2=-1) >= 0, axis=-1)
    found[..., 1:, 1:] = np.where(np.asarray(both)[..., None, None], velocity, 0.0)
    return found
