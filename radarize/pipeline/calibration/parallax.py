"""The range bias from parallax: how far away a point is, its direction says while the sensor passes by.

Ranges alone do not show a bias that they all share, nor do Doppler shifts. But as the sensor moves across by d, the
direction of a point at distance r turns by d / r: with a bias in its measured range, direction and range contradict
each other. A point is fitted to each echo that is followed (`radarize.pipeline.calibration.tracks`), by ranges and
directions; the turns of the sensor, whose errors look like parallax, are solved for together with them, and the bias,
which is one for all. A wall's specular reflection is no point, as it stays on the wall's normal: no point fits it, and
it is left out.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.calibration.cells import Cells
from radarize.pipeline.calibration.egomotion import EgoMotion

#: Standard deviations of a measured range (m) and of direction cosines to the left and up; of a point's height over the
#: sensor, m; and of a turn from one frame to the next as odometry has it, rad.
_RANGE, _LEFT, _UP, _HEIGHT, _TURN = 0.008, 0.008, 0.05, 0.6, np.radians(0.5)
#: m, standard deviation of a bias before anything was measured; the largest that is taken for one.
_BIAS, _LARGEST = 0.3, 0.45
#: A track counts whose own bias has this standard error at most, m, and such a mean square of residuals.
_PRECISE, _FITS = 0.2, 3.0
_SIGMAS, _ROUNDS, _ALONE = 3.0, 10, 8
#: Groups of tracks without each of which the bias is solved for again.
_GROUPS = 10


@dataclass(frozen=True)
class RangeBias:
    """What was found.

    Attributes:
        value, error: m; measured ranges are larger by the value; the standard error is infinite where nothing tells.
        tracks: points it comes from.
        yaw: (frame,) rad, heading of the sensor, corrected.
    """

    value: float
    error: float
    tracks: int
    yaw: Float[np.ndarray, "frame"]


class _Walk(NamedTuple):
    """Poses of the sensor: places (frame, 2), headings (frame,), and by what the way of a frame to the next one moves
    for a turn of its heading (frame, 2), m/rad."""

    place: np.ndarray
    yaw: np.ndarray
    swing: np.ndarray


class _Point(NamedTuple):
    """A track's frames, ranges and directions, and the point (3,) in the world, heights counted from the sensor's."""

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
    """Solve for the range bias.

    Args:
        cells, tracks, motion: of the walk.
        yaw: heading at each frame as odometry has it, rad, unwrapped.
        period: of frames, s.
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
    """The point as the middle of its track has it."""
    frame, middle = cells.frame[track], track[len(track) // 2]
    left, up = motion.directions[middle]
    here, away = cells.frame[middle], cells.range[middle]
    c, s, ahead = np.cos(walk.yaw[here]), np.sin(walk.yaw[here]), np.sqrt(max(1 - left**2 - up**2, 0.02))
    at = np.array([*(walk.place[here] + away * np.array([c * ahead - s * left, s * ahead + c * left])), away * up])
    return _Point(frame, cells.range[track], motion.directions[track], at)


def _linear(point: _Point, walk: _Walk, bias: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Residuals of ranges and both directions in standard deviations (3n,), their weights, and the derivatives of what
    is expected by the point (3n, 3) and by the heading of the frame (3n,)."""
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
    """The point and a bias of its own, with its standard error, m, and the mean square of residuals."""
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
    """The point, fitted to given headings and bias."""
    for _ in range(2):
        off, weight, by_point, _ = _linear(point, walk, bias)
        normal = (by_point * weight[:, None]).T @ by_point + _LEVEL
        step = np.linalg.solve(normal, by_point.T @ (weight * off) - _LEVEL @ point.at)
        point = point._replace(at=point.at + np.clip(step, -0.3, 0.3))
    return point


def _reduced(point: _Point, walk: _Walk, bias: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Equations of the headings and, last, the bias that are left when the point is eliminated: places of the unknowns,
    normal matrix, right side."""
    off, weight, by_point, by_yaw = _linear(point, walk, bias)
    n, first, last = len(point.frame), point.frame[0], point.frame[-1]
    misfit = (weight * off**2).sum() / max(weight.sum() - 4, 1)
    weight = weight / (1 + (misfit / _FITS) ** 2)
    # A turn moves all places after it, and the point is seen from these; counted from the track's first frame.
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
    """Equations of turns that are as odometry has them, of the first heading, and of the bias."""
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
    """Standard error of the bias: formal, or by what it is without each group of tracks, if that is larger."""
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
