"""What a network sees of a stream: windows of its maps.

Networks know the time between their frames from training, not from what they see: a radar whose frames come twice as
often shows them every second one, and where frames are lost, they see no window that spans the gap.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Int

from radarize.nets.weights import load, shipped
from radarize.training.maps import MapMaker


@dataclass(frozen=True)
class Shown:
    """Windows of one spacing that end at consecutive frames.

    Attributes:
        maps: (frame, window, map, row, azimuth); a frame that is not there looks as the one after the gap, or as
            the stream's first.
        whole: (frame,) every frame of the window is there.
        back: (frame,) frames from the window's first to its last; of no meaning unless it is whole.
    """

    maps: Float[torch.Tensor, "frame window map row azimuth"]
    whole: Bool[np.ndarray, "frame"]
    back: Int[np.ndarray, "frame"]


class Windows:
    """A network of one kind, fed with windows of a stream's frames.

    Args:
        maker: makes the maps; estimators that share it share the maps.
        kind: of the network.
        weights: file; the shipped ones if None.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, maker: MapMaker, kind: str, weights: Path | None = None):
        self.net, self.header = load(weights or shipped(kind), maker.heatmaps.config)
        self._maker, config = maker, maker.heatmaps.config
        self.stride, self._period = self.header.stride(config), config.frame_period
        self._past: torch.Tensor | None = None
        self._times = np.zeros(0)  # of the past frames

    def push(
        self,
        spectrum: Complex64[torch.Tensor, "frame range doppler antenna"],
        times: Float[np.ndarray, "frame"] | None = None,
        spacings: Sequence[int] = (1,),
    ) -> list[Shown]:
        """Windows that end at the next frames, for each spacing (frames of the network's) between their frames.

        Args:
            spectrum: of the frames.
            times: their stamps or burst centres, s; None: they come one period after another.
            spacings: see above.
        """
        if times is None:
            times = (self._times[-1] if len(self._times) else 0.0) + self._period * np.arange(1, len(spectrum) + 1)
        made = self._maker.of(spectrum, self.header.maps)
        new = torch.stack([torch.from_numpy(made[name]) for name in self.header.maps], dim=1).float()
        frames = new if self._past is None else torch.cat([self._past, new])
        stamps = np.concatenate([self._times, times])
        shown = [self._windows(frames, stamps, len(new), spacing * self.stride) for spacing in spacings]
        reach = (self.header.frames - 1) * self.stride * max(self.header.spacings)
        kept = max(len(frames) - reach, 0)
        self._past, self._times = frames[kept:], stamps[kept:]
        return shown

    def _windows(self, frames: torch.Tensor, stamps: np.ndarray, new: int, apart: int) -> Shown:
        """Windows whose frames are `apart` of the radar's frame periods apart."""
        rows, there = spaced(stamps, new, self.header.frames, apart * self._period, self._period)
        return Shown(frames[torch.from_numpy(rows)], there.all(axis=1), rows[:, -1] - rows[:, 0])


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
