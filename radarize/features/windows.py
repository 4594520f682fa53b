"""What a network sees of a stream: windows of its maps.

Networks know the frame rate they were trained at; a radar whose frames come twice as often shows them every second one.
"""

from collections.abc import Sequence
from pathlib import Path

import torch
from jaxtyping import Bool, Complex64, Float

from radarize.nets.weights import load, shipped
from radarize.training.maps import FLOOR, MapMaker


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
        self.stride = self.header.stride(maker.heatmaps.config)
        self._maker = maker
        self._past: torch.Tensor | None = None

    def push(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"], spacings: Sequence[int] = (1,)
    ) -> list[Float[torch.Tensor, "frame window map row azimuth"]]:
        """Windows that end at the next frames, for each spacing (frames of the network's) between their frames.

        Before the stream began everything looked as in its first frame.
        """
        made = self._maker.of(spectrum, self.header.maps)
        new = torch.stack([torch.from_numpy(made[name]) for name in self.header.maps], dim=1).float()
        reach = (self.header.frames - 1) * self.stride * max(self.header.spacings)
        past = new[:1].expand(reach, -1, -1, -1) if self._past is None else self._past
        everything = torch.cat([past, new])
        self._past = everything[len(everything) - reach :]
        newest = torch.arange(reach, reach + len(new))[:, None]
        back = torch.arange(self.header.frames - 1, -1, -1) * self.stride
        return [everything[newest - back * spacing] for spacing in spacings]


def silent(windows: Float[torch.Tensor, "frame window map row azimuth"]) -> Bool[torch.Tensor, "frame"]:
    """Windows of which a frame shows nothing at all: networks were not trained to say that they know nothing."""
    return (windows <= FLOOR).flatten(2).all(dim=2).any(dim=1)
