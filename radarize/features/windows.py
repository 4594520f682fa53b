"""Windows of a stream: the maps of a frame and of some before it, as networks see them.

Networks know the time between their frames from training, not from what they see: a radar whose frames come twice as
often shows them every second one, and where frames are lost, they see no window that spans the gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float16, Int


@dataclass(frozen=True)
class Shown:
    """Windows of one spacing that end at consecutive frames.

    Attributes:
        maps: (frame, window, map, row, azimuth); a frame that is not there looks as the one after the gap, or as the
            stream's first.
        whole: (frame,) every frame of the window is there.
        back: (frame,) frames from the window's first to its last; of no meaning unless it is whole.
    """

    maps: Float[torch.Tensor, "frame window map row azimuth"]
    whole: Bool[np.ndarray, "frame"]
    back: Int[np.ndarray, "frame"]


class Windows:
    """Windows that end at the frames of a stream.

    Args:
        maps: names of a frame's.
        frames: of a window.
        stride: the radar's frames from one of the network's to the next.
        period: s, from one of the radar's frames to the next.
        spacing: most frames of the network's from one of a window to the next.
    """

    def __init__(self, maps: Sequence[str], frames: int, stride: int, period: float, spacing: int = 1):
        self.maps, self.frames, self.stride = tuple(maps), frames, stride
        self._period, self._reach = period, (frames - 1) * stride * spacing
        self._past: torch.Tensor | None = None
        self._stamps = np.zeros(0)  # of the past frames

    def push(
        self,
        made: Mapping[str, Float16[np.ndarray, "frame row azimuth"]],
        stamps: Float[np.ndarray, "frame"],
        spacings: Sequence[int] = (1,),
    ) -> list[Shown]:
        """Windows that end at the next frames, by their maps and stamps (s), for each spacing (frames of the network's)
        between their frames."""
        new = torch.stack([torch.from_numpy(made[name]) for name in self.maps], dim=1).float()
        frames = new if self._past is None else torch.cat([self._past, new])
        stamps = np.concatenate([self._stamps, stamps])
        found = []
        for spacing in spacings:
            apart = spacing * self.stride * self._period
            rows, there = spaced(stamps, len(new), self.frames, apart, self._period)
            found.append(Shown(frames[torch.from_numpy(rows)], there.all(axis=1), rows[:, -1] - rows[:, 0]))
        kept = max(len(frames) - self._reach, 0)
        self._past, self._stamps = frames[kept:], stamps[kept:]
        return found


def spaced(
    stamps: Float[np.ndarray, "frame"], new: int, frames: int, apart: float, period: float
) -> tuple[Int[np.ndarray, "new window"], Bool[np.ndarray, "new window"]]:
    """Windows of so many frames, `apart` seconds from one to the next, that end at each of the `new` last ones.

    Returns:
        Rows, of a frame that is not there that of the one after the gap; and which are there, give or take half of the
        radar's frame period.
    """
    wanted = stamps[len(stamps) - new :, None] - apart * np.arange(frames - 1, -1, -1)
    rows = np.searchsorted(stamps, wanted - period / 2)
    return rows, stamps[rows] < wanted + period / 2
