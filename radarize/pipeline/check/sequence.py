"""Faults in the order of frames: repeated, shuffled, reversed, cut and rejoined.

The fewer frames lie between two frames, the more similar they are: at walking pace, the correlation of logarithmic
    power
over range and beams is 0.8 to 0.95 for neighbours and below 0.5 for frames five apart.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.pipeline.check.tracks import range_rate_factor

#: Minimum number of frames; neighbours on either side that each frame is compared with.
_FRAMES, _AROUND = 20, 8
#: Minimum decrease of correlation from the next frame to the third, needed to observe the order.
_FALLS = 0.08
#: Share of frames whose two most similar ones are not their neighbours, above which frames are shuffled.
_SHUFFLED = 0.25
#: Maximum number of frames that are sorted; time grows with their square.
_SORTED = 5000
#: The radar has jumped if the correlation with the previous frame is below this, and this much below that around it.
_JUMP, _LESS = 0.5, 0.25


def repeated(evidence: Evidence) -> Iterator[Finding]:
    """Find frames with the samples of an earlier frame."""
    _enough(evidence, 2)
    digest, silent = evidence.sequence.digest, evidence.sequence.silent
    _, first = np.unique(digest, return_index=True)
    again = np.ones(len(digest), bool)
    again[first] = False
    again &= ~silent
    if not again.any():
        return
    before = np.concatenate([[False], digest[1:] == digest[:-1]]) & again
    frozen, copied = int(before.sum()), int((again & ~before).sum())
    order = np.flatnonzero(~again)
    if frozen:
        yield Finding(
            "frames frozen", f"{frozen} of {len(digest)} frames have the samples of the previous frame", 1.0,
            "check the capture program: a buffer was not filled in time; leave these frames out",
            Correction(order=order), hides=True,
        )  # fmt: skip
    if copied:
        start = evidence.times[np.flatnonzero(again & ~before)[0]] - evidence.times[0]
        yield Finding(
            "frames repeated", f"{copied} of {len(digest)} frames have samples of earlier ones, from {start:.1f} s on",
            1.0,
            "check the program that wrote the file: it wrote a part twice; leave these frames out",
            None if frozen else Correction(order=order), hides=not frozen,
        )  # fmt: skip


def shuffled(evidence: Evidence) -> Iterator[Finding]:
    """Find frames that are more similar to others than to their neighbours."""
    seen = _seen(evidence)
    looks = evidence.sequence.looks[seen]
    share = _out_of_order(_similar(looks))
    if share > _SHUFFLED:
        correction = None
        if len(seen) <= _SORTED:
            order = seen[_sorted(looks)]
            if _out_of_order(_similar(evidence.sequence.looks[order])) < share / 4:
                correction = Correction(order=_forward(evidence, order), keeps_stamps=True)
        yield Finding(
            "frames shuffled", f"{share:.0%} of the frames are more similar to others than to their neighbours",
            sureness(share, _SHUFFLED), "check the program that wrote the file: it did not sort the frames",
            correction, hides=True,
        )  # fmt: skip


def _forward(evidence: Evidence, order: np.ndarray) -> np.ndarray:
    """Return the order or its reverse, such that ranges change with the sign that Doppler predicts."""
    try:
        factor = range_rate_factor(
            evidence.corrected(Correction(order=order, keeps_stamps=True)).tracks, evidence.times
        )
    except NotObservable:
        return order
    return order[::-1] if factor.value < 0 else order


def reversed_(evidence: Evidence) -> Iterator[Finding]:
    """Find reversed frames: echoes that approach by Doppler recede in range."""
    factor = range_rate_factor(evidence.tracks, evidence.times)
    if factor.value < 0:
        yield Finding(
            "frames reversed",
            f"ranges change {factor.value:.2f} +- {factor.error:.2f} times as fast as Doppler predicts",
            sureness(-factor.value / max(factor.error, 1e-3), 5.0), "reverse the order of the frames",
            Correction(order=np.arange(len(evidence))[::-1], keeps_stamps=True), hides=True,
        )  # fmt: skip


def cuts(evidence: Evidence) -> Iterator[Finding]:
    """Find frames between which the radar jumps to another place."""
    seen = _seen(evidence)
    similarity = _similar(evidence.sequence.looks[seen])[:-1, _AROUND]  # with the next frame
    times = evidence.times[seen]
    steps = np.diff(times)
    whole = steps < 1.5 * np.median(steps)
    around = np.minimum(
        np.concatenate([similarity[2:], similarity[-4:-2]]), np.concatenate([similarity[1:3], similarity[:-2]])
    )
    jumps = np.flatnonzero((similarity < _JUMP) & (similarity < around - _LESS) & whole)
    if len(jumps):
        deepest = float((around - similarity)[jumps].max())
        when = ", ".join(f"{times[k + 1] - evidence.times[0]:.2f}" for k in jumps[:5])
        yield Finding(
            "cut and rejoined", f"the surroundings change abruptly {len(jumps)} times, at {when} s",
            sureness(deepest, _LESS), "run the parts separately: rec[start:stop], or recover the missing frames",
        )  # fmt: skip


# --- similarity -------------------------------------------------------------------------------------------------------
def _enough(evidence: Evidence, frames: int = _FRAMES) -> None:
    if len(evidence) < frames:
        raise NotObservable(f"there are {len(evidence)} frames, {frames} are needed")


def _seen(evidence: Evidence) -> Int[np.ndarray, "seen"]:
    """Return numbers of frames of which at least half of the chirps arrived."""
    _enough(evidence)
    seen = np.flatnonzero(~evidence.sequence.silent & (evidence.valid.mean(axis=(1, 2)) > 0.5))
    if len(seen) < _FRAMES:
        raise NotObservable(f"{len(seen)} frames are complete, {_FRAMES} are needed")
    return seen


def _similar(looks: np.ndarray) -> Float[np.ndarray, "frame neighbour"]:
    """Return the correlation with the frames up to `_AROUND` before and after; -1 beyond the ends."""
    frames = len(looks)
    found = np.full((frames, 2 * _AROUND), -1.0)
    for step in range(1, _AROUND + 1):
        similarity = (looks[:-step] * looks[step:]).sum(axis=1)
        found[:-step, _AROUND + step - 1] = similarity
        found[step:, _AROUND - step] = similarity
    return found


def _out_of_order(similarity: np.ndarray) -> float:
    """Return the share of frames whose two most similar ones are not their neighbours, among frames with motion.

    Raises:
        NotObservable: the radar hardly moves.
    """
    near = np.sort(similarity, axis=1)
    moving = near[:, -1] - near[:, -5] > _FALLS
    moving[:_AROUND] = moving[-_AROUND:] = False
    if moving.sum() < _FRAMES:
        raise NotObservable("consecutive frames are as similar as others: the radar hardly moves")
    next_ones = similarity[:, [_AROUND - 1, _AROUND]].min(axis=1)
    return float((next_ones < near[:, -2] - 1e-9)[moving].mean())


def _sorted(looks: np.ndarray) -> Int[np.ndarray, "frame"]:
    """Return frames in the order of greatest similarity: nearest neighbours, then the best exchanges."""
    reach, frames = 4 * _AROUND, len(looks)
    similarity = looks @ looks.T
    left, path = set(range(1, frames)), [0]
    while left:
        near = [k for k in left if abs(k - len(path)) <= reach] or sorted(left)[:1]
        path.append(max(near, key=lambda k: similarity[path[-1], k]))
        left.discard(path[-1])
    order = np.array(path)
    for _ in range(20):
        if not (_exchanged(order, similarity) | _moved(order, similarity)):
            break
    return order if np.corrcoef(order, np.arange(frames))[0, 1] >= 0 else order[::-1]


def _exchanged(order: np.ndarray, similarity: np.ndarray) -> bool:
    """Reverse parts while that makes neighbours more similar; return whether anything changed."""
    changed, frames = False, len(order)
    for start in range(1, frames):
        for stop in range(start + 1, min(start + 4 * _AROUND, frames)):
            before, after = order[start - 1], order[stop] if stop < frames else -1
            first, last = order[start], order[stop - 1]
            gain = similarity[before, last] - similarity[before, first]
            if after >= 0:
                gain += similarity[first, after] - similarity[last, after]
            if gain > 1e-6:
                order[start:stop] = order[start:stop][::-1].copy()
                changed = True
    return changed


def _moved(order: np.ndarray, similarity: np.ndarray) -> bool:
    """Move single frames to where they are most similar to both neighbours; return whether anything changed."""
    changed, frames = False, len(order)
    for k in range(frames):
        frame, rest = order[k], np.delete(order, k)
        here = similarity[rest[:-1], frame] + similarity[frame, rest[1:]] - similarity[rest[:-1], rest[1:]]
        gains = np.concatenate([[similarity[frame, rest[0]]], here, [similarity[rest[-1], frame]]])
        best = int(gains.argmax())
        if best != k and gains[best] > gains[k] + 1e-6:
            order[:] = np.insert(rest, best, frame)
            changed = True
    return changed
