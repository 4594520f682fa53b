"""Range bias from parallax: the change of a point's direction as the sensor passes determines its distance.

Neither ranges nor Doppler shifts show a bias that is common to all ranges. But as the sensor moves sideways by d, the
direction of a point at distance r turns by d / r: with a bias in the measured range, direction and range contradict
each other. A point is fitted to the ranges and directions of each tracked echo
(`radarize.pipeline.calibration.tracks`). The rotations of the sensor, whose errors look like parallax, and the common
bias are estimated together with the points. The specular reflection of a wall is no point, since it stays on the wall's
normal; no point fits it, and it is excluded.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.egomotion import EgoMotion

#: Standard deviations of measured range (m), of direction cosines to the left and up, of a point's height above the
#: sensor (m), and of the rotation between frames by odometry (rad).
_RANGE, _LEFT, _UP, _HEIGHT, _TURN = 0.008, 0.008, 0.05, 0.6, np.radians(0.5)
#: m, prior standard deviation of the bias, and its maximum magnitude.
_BIAS, _LARGEST = 0.3, 0.45
#: Maximum standard error of a track's own bias, m, and maximum mean square of its residuals.
_PRECISE, _FITS = 0.2, 3.0
_SIGMAS, _ROUNDS, _ALONE = 3.0, 10, 8
#: Number of groups of tracks for the jackknife of the bias.
_GROUPS = 10


@dataclass(frozen=True)
class RangeBias:
    """Range bias estimated from parallax.

    Attributes:
        value, error: bias (measured minus true range) and standard error, m; the error is infinite if not observable.
        tracks: number of points used.
        yaw: (frame,) corrected heading of the sensor, rad.
    """

    value: float
    error: float
    tracks: int
    yaw: Float[np.ndarray, "frame"]


class _Walk(NamedTuple):
    """Poses of the sensor: places (frame, 2), headings (frame,), and the derivative of the step from a frame to the
    next with respect to its heading (frame, 2), m/rad."""

    place: np.ndarray
    yaw: np.ndarray
    swing: np.ndarray


class _Point(NamedTuple):
    """Frames, ranges and directions of a track, and its point (3,) in the world, with height relative to the sensor."""

    frame: np.ndarray
    range: np.ndarray
    direction: np.ndarray
    at: np.ndarray


def find_bias(
    cells: Cells,
    tracks: list[Int[np.ndarray, "cell"]],
    motion: EgoMotion,
    yaw: Float[np.ndarray, "frame"],
    period: float,
) -> RangeBias:
    """Estimate the range bias.

    Args:
        cells, tracks, motion: echoes, tracks and motion of the walk.
        yaw: heading at each frame by odometry, rad, unwrapped.
        period: frame period, s.
    """
    frames = np.arange(len(yaw))
    if not motion.seen.any():
        return RangeBias(0.0, np.inf, 0, yaw)
    known = np.flatnonzero(motion.seen)
    velocity = np.stack([np.interp(frames, known, motion.velocity[known, axis]) for axis in (0, 1)], axis=1)
    walk = _walked(velocity, yaw, period)
    points, biases = [], []
    for track in tracks:
        point, bias, error, misfit = _alone(_start(cells, track, motion, walk), walk)
        if error < _PRECISE and misfit < _FITS and abs(bias) < _LARGEST:
            points.append(point)
            biases.append((bias, error))
    if not points:
        return RangeBias(0.0, np.inf, 0, yaw)
    order = np.argsort([error for _, error in biases])[: max(len(points) // 2, 1)]
    bias, turned = float(np.median([biases[k][0] for k in order])), yaw
    for _ in range(_ROUNDS):
        walk = _walked(velocity, turned, period)
        points = [_moved(point, walk, bias) for point in points]
        parts = [_reduced(point, walk, bias) for point in points]
        normal, right = _turns(yaw, turned)
        for place, part, rest in parts:
            normal[np.ix_(place, place)] += part
            right[place] += rest
        step = np.linalg.solve(normal, right)
        turned, bias = turned + np.clip(step[:-1], -0.1, 0.1), bias + float(np.clip(step[-1], -0.1, 0.1))
    return RangeBias(bias, _error(normal, parts), len(points), turned)


def _walked(velocity: np.ndarray, yaw: np.ndarray, period: float) -> _Walk:
    c, s = np.cos(yaw), np.sin(yaw)
    world = np.stack([c * velocity[:, 0] - s * velocity[:, 1], s * velocity[:, 0] + c * velocity[:, 1]], axis=1)
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(period * (world[1:] + world[:-1]) / 2, axis=0)])
    return _Walk(place, yaw, period * np.stack([-world[:, 1], world[:, 0]], axis=1))


def _start(cells: Cells, track: np.ndarray, motion: EgoMotion, walk: _Walk) -> _Point:
    """Return the point at the position that the middle of its track measures."""
    frame, middle = cells.frame[track], track[len(track) // 2]
    left, up = motion.directions[middle]
    here, away = cells.frame[middle], cells.range[middle]
    c, s, ahead = np.cos(walk.yaw[here]), np.sin(walk.yaw[here]), np.sqrt(max(1 - left**2 - up**2, 0.02))
    at = np.array([*(walk.place[here] + away * np.array([c * ahead - s * left, s * ahead + c * left])), away * up])
    return _Point(frame, cells.range[track], motion.directions[track], at)


def _linear(point: _Point, walk: _Walk, bias: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return residuals of ranges and both directions in standard deviations (3n,), their weights, and the derivatives
    of the expected values by the point (3n, 3) and by the heading of the frame (3n,)."""
    n, yaw = len(point.frame), walk.yaw[point.frame]
    c, s = np.cos(yaw), np.sin(yaw)
    off = np.column_stack([point.at[:2] - walk.place[point.frame], np.full(n, point.at[2])])
    away = np.linalg.norm(off, axis=1).clip(0.05)
    unit = off / away[:, None]
    to_left, to_front = np.column_stack([-s, c, 0 * s]), np.column_stack([c, s, 0 * s])
    left, ahead = (to_left * unit).sum(axis=1), (to_front * unit).sum(axis=1)
    seen = [point.range - bias - away, point.direction[:, 0] - left, point.direction[:, 1] - unit[:, 2]]
    by_left = (to_left - left[:, None] * unit) / away[:, None]
    by_up = (np.array([0.0, 0.0, 1.0]) - unit[:, 2:] * unit) / away[:, None]
    noise = np.repeat([_RANGE, _LEFT, _UP], n)
    off_by = np.concatenate(seen) / noise
    by_point = np.concatenate([unit, by_left, by_up]) / noise[:, None]
    by_yaw = np.concatenate([np.zeros(n), -ahead, np.zeros(n)]) / noise
    return off_by, 1 / (1 + off_by**2 / _SIGMAS**2) ** 2, by_point, by_yaw


