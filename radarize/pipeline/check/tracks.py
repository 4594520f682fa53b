"""Echoes that are found again in the next frames: change of range, and Doppler speed.

The range of an echo of a static world decreases by its closing speed times the time that passed. Range comes from the
beat frequency and the clock's stamps, speed from the phase between chirps: if chirps, stamps or the order of frames
differ from the configuration, the two disagree by a factor.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.check.finding import NotObservable
from radarize.pipeline.check.planewaves import PlaneWaves
from radarize.signal.snapshots import Snapshots

#: Maximum number of frames between two cells of an echo; minimum coherence of their channels; m/s and m by which they
#: may differ.
_APART, _COHERENT, _SPEED, _RANGE = 3, 0.9, 0.15, 0.3
#: m, width of a vote; factors that are tried.
_WIDTH, _FACTORS = 0.006, np.linspace(-4.0, 4.0, 1601)
#: m/s, minimum speed of echoes that vote; minimum number of pairs; minimum ratio of votes to those of the median
#: factor.
_SLOW, _PAIRS, _EXCESS = 0.1, 60, 1.5


class Tracks(NamedTuple):
    """Pairs of cells that may be the same echo.

    Attributes:
        first, second: numbers of the frames.
        nearer: m, decrease of range.
        speed: m/s, closing, mean of both.
        range: m.
        bearings: direction cosines to the left in both frames.
        pure: whether both are single plane waves.
    """

    first: Int[np.ndarray, "pair"]
    second: Int[np.ndarray, "pair"]
    nearer: Float[np.ndarray, "pair"]
    speed: Float[np.ndarray, "pair"]
    range: Float[np.ndarray, "pair"]
    bearings: Float[np.ndarray, "pair 2"]
    pure: np.ndarray


def find_tracks(cells: Snapshots, waves: PlaneWaves | None) -> Tracks:
    """Pair cells of frames up to three apart whose channels are coherent."""
    flat = cells.channels.reshape(len(cells.speed), -1)
    flat = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-30)
    frames = np.unique(cells.frame)
    members = {frame: np.flatnonzero(cells.frame == frame) for frame in frames}
    ones, others = [np.zeros(0, int)], [np.zeros(0, int)]
    for frame in frames:
        for apart in range(1, _APART + 1):
            if (later := members.get(frame + apart)) is None:
                continue
            here = members[frame]
            same = np.abs(flat[here].conj() @ flat[later].T) > _COHERENT
            same &= np.abs(cells.speed[here][:, None] - cells.speed[later]) < _SPEED
            same &= np.abs(cells.range[here][:, None] - cells.range[later]) < _RANGE
            i, j = np.nonzero(same)
            ones.append(here[i])
            others.append(later[j])
    a, b = np.concatenate(ones), np.concatenate(others)
    left = np.zeros(len(cells.speed)) if waves is None else waves.direction[:, 0]
    pure = np.zeros(len(cells.speed), bool) if waves is None else waves.purity > _COHERENT
    return Tracks(
        cells.frame[a], cells.frame[b], cells.range[a] - cells.range[b], (cells.speed[a] + cells.speed[b]) / 2,
        (cells.range[a] + cells.range[b]) / 2, np.stack([left[a], left[b]], axis=1), pure[a] & pure[b],
    )  # fmt: skip


class Factor(NamedTuple):
    """Ratio of range rate to Doppler speed, with its standard error and the votes for it."""

    value: float
    error: float
    votes: float


def range_rate_factor(tracks: Tracks, times: Float[np.ndarray, "frame"]) -> Factor:
    """Estimate the ratio of range rate to Doppler speed by vote; pairs of different echoes spread over all factors.

    Args:
        times: times of all frames, s.

    Raises:
        NotObservable: too few echoes move, or no factor stands out.
    """
    moving = np.abs(tracks.speed) > _SLOW
    if moving.sum() < _PAIRS:
        raise NotObservable(f"{moving.sum()} moving echoes are tracked, {_PAIRS} are needed")
    expected = (tracks.speed * (times[tracks.second] - times[tracks.first]))[moving]
    nearer = tracks.nearer[moving]
    votes = np.exp(-np.square((nearer - _FACTORS[:, None] * expected) / _WIDTH) / 2).sum(axis=1)
    # If nothing moves relative to the frames' step, the factor zero wins, at the level of chance.
    best = int(votes.argmax())
    if votes[best] < _EXCESS * np.median(votes):
        raise NotObservable("ranges change by no common multiple of Doppler speeds")
    value = _FACTORS[best]
    for _ in range(5):  # least squares over agreeing pairs
        off = nearer - value * expected
        weight = np.exp(-np.square(off / _WIDTH) / 2)
        value = float((weight * nearer * expected).sum() / max((weight * expected**2).sum(), 1e-30))
    off, used = nearer - value * expected, np.abs(nearer - value * expected) < 3 * _WIDTH
    scatter = float(np.sqrt(np.square(off[used]).mean() / max(np.square(expected[used]).sum(), 1e-30)))
    return Factor(value, scatter, float(votes[best]))
