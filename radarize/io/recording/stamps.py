"""Stamps of a recording's frames, some of which may be damaged.

A stamp is damaged if it is not a number, or out of order with most others. It is interpolated from the stamps around it
if these show that no frame is missing between them; otherwise its frame is left out.
"""

from bisect import bisect_left
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

#: s, largest stamp, for stamps that count from 1970 too.
_LATEST = 1e11
#: s, and number of usual steps: a first or last stamp farther than both from all others is damaged.
_FAR, _STEPS = 10.0, 100
#: Number of searches for such stamps at either end.
_ROUNDS = 3


@dataclass
class Stamps:
    """Ascending stamps of frames.

    Args:
        written: stamps in the file, s.
        period: configured frame period, s.

    Attributes:
        times: (frame,) s, ascending.
        rows: (frame,) rows of the file with these frames, ascending.
        corrected: rows whose stamps are interpolated.
        left_out: rows without a frame, since no stamp can be determined.
    """

    written: Float[np.ndarray, "row"]
    period: float
    times: Float[np.ndarray, "frame"] = field(init=False)
    rows: Int[np.ndarray, "frame"] = field(init=False)
    corrected: Int[np.ndarray, "corrected"] = field(init=False)
    left_out: Int[np.ndarray, "left"] = field(init=False)

    def __post_init__(self):
        good = _trusted(self.written)
        if good.all():
            self.times, made = self.written, good
        else:
            self.times, made = _filled(self.written, good, self.period)
        self.rows = np.flatnonzero(made)
        self.times = self.times[self.rows]
        self.corrected, self.left_out = np.flatnonzero(made & ~good), np.flatnonzero(~made)

    def keep(self, rows: Bool[np.ndarray, "frame"]) -> None:
        """Leave out further frames."""
        self.left_out = np.union1d(self.left_out, self.rows[~rows])
        self.times, self.rows = self.times[rows], self.rows[rows]
        self.corrected = np.intersect1d(self.corrected, self.rows)

    def warnings(self) -> list[str]:
        """Return a sentence on damaged stamps, if there are any."""
        damaged = len(self.corrected) + len(self.left_out)
        if not damaged:
            return []
        found = [f"{len(self.corrected)} are interpolated by the frame period"] if len(self.corrected) else []
        found += [f"{len(self.left_out)} frames are left out"] if len(self.left_out) else []
        return [f"{damaged} of {len(self.written)} stamps in /radar/time are damaged: {', '.join(found)}"]


def _trusted(stamps: Float[np.ndarray, "row"]) -> Bool[np.ndarray, "row"]:
    """Return the largest set of ascending stamps, without a first or last one that is far from all others."""
    possible = np.isfinite(stamps) & (np.abs(np.nan_to_num(stamps)) <= _LATEST)
    for _ in range(_ROUNDS):
        rows = np.flatnonzero(possible)
        if (np.diff(stamps[rows]) <= 0).any():
            rows = rows[_ascending(stamps[rows])]
        if len(rows) < 3:
            break
        steps = np.diff(stamps[rows])
        near = steps[[0, -1]] <= max(_FAR, _STEPS * float(np.median(steps)))
        if near.all():
            break
        possible[rows[[0, -1]]] = near
    good = np.zeros(len(stamps), bool)
    good[rows] = True
    return good & possible


def _ascending(values: Float[np.ndarray, "value"]) -> list[int]:
    """Return indices of the longest strictly ascending subsequence; the first of equal values (patience sorting)."""
    lowest: list[float] = []  # last values of the subsequences of each length
    last: list[int] = []
    before = np.full(len(values), -1)
    for k, value in enumerate(values.tolist()):
        length = bisect_left(lowest, value)
        if length == len(lowest):
            lowest.append(value)
            last.append(k)
        elif value < lowest[length]:
            lowest[length], last[length] = value, k
        before[k] = last[length - 1] if length and last[length] == k else before[k]
    found, k = [], last[-1] if last else -1
    while k >= 0:
        found.append(k)
        k = int(before[k])
    return found[::-1]


def _filled(
    stamps: Float[np.ndarray, "row"], good: Bool[np.ndarray, "row"], period: float
) -> tuple[Float[np.ndarray, "row"], Bool[np.ndarray, "row"]]:
    """Return stamps with damaged ones interpolated, and which of them are usable."""
    rows, times, made = np.flatnonzero(good), stamps.copy(), good.copy()
    if not len(rows):
        return period * np.arange(len(stamps)), np.ones(len(stamps), bool)
    counts = np.diff(rows)
    step = float(np.median(np.diff(stamps[rows]) / counts)) if len(rows) > 2 else period
    for first, count in zip(rows[:-1][counts > 1], counts[counts > 1], strict=True):
        between = stamps[first + count] - stamps[first]
        if abs(between - count * step) < step / 2:  # no frame is missing
            times[first : first + count] = stamps[first] + between * np.arange(count) / count
            made[first : first + count] = True
    ends = np.r_[0 : rows[0], rows[-1] + 1 : len(stamps)]
    nearest = np.where(ends < rows[0], rows[0], rows[-1])
    times[ends], made[ends] = stamps[nearest] + step * (ends - nearest), True
    return times, made