_LEVEL = np.diag([0.0, 0.0, _HEIGHT**-2])


def _alone(point: _Point, walk: _Walk) -> tuple[_Point, float, float, float]:
    """Fit the point together with a bias of its own; return both, its standard error, m, and the mean square
    residual."""
    bias, prior = 0.0, np.diag([0.0, 0.0, _HEIGHT**-2, _BIAS**-2])
    for _ in range(_ALONE):
        off, weight, by_point, _ = _linear(point, walk, bias)
        by_bias = np.repeat([1 / _RANGE, 0.0, 0.0], len(point.frame))
        columns = np.column_stack([by_point, by_bias])
        weight = np.sqrt(weight)
        normal = (columns * weight[:, None]).T @ columns + prior
        right = columns.T @ (weight * off) - prior @ np.array([*point.at, bias])
        step = np.linalg.solve(normal, right)
        point = point._replace(at=point.at + np.clip(step[:3], -0.5, 0.5))
        bias += float(np.clip(step[3], -0.3, 0.3))
    return point, bias, float(np.sqrt(np.linalg.inv(normal)[3, 3])), float(np.mean(off**2))


def _moved(point: _Point, walk: _Walk, bias: float) -> _Point:
    """Fit the point for given headings and bias."""
    for _ in range(2):
        off, weight, by_point, _ = _linear(point, walk, bias)
        normal = (by_point * weight[:, None]).T @ by_point + _LEVEL
        step = np.linalg.solve(normal, by_point.T @ (weight * off) - _LEVEL @ point.at)
        point = point._replace(at=point.at + np.clip(step, -0.3, 0.3))
    return point


def _reduced(point: _Point, walk: _Walk, bias: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the equations of headings and, last, bias after elimination of the point: indices of the unknowns, normal
    matrix, right-hand side."""
    off, weight, by_point, by_yaw = _linear(point, walk, bias)
    n, first, last = len(point.frame), point.frame[0], point.frame[-1]
    misfit = (weight * off**2).sum() / max(weight.sum() - 4, 1)
    weight = weight / (1 + (misfit / _FITS) ** 2)
    # A rotation moves all later places from which the point is seen; counted from the first frame of the track.
    span = np.arange(first, last + 1)
    frame = np.tile(point.frame, 3)
    columns = np.zeros((3 * n, len(span) + 1))
    columns[:, :-1] = (-by_point[:, :2] @ walk.swing[span].T) * (span < frame[:, None])
    columns[np.arange(3 * n), frame - first] += by_yaw
    columns[:n, -1] = 1 / _RANGE
    weighted = by_point * weight[:, None]
    eliminated = columns - by_point @ np.linalg.solve(weighted.T @ by_point + _LEVEL, weighted.T @ columns)
    weighted = eliminated * weight[:, None]
    return np.append(span, len(walk.yaw)), weighted.T @ columns, weighted.T @ off


def _turns(expected: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the equations of rotations as measured by odometry, of the first heading, and of the prior of the bias."""
    count = len(yaw)
    normal, right = np.zeros((count + 1, count + 1)), np.zeros(count + 1)
    off = np.diff(expected - yaw) / _TURN**2
    right[1:count] += off
    right[: count - 1] -= off
    k = np.arange(count - 1)
    normal[k, k] += _TURN**-2
    normal[k + 1, k + 1] += _TURN**-2
    normal[k, k + 1] -= _TURN**-2
    normal[k + 1, k] -= _TURN**-2
    normal[0, 0] += 1e8
    normal[count, count] += _BIAS**-2
    return normal, right


def _error(normal: np.ndarray, parts: list) -> float:
    """Return the standard error of the bias: the formal one, or that of the jackknife over groups of tracks if
    larger."""
    without = []
    for group in np.array_split(np.arange(len(parts)), min(_GROUPS, len(parts))):
        rest, right = normal.copy(), np.zeros(len(normal))
        for k in group:
            place, part, off = parts[k]
            rest[np.ix_(place, place)] -= part
            right[place] -= off
        without.append(np.linalg.solve(rest, right)[-1])
    formal = np.linalg.inv(normal)[-1, -1]
    return float(np.sqrt(max((len(without) - 1) * np.var(without), formal)))
