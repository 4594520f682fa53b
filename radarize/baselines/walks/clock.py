"""Which picture of a real walk's lidar is of the same instant as one of its radar's.

RadarHD's data set numbers both from 0 on, and its measures compare those of one number. But over the same time the
lidar has more of them: 2 to 3 % in the building of the training, 5 to 8 % in another. Pictures of one number are up to
2.5 s apart: at the start the lidar's is later, at the end the radar's.

Both see the same surfaces. So each picture of the radar is correlated with pictures of the lidar some frames before and
after it, and the line on which they are most alike, over the whole walk, tells both clocks. Nothing else is used: no
poses, no network.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter

from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.signal import polar

#: Frames by which pictures may be apart, and by which their distance may grow per frame.
APART, _DRIFTS = 100, np.arange(-0.15, 0.1501, 0.0025)
#: Rows that are averaged, and deviations (frames, rows, columns) of the Gaussian that smooths what is left, so that
#: neither a bearing's error nor the speckle of an echo decides. Turns by the network are then off by 0.42 deg on 24
#: training walks, by 0.45 with three fifths of the Gaussian, and by 0.66 as numbered.
_POOLED, _SMOOTH = 4, (0.0, 1.0, 1.5)
#: Rows by which the radar reads farther: 0.17 to 0.34 m.
_FARTHER = 6
#: Correlation on the line from which on it is believed. Moving walks have 0.29 to 0.36; noise has 0.03.
_ALIKE = 0.15
#: Frames of the alternating parts of a walk that are two halves of it, and frames that a walk must have.
_PART, _LEAST = 100, 300
#: Share of the frames that a line must meet.
_MET = 0.6

Pooled = Float[np.ndarray, "frame cell"]
Alike = Float[np.ndarray, "shift frame"]


@dataclass(frozen=True)
class Clock:
    """The lidar's frame that is of the same instant as one of the radar's.

    Attributes:
        first: for the radar's frame 0.
        rate: frames of the lidar per frame of the radar.
        alike: mean correlation of pictures on this line.
        paired: that of pictures with the same number.
        doubt: frames by which the lines of two halves of the walk are apart, at most.
    """

    first: float = 0.0
    rate: float = 1.0
    alike: float = np.nan
    paired: float = np.nan
    doubt: float = np.nan

    @classmethod
    def of(cls, walk: Walk, progress: Callable[[int, int], None] = lambda done, total: None) -> "Clock":
        """That of a walk; as it is numbered where its pictures do not tell, for nothing moved or it is too short."""
        return cls.along(alike(walk, progress))

    @classmethod
    def along(cls, known: Alike) -> "Clock":
        """The line on which a walk's pictures are most alike."""
        frames = known.shape[1]
        if frames < _LEAST:
            return cls()
        drift, late, best = _line(known)
        paired, middle = float(np.nanmean(known[APART])), (frames - 1) / 2
        if not best > _ALIKE:
            return cls(alike=best, paired=paired)
        odd = np.arange(frames) // _PART % 2 == 1
        halves = [_line(np.where(kept, known, np.nan)) for kept in (odd, ~odd)]
        ends = np.array([[late - drift * middle, late + drift * middle] for drift, late, _ in halves])
        return cls(late - drift * middle, 1 + drift, best, paired, float(np.ptp(ends, axis=0).max()))

    @property
    def told(self) -> bool:
        """Whether pictures tell it."""
        return bool(np.isfinite(self.doubt))

    def lidar(self, frame: Float[np.ndarray, "frame"] | Int[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """The lidar's frames, between whole numbers, at those of the radar."""
        return self.first + self.rate * frame

    def radar(self, frame: Float[np.ndarray, "frame"] | Int[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """The radar's frames, between whole numbers, at those of the lidar."""
        return (frame - self.first) / self.rate

    def partners(self, frames: int) -> Int[np.ndarray, "frame"]:
        """Of a walk, the lidar's frame that is nearest to each of the radar's in time; -1: it has none."""
        found = np.rint(self.lidar(np.arange(frames))).astype(int)
        return np.where((found >= 0) & (found < frames), found, -1)

    def late(self, frames: int) -> tuple[float, float]:
        """s by which the lidar's picture of a number is later than the radar's, at a walk's start and end."""
        ends = np.array([0, frames - 1])
        start, end = PERIOD * (ends - self.lidar(ends))
        return float(start), float(end)

    def row(self, frames: int) -> dict[str, float]:
        """What tables say of a walk's clocks."""
        start, end = self.late(frames)
        return {
            "start_s": start,
            "end_s": end,
            "alike by number": self.paired,
            "alike by instant": self.alike,
            "halves differ_s": PERIOD * self.doubt,
        }


def alike(walk: Walk, progress: Callable[[int, int], None] = lambda done, total: None) -> Alike:
    """Correlation of each picture of the radar with that of the lidar `APART` frames before it, and so on until as many
    after it; nan: there is none."""
    radar, lidar = _pictures(walk, progress)
    frames = len(radar)
    found = np.full((2 * APART + 1, frames), np.nan, np.float32)
    for row, shift in enumerate(range(-APART, APART + 1)):
        some = np.arange(max(0, -shift), min(frames, frames - shift))
        found[row, some] = np.einsum("ij,ij->i", radar[some], lidar[some + shift])
    return found


def _pictures(walk: Walk, progress: Callable[[int, int], None]) -> tuple[Pooled, Pooled]:
    """What changes in the radar's pictures, and in the lidar's, frame by frame; unit vectors."""
    radar, lidar = (np.empty((walk.frames, polar.ROWS // _POOLED, polar.COLUMNS), np.float32) for _ in range(2))
    for frame in range(walk.frames):
        radar[frame] = _pooled(walk.radar(frame).astype(np.float32))
        seen = walk.lidar(frame).reshape(polar.ROWS, polar.COLUMNS, -1).any(axis=2)
        lidar[frame] = _pooled(np.roll(seen, _FARTHER, axis=0).astype(np.float32))
        progress(frame + 1, walk.frames)
    return _changes(radar), _changes(lidar)


def _pooled(picture: Float[np.ndarray, "range azimuth"]) -> Float[np.ndarray, "row azimuth"]:
    return picture.reshape(-1, _POOLED, picture.shape[1]).mean(axis=1)


def _changes(pictures: Float[np.ndarray, "frame row column"]) -> Pooled:
    pictures = gaussian_filter(pictures, _SMOOTH)
    found = (pictures - pictures.mean(axis=0)).reshape(len(pictures), -1)
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-9)


def _line(known: Alike) -> tuple[float, float, float]:
    """Drift (frames per frame), lateness in the middle (frames), and mean of the line on which it is largest; nan: no
    line meets enough."""
    rows, frames = known.shape
    padded = np.full((3 * rows, frames), np.nan, np.float32)
    padded[rows : 2 * rows] = known
    wanted = _MET * np.isfinite(known[APART]).sum()
    best = (0.0, 0.0, np.nan)
    for drift in _DRIFTS:
        along = np.rint(drift * (np.arange(frames) - (frames - 1) / 2)).astype(int)
        row = (rows + np.arange(rows)[:, None] + along).clip(0, len(padded) - 1)
        values = padded[row, np.arange(frames)]
        met = np.isfinite(values).sum(axis=1)
        mean = np.nansum(values, axis=1) / np.maximum(met, 1)
        mean[met < wanted] = -np.inf
        top = int(mean.argmax())
        if np.isfinite(mean[top]) and not mean[top] <= best[2]:
            best = (float(drift), float(top - APART), float(mean[top]))
    return best
