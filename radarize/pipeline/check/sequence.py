"""Faults of the frames' order: repeated, shuffled, reversed, cut and rejoined.

Consecutive frames look alike, the more the fewer frames lie between them: at a walking pace, the correlation of
logarithmic power over range and beams is 0.8 to 0.95 from one frame to the next and below 0.5 five frames on.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float, Int

from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.finding import Correction, Finding, NotObservable
from radarize.pipeline.check.levels import sureness
from radarize.pipeline.check.tracks import range_rate_factor

#: Frames that are needed; frames either side among which each looks for those that are most like it.
_FRAMES, _AROUND = 20, 8
#: By how much correlation must fall from the next frame to the one three on, for order to show.
_FALLS = 0.08
#: Share of frames whose two likest are not the next ones, from which on frames are shuffled.
_SHUFFLED = 0.25
#: Frames that are sorted, at most: what it takes grows with their square.
_SORTED = 5000
#: Correlation with the frame before below which the radar has jumped, if it is less by so much than that around.
_JUMP, _LESS = 0.5, 0.25


def repeated(evidence: Evidence) -> Iterator[Finding]:
    """Samples of a frame come again."""
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
            "frames frozen", f"{frozen} of {len(digest)} frames hold the samples of the frame before", 1.0,
            "look at what captured it: a buffer was not filled in time; leave these frames out",
            Correction(order=order), hides=True,
        )  # fmt: skip
    if copied:
        start = evidence.times[np.flatnonzero(again & ~before)[0]] - evidence.times[0]
        yield Finding(
            "frames repeated", f"{copied} of {len(digest)} frames hold samples of earlier ones, from {start:.1f} s on",
            1.0,
            "look at what made the file: a part was written twice; leave these frames out",
            None if frozen else Correction(order=order), hides=not frozen,
        )  # fmt: skip


def shuffled(evidence: Evidence) -> Iterator[Finding]:
    """Frames are most like others than their neighbours."""
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
            "frames shuffled", f"{share:.0%} of the frames are most like others than the ones next to them",
            sureness(share, _SHUFFLED), "look at what made the file: frames were not sorted by their number",
            correction, hides=True,
        )  # fmt: skip


def _forward(evidence: Evidence, order: np.ndarray) -> np.ndarray:
    """The order or its reverse, whichever has ranges fall where Doppler says so."""
    try:
        factor = range_rate_factor(
            evidence.corrected(Correction(order=order, keeps_stamps=True)).tracks, evidence.times
        )
    except NotObservable:
        return order
    return order[::-1] if factor.value < 0 else order


def reversed_(evidence: Evidence) -> Iterator[Finding]:
    """Echoes that close by their Doppler shift get farther from frame to frame."""
    factor = range_rate_factor(evidence.tracks, evidence.times)
    if factor.value < 0:
        yield Finding(
            "frames reversed", f"ranges change {factor.value:.2f} +- {factor.error:.2f} times as fast as Doppler says",
            sureness(-factor.value / max(factor.error, 1e-3), 5.0), "read the frames in the other order",
            Correction(order=np.arange(len(evidence))[::-1], keeps_stamps=True), hides=True,
        )  # fmt: skip


def cuts(evidence: Evidence) -> Iterator[Finding]:
    """The radar is elsewhere from one frame to the next."""
    seen = _seen(evidence)
    likeness = _similar(evidence.sequence.looks[seen])[:-1, _AROUND]  # with the next frame
    times = evidence.times[seen]
    steps = np.diff(times)
    whole = steps < 1.5 * np.median(steps)
    around = np.minimum(np.concatenate([likeness[2:], likeness[-4:-2]]), np.concatenate([likeness[1:3], likeness[:-2]]))
    jumps = np.flatnonzero((likeness < _JUMP) & (likeness < around - _LESS) & whole)
    if len(jumps):
        deepest = float((around - likeness)[jumps].max())
        when = ", ".join(f"{times[k + 1] - evidence.times[0]:.2f}" for k in jumps[:5])
        yield Finding(
            "cut and rejoined", f"{len(jumps)} times the surroundings change from one frame to the next, at {when} s",
            sureness(deepest, _LESS), "run the parts on their own: rec[start:stop], or look for the frames between",
        )  # fmt: skip


# --- likeness ---------------------------------------------------------------------------------------------------------
def _enough(evidence: Evidence, frames: int = _FRAMES) -> None:
    if len(evidence) < frames:
        raise NotObservable(f"there are {len(evidence)} frames, {frames} are needed")


def _seen(evidence: Evidence) -> Int[np.ndarray, "seen"]:
    """Numbers of frames of which half of the chirps arrived at least."""
    _enough(evidence)
    seen = np.flatnonzero(~evidence.sequence.silent & (evidence.valid.mean(axis=(1, 2)) > 0.5))
    if len(seen) < _FRAMES:
        raise NotObservable(f"{len(seen)} frames are whole, {_FRAMES} are needed")
    return seen


def _similar(looks: np.ndarray) -> Float[np.ndarray, "frame neighbour"]:
    """Correlation with the frames up to `_AROUND` before and after; -1 beyond the ends."""
    frames = len(looks)
    found = np.full((frames, 2 * _AROUND), -1.0)
    for step in range(1, _AROUND + 1):
        alike = (looks[:-step] * looks[step:]).sum(axis=1)
        found[:-step, _AROUND + step - 1] = alike
        found[step:, _AROUND - step] = alike
    return found


def _out_of_order(likeness: np.ndarray) -> float:
    """Share of frames whose two likest are not the two next to them, of those that see the world move.

    Raises:
        NotObservable: it hardly does.
    """
    near = np.sort(likeness, axis=1)
    moving = near[:, -1] - near[:, -5] > _FALLS
    moving[:_AROUND] = moving[-_AROUND:] = False
    if moving.sum() < _FRAMES:
        raise NotObservable("consecutive frames are as alike as others: the radar hardly moves")
    next_ones = likeness[:, [_AROUND - 1, _AROUND]].min(axis=1)
    return float((next_ones < near[:, -2] - 1e-9)[moving].mean())


def _sorted(looks: np.ndarray) -> Int[np.ndarray, "frame"]:
    """Frames in the order in which each is most like the next: nearest neighbours, then the best exchanges."""
    reach, frames = 4 * _AROUND, len(looks)
    alike = looks @ looks.T
    left, path = set(range(1, frames)), [0]
    while left:
        near = [k for k in left if abs(k - len(path)) <= reach] or sorted(left)[:1]
        path.append(max(near, key=lambda k: alike[path[-1], k]))
        left.discard(path[-1])
    order = np.array(path)
    for _ in range(20):
        if not (_exchanged(order, alike) | _moved(order, alike)):
            break
    return order if np.corrcoef(order, np.arange(frames))[0, 1] >= 0 else order[::-1]


def _exchanged(order: np.ndarray, alike: np.ndarray) -> bool:
    """Reverse parts and move single frames while that makes neighbours more alike; False if nothing did."""
    changed, frames = False, len(order)
    for start in range(1, frames):
        for stop in range(start + 1, min(start + 4 * _AROUND, frames)):
            before, after = order[start - 1], order[stop] if stop < frames else -1
            first, last = order[start], order[stop - 1]
            gain = alike[before, last] - alike[before, first]
            if after >= 0:
                gain += alike[first, after] - alike[last, after]
            if gain > 1e-6:
                order[start:stop] = order[start:stop][::-1].copy()
                changed = True
    return changed


def _moved(order: np.ndarray, alike: np.ndarray) -> bool:
    """Move single frames to where they are most like both neighbours; False if none is elsewhere."""
    changed, frames = False, len(order)
    for k in range(frames):
        frame, rest = order[k], np.delete(order, k)
        here = alike[rest[:-1], frame] + alike[frame, rest[1:]] - alike[rest[:-1], rest[1:]]
        gains = np.concatenate([[alike[frame, rest[0]]], here, [alike[rest[-1], frame]]])
        best = int(gains.argmax())
        if best != k and gains[best] > gains[k] + 1e-6:
            order[:] = np.insert(rest, best, frame)
            changed = True
    return changed
