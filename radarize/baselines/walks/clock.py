"""Clock offset and rate between the radar and the lidar of a real walk, estimated from their pictures.

RadarHD's data set counts the frames of both sensors from 0, and its metrics compare frames of equal index. The lidar
has more frames in the same time: 2 to 3 % more in the building of the training walks, 5 to 8 % in another building.
Frames of equal index are up to 2.5 s apart: the lidar's is later at the start of a walk, the radar's at the end.

Both sensors see the same surfaces. Each picture of the radar is correlated with the lidar's pictures of up to
`MAX_SHIFT` frames before and after it; the straight line of largest mean correlation over the whole walk gives offset
and rate. Neither poses nor networks are used.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter

from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.signal import polar

#: Maximum shift between frames of equal time, frames; rates of its change that are tried, frames per frame.
MAX_SHIFT, _DRIFTS = 100, np.arange(-0.15, 0.1501, 0.0025)
#: Number of range rows that are averaged; standard deviations (frames, rows, columns) of the Gaussian that then smooths
#: bearing errors and speckle. With it, changes of yaw by the network have an RMSE of 0.42 deg on 24 training walks;
#: with three fifths of these widths 0.45 deg, and matched by frame index 0.66 deg.
_POOLED, _SMOOTH = 4, (0.0, 1.0, 1.5)
#: Rows by which the radar's ranges are longer than the lidar's: 0.17 to 0.34 m.
_FARTHER = 6
#: Minimum mean correlation on an accepted line. Walks with motion have 0.29 to 0.36; noise has 0.03.
_LEAST_CORRELATION = 0.15
#: Length of the alternating parts that make the two halves of a walk, and minimum length of a walk, frames.
_PART, _LEAST = 100, 300
#: Minimum share of the frames that a line has to cover.
_MET = 0.6

Pooled = Float[np.ndarray, "frame cell"]
PictureCorrelation = Float[np.ndarray, "shift frame"]


@dataclass(frozen=True)
class Clock:
    """Linear map from frames of the radar to frames of the lidar of the same time.

    Attributes:
        first: lidar frame at the time of the radar's frame 0.
        rate: lidar frames per radar frame.
        correlation: mean correlation of pictures matched by time.
        correlation_by_index: mean correlation of pictures matched by frame index.
        halves_differ: largest difference between the maps of the two halves of the walk, frames; NaN if not estimated.
    """

    first: float = 0.0
    rate: float = 1.0
    correlation: float = np.nan
    correlation_by_index: float = np.nan
    halves_differ: float = np.nan

    @classmethod
    def of(cls, walk: Walk, progress: Callable[[int, int], None] = lambda done, total: None) -> "Clock":
        """Estimate the clock of a walk. Frames are matched by index if the walk is too short or without motion."""
        return cls.fit(picture_correlation(walk, progress))

    @classmethod
    def fit(cls, known: PictureCorrelation) -> "Clock":
        """Fit the line of largest mean correlation."""
        frames = known.shape[1]
        if frames < _LEAST:
            return cls()
        drift, late, best = _line(known)
        by_index, middle = float(np.nanmean(known[MAX_SHIFT])), (frames - 1) / 2
        if not best > _LEAST_CORRELATION:
            return cls(correlation=best, correlation_by_index=by_index)
        odd = np.arange(frames) // _PART % 2 == 1
        halves = [_line(np.where(kept, known, np.nan)) for kept in (odd, ~odd)]
        ends = np.array([[late - drift * middle, late + drift * middle] for drift, late, _ in halves])
        return cls(late - drift * middle, 1 + drift, best, by_index, float(np.ptp(ends, axis=0).max()))

    @property
    def estimated(self) -> bool:
        """Whether the clock was estimated from the pictures; else frames are matched by index."""
        return bool(np.isfinite(self.halves_differ))

    def lidar(self, frame: Float[np.ndarray, "frame"] | Int[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """Convert frames of the radar to fractional frames of the lidar."""
        return self.first + self.rate * frame

    def radar(self, frame: Float[np.ndarray, "frame"] | Int[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """Convert frames of the lidar to fractional frames of the radar."""
        return (frame - self.first) / self.rate

    def partners(self, frames: int) -> Int[np.ndarray, "frame"]:
        """Return the lidar frame nearest in time to each radar frame of a walk; -1 if the lidar has none."""
        found = np.rint(self.lidar(np.arange(frames))).astype(int)
        return np.where((found >= 0) & (found < frames), found, -1)

    def late(self, frames: int) -> tuple[float, float]:
        """Return the delay of the lidar against the radar at equal frame index, at start and end of a walk, s."""
        ends = np.array([0, frames - 1])
        start, end = PERIOD * (ends - self.lidar(ends))
        return float(start), float(end)

    def row(self, frames: int) -> dict[str, float]:
        """Return the row of the table of clocks."""
        start, end = self.late(frames)
        return {
            "start_s": start,
            "end_s": end,
            "correlation, by frame index": self.correlation_by_index,
            "correlation, by time": self.correlation,
            "halves differ_s": PERIOD * self.halves_differ,
        }


def picture_correlation(
    walk: Walk, progress: Callable[[int, int], None] = lambda done, total: None
) -> PictureCorrelation:
    """Return the correlation of each radar picture with the lidar pictures from `MAX_SHIFT` frames before it to
    `MAX_SHIFT` frames after it; NaN where there is no such picture."""
    radar, lidar = _pictures(walk, progress)
    frames = len(radar)
    found = np.full((2 * MAX_SHIFT + 1, frames), np.nan, np.float32)
    for row, shift in enumerate(range(-MAX_SHIFT, MAX_SHIFT + 1)):
        some = np.arange(max(0, -shift), min(frames, frames - shift))
        found[row, some] = np.einsum("ij,ij->i", radar[some], lidar[some + shift])
    return found


def _pictures(walk: Walk, progress: Callable[[int, int], None]) -> tuple[Pooled, Pooled]:
    """Return the smoothed pictures of radar and lidar without their means over the walk, as unit vectors per frame."""
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


def _line(known: PictureCorrelation) -> tuple[float, float, float]:
    """Find the line of largest mean correlation: drift (frames per frame), shift in the middle of the walk (frames),
    and mean correlation; NaN if no line covers enough frames."""
    rows, frames = known.shape
    padded = np.full((3 * rows, frames), np.nan, np.float32)
    padded[rows : 2 * rows] = known
    wanted = _MET * np.isfinite(known[MAX_SHIFT]).sum()
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
            best = (float(drift), float(top - MAX_SHIFT), float(mean[top]))
    return best
