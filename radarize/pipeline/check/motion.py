"""Motion of the radar for the tests of a check: velocity and yaw rate at some places of a recording."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from radarize.pipeline.check.planewaves import PlaneWaves
from radarize.pipeline.check.tracks import Tracks
from radarize.signal.snapshots import Snapshots

#: Minimum purity of cells; m/s, residual up to which an echo agrees with a velocity; agreeing echoes; pairs for a turn.
_PURE, _OFF, _AGREE, _PAIRS = 0.8, 0.12, 8, 6
#: Pairs of echoes that RANSAC tries.
_TRIED = 150


class Motions(NamedTuple):
    """Motion at each place; unknown values are nan.

    Attributes:
        time: s, time of each place.
        velocity: m/s, in the sensor's frame: forward, left, up.
        turn: rad/s, yaw rate, positive to the left.
    """

    time: Float[np.ndarray, "place"]
    velocity: Float[np.ndarray, "place 3"]
    turn: Float[np.ndarray, "place"]


def find_motions(cells: Snapshots, waves: PlaneWaves, tracks: Tracks, times: Float[np.ndarray, "frame"]) -> Motions:
    """Estimate the motion in each run of consecutive frames.

    Velocity comes from RANSAC and least squares over closing speeds v . u, yaw rate from changes of bearings beyond
    parallax.
    """
    frames = np.unique(cells.frame)
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1) if len(frames) else []
    rng, found = np.random.default_rng(0), []
    for run in runs:
        here = np.isin(cells.frame, run) & (waves.purity > _PURE)
        velocity = _velocity(waves.direction[here], cells.speed[here], rng)
        turn = _turn(tracks, run, times, velocity)
        found.append((float(times[run].mean()), velocity, turn))
    if not found:
        return Motions(np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    time, velocity, turn = zip(*found, strict=True)
    return Motions(np.array(time), np.array(velocity), np.array(turn))


def _velocity(directions: np.ndarray, speeds: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    unknown = np.full(3, np.nan)
    if len(speeds) < _AGREE:
        return unknown
    up = np.clip(directions[:, 1], -0.6, 0.6)
    ahead = np.sqrt(np.maximum(1 - directions[:, 0] ** 2 - up**2, 0.02))
    u = np.stack([ahead, directions[:, 0], up], axis=1)
    pairs = rng.integers(0, len(u), (_TRIED, 2))
    matrices = u[pairs][:, :, :2]
    matrices = matrices[np.abs(np.linalg.det(matrices)) > 0.15]
    rows = pairs[np.abs(np.linalg.det(u[pairs][:, :, :2])) > 0.15]
    if not len(rows):
        return unknown
    tried = np.linalg.solve(matrices, speeds[rows][..., None])[..., 0]
    agree = np.abs(speeds - tried @ u[:, :2].T) < _OFF
    best = agree[agree.sum(axis=1).argmax()]
    for _ in range(3):
        if best.sum() < _AGREE:
            return unknown
        normal = u[best].T @ u[best] + np.diag([1e-3, 1e-3, 1.0])
        velocity = np.linalg.solve(normal, u[best].T @ speeds[best])
        best = np.abs(speeds - u @ velocity) < _OFF
    return velocity


def _turn(tracks: Tracks, run: np.ndarray, times: np.ndarray, velocity: np.ndarray) -> float:
    inside = tracks.pure & np.isin(tracks.first, run) & np.isin(tracks.second, run) & (tracks.second - tracks.first > 1)
    passed = times[tracks.second] - times[tracks.first]
    closer = np.abs(tracks.nearer - tracks.speed * passed) < 0.03
    inside &= closer & (np.abs(tracks.bearings) < 0.8).all(axis=1)
    if inside.sum() < _PAIRS or np.isnan(velocity).any():
        return np.nan
    first, second = np.arcsin(tracks.bearings[inside]).T
    middle = (first + second) / 2
    across = velocity[1] * np.cos(middle) - velocity[0] * np.sin(middle)
    parallax = -across / np.maximum(tracks.range[inside], 0.3) * passed[inside]
    return float(-np.median((second - first - parallax) / passed[inside]))
