"""Windows of a stream: the maps of a frame and of some before it, as networks see them.

Networks know the frame rate they were trained at; a radar whose frames come twice as often shows them every second one.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float

from radarize.batch import Batch
from radarize.features.maps import FLOOR


class Windows:
    """Windows that end at the frames of a stream.

    Args:
        maps: names of a frame's.
        frames: of a window.
        stride: the radar's frames from one of the network's to the next.
        spacing: most frames of the network's from one of a window to the next.
    """

    def __init__(self, maps: Sequence[str], frames: int, stride: int, spacing: int = 1):
        self.maps, self.frames, self.stride = tuple(maps), frames, stride
        self._reach = (frames - 1) * stride * spacing
        self._past: torch.Tensor | None = None

    def push(
        self, batch: Batch, spacings: Sequence[int] = (1,)
    ) -> list[Float[torch.Tensor, "frame window map row azimuth"]]:
        """Windows that end at the next frames, for each spacing (frames of the network's) between their frames.

        Before the stream began everything looked as in its first frame.
        """
        made = batch.maps(self.maps)
        new = torch.stack([torch.from_numpy(made[name]) for name in self.maps], dim=1).float()
        past = new[:1].expand(self._reach, -1, -1, -1) if self._past is None else self._past
        everything = torch.cat([past, new])
        self._past = everything[len(everything) - self._reach :]
        newest = torch.arange(self._reach, self._reach + len(new))[:, None]
        back = torch.arange(self.frames - 1, -1, -1) * self.stride
        return [everything[newest - back * spacing] for spacing in spacings]


def silent(windows: Float[torch.Tensor, "frame window map row azimuth"]) -> Bool[torch.Tensor, "frame"]:
    """Windows of which a frame shows nothing at all: networks were not trained to say that they know nothing."""
    return (windows <= FLOOR).flatten(2).all(dim=2).any(dim=1)
