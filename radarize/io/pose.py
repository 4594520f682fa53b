"""Planar poses as arrays (..., 3): x m, y m, yaw rad; leading axes broadcast. At the end, poses in space."""

from typing import overload

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

Pose = Float[np.ndarray, "*#batch 3"]


#: Quaternion x y z w of an optical frame (x right, y down, z forward: REP 103) in one with x forward, y left, z up.
OPTICAL_TURN = (-0.5, 0.5, -0.5, 0.5)


@overload
def wrap(angle: float) -> float: ...


@overload
def wrap(angle: np.ndarray) -> np.ndarray: ...


def wrap(angle: np.ndarray | float) -> np.ndarray | float:
    """Wrap an angle to [-pi, pi)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def compose(a: Pose, b: Pose) -> Pose:
    """Return pose b, given in the frame of a, in the frame that a is given in."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack(
        [
            a[..., 0] + cos * b[..., 0] - sin * b[..., 1],
            a[..., 1] + sin * b[..., 0] + cos * b[..., 1],
            wrap(a[..., 2] + b[..., 2]),
        ],
        axis=-1,
    )


def inverse(a: Pose) -> Pose:
    """Return the inverse of a pose."""
    a = np.asarray(a, float)
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    return np.stack([-cos * a[..., 0] - sin * a[..., 1], sin * a[..., 0] - cos * a[..., 1], wrap(-a[..., 2])], axis=-1)


def between(a: Pose, b: Pose) -> Pose:
    """Return pose b relative to a: compose(a, between(a, b)) == b."""
    return compose(inverse(a), b)


def transform(pose: Pose, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Transform points from the frame of a pose to the frame that the pose is given in."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]


def adjoint(a: Pose) -> Float[np.ndarray, "*#batch 3 3"]:
    """Return the matrix that maps a small motion (x, y, yaw) in the frame of a to the frame that a is given in."""
    cos, sin = np.cos(a[..., 2]), np.sin(a[..., 2])
    found = np.zeros((*a.shape, 3))
    found[..., 0, 0], found[..., 0, 1], found[..., 0, 2] = cos, -sin, a[..., 1]
    found[..., 1, 0], found[..., 1, 1], found[..., 1, 2] = sin, cos, -a[..., 0]
    found[..., 2, 2] = 1.0
    return found


def carried(covariance: Float[np.ndarray, "3 3"], motion: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of a pose in its own frame after an exact motion, in the frame at the end of the motion."""
    back = adjoint(inverse(motion))
    return back @ covariance @ back.T


def interpolate(a: Pose, b: Pose, fraction: np.ndarray | float) -> Pose:
    """Interpolate between poses (fraction 0: a, 1: b), linearly in position, and in heading along the shorter arc."""
    share = np.asarray(fraction, float)
    position = a[..., :2] + share[..., None] * (b[..., :2] - a[..., :2])
    yaw = np.asarray(wrap(a[..., 2] + share * wrap(b[..., 2] - a[..., 2])))
    return np.concatenate([position, yaw[..., None]], axis=-1)


def exponential(translation: Float[np.ndarray, "2"], turn: float) -> Float[np.ndarray, "3"]:
    """Return the motion (x, y, yaw) of a body that translates (m, in its own frame) while it turns: exp of SE(2)."""
    if abs(turn) < 1e-6:
        a, b = 1.0, turn / 2
    else:
        a, b = np.sin(turn) / turn, (1 - np.cos(turn)) / turn
    x, y = translation
    return np.array([a * x - b * y, b * x + a * y, turn])


#: The identity pose x y z qx qy qz qw.
NOWHERE = np.array([0.0, 0, 0, 0, 0, 0, 1])


def frame_between(here: Float[np.ndarray, "7"], there: Float[np.ndarray, "7"]) -> Float[np.ndarray, "7"]:
    """Return the pose of the second frame of reference in the first, given the pose of one body in both.

    Example:
        >>> frame_between(NOWHERE, np.array([1.0, 2, 0, 0, 0, 0, 1]))[:3]
        array([-1., -2.,  0.])
    """
    turn = Rotation.from_quat(here[3:]) * Rotation.from_quat(there[3:]).inv()
    return np.array([*(here[:3] - turn.apply(there[:3])), *turn.as_quat()])
