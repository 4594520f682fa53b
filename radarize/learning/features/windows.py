"""Windows of a stream: the maps of a frame and of frames before it, as network input.

Networks learn the time between frames, and the meaning of a map's rows, in training. A radar with twice the frame rate
therefore supplies every second frame, maps are resampled to the network's grid, and no window spans a gap of lost
frames.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float16, Int

from radarize.learning.features.grid import Resampling

#: Maps of frames, by name.
Made = Mapping[str, Float16[np.ndarray, "frame row azimuth"]]


@dataclass(frozen=True)
class Shown:
    """Windows of one spacing that end at consecutive frames.

    Attributes:
        maps: (frame, window, map, row, azimuth); a missing frame is replaced by the one after the gap, or by the first
            one of the stream.
        whole: (frame,) whether all frames of the window are present.
        back: (frame,) number of frames from the window's first to its last; valid if the window is whole.
    """

    maps: Float[torch.Tensor, "frame window map row azimuth"]
    whole: Bool[np.ndarray, "frame"]
    back: Int[np.ndarray, "frame"]


class Windows:
    """Windows that end at the frames of a stream.

    Args:
        maps: names of a frame's maps.
        frames: number of frames of a window.
        period: frame period of the radar, s.
        spacings: spacings between frames of a window, in frames of the radar, ascending.
        resampling: from the radar's maps to the network's grid; None if they have the same.
    """

    def __init__(
        self,
        maps: Sequence[str],
        frames: int,
        period: float,
        spacings: Sequence[int] = (1,),
        resampling: Resampling | None = None,
    ):
        self.maps, self.frames, self.spacings = tuple(maps), frames, tuple(spacings)
        self._period, self._resampling = period, resampling
        self._reach = (frames - 1) * self.spacings[-1]
        self._past: torch.Tensor | None = None
        self._stamps = np.zeros(0)  # of the past frames
        self._waiting: list[tuple[Callable[[], Made], np.ndarray]] = []  # frames after these, not yet made

    def announce(self, make: Callable[[], Made], stamps: Float[np.ndarray, "frame"]) -> None:
        """Add the next frames; their maps are computed only if a requested window includes them."""
        self._waiting.append((make, stamps))
        while len(self._waiting) > 1 and sum(len(past) for _, past in self._waiting[1:-1]) >= self._reach:
            del self._waiting[0]

    def wanted(self) -> list[Shown]:
        """Return the windows that end at the frames announced last, see `push`."""
        waiting, self._waiting = self._waiting, []
        return [self.push(make(), stamps) for make, stamps in waiting][-1]

    def push(self, made: Made, stamps: Float[np.ndarray, "frame"]) -> list[Shown]:
        """Return the windows that end at the next frames, given by maps and stamps (s), for each spacing."""
        new = torch.stack([torch.from_numpy(made[name]) for name in self.maps], dim=1).float()
        if self._resampling is not None:
            new = self._resampling(new)
        frames = new if self._past is None else torch.cat([self._past, new])
        stamps = np.concatenate([self._stamps, stamps])
        found = []
        for spacing in self.spacings:
            rows, there = spaced(stamps, len(new), self.frames, spacing * self._period, self._period)
            found.append(Shown(frames[torch.from_numpy(rows)], np.all(there, axis=1), rows[:, -1] - rows[:, 0]))
        kept = max(len(frames) - self._reach, 0)
        self._past, self._stamps = frames[kept:], stamps[kept:]
        return found


def spaced(
    stamps: Float[np.ndarray, "frame"], new: int, frames: int, apart: float, period: float
) -> tuple[Int[np.ndarray, "new window"], Bool[np.ndarray, "new window"]]:
    """Return windows of `frames` frames, `apart` seconds between them, that end at each of the `new` last ones.

    Returns:
        Row of each frame, for a missing frame that of the one after the gap; and which frames are present, within half
        of the radar's frame period.
    """
    wanted = stamps[len(stamps) - new :, None] - apart * np.arange(frames - 1, -1, -1)
    rows = np.searchsorted(stamps, wanted - period / 2)
    return rows, stamps[rows] < wanted + period / 2
