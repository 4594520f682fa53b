"""RadarHD: a U-Net from two seconds of a radar's range-azimuth maps to the picture of a lidar.

Prabhakara et al., "High resolution point clouds from mmWave radar", ICRA 2023.
"""

from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pad

from radarize.baselines.pictures.maps import PictureMaker
from radarize.learning.nets.unet import Up, double_convolution, through
from radarize.learning.nets.weights import Network
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import AZIMUTHS, Maps

#: Azimuth columns of the network's input and of its output, over the field of view of the scans.
SEEN, DRAWN = 64, 512
_DOUBLINGS = (DRAWN // SEEN).bit_length() - 1
#: Edges of the picture, rad: the outer edges of the scans' first and last bearing.
_HALF = (BEARINGS[1] - BEARINGS[0]) / 2
FIELD = (float(BEARINGS[0] - _HALF), float(BEARINGS[-1] + _HALF))
#: Range rows with leakage of the transmitters.
_LEAKAGE = 6
#: Level below a frame's maximum under which cells are dropped, dB: 5 % of its magnitude.
_DEPTH = -20 * np.log10(0.05)


def columns(count: int) -> Float[np.ndarray, "count"]:
    """Return the centres of equal columns of the field of view, rad, positive to the left, ascending."""
    edges = np.linspace(*FIELD, count + 1)
    return (edges[1:] + edges[:-1]) / 2


def _larger(*scale: float) -> nn.Upsample:
    return nn.Upsample(scale_factor=scale, mode="bilinear", align_corners=True)


class DrawingNet(Network):
    """Network from range-azimuth maps to a picture of eight times as many columns.

    Args:
        frames: frames of a window, oldest first; 41 in the original.
        maps: name of the map of a frame.
        width: channels of the first level; 64 in the original, with 17.51 M parameters.
    """

    outputs = ("probability",)
    least: Float[Tensor, ""]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        widths = [width * scale for scale in (1, 2, 4, 8, 8)]
        inputs = [frames * len(self.maps), *widths[:-1]]
        self.down = nn.ModuleList(double_convolution(a, b) for a, b in zip(inputs, widths, strict=True))
        sizes = [width * scale for scale in (8, 4, 2, 1, 1)]
        self.up = nn.ModuleList(
            Up(_larger(2.0, 2.0), double_convolution(2 * a, b, a)) for a, b in zip(sizes[:-1], sizes[1:], strict=True)
        )
        sharper = (OrderedDict(grow=_larger(1.0, 2.0), mix=double_convolution(width, width)) for _ in range(_DOUBLINGS))
        self.sharpen = nn.Sequential(*map(nn.Sequential, sharper))
        self.head = nn.Conv2d(width, 1, 1)
        self.coarse = False  # whether training rounds convolutions to bfloat16, see `ResNet18`
        #: Probability above which a cell counts as a surface; fitted on validation data.
        self.register_buffer("least", torch.tensor(0.5))

    @abstractmethod
    def seen(self, maps: Maps) -> Float[Tensor, "item channel row column"]:
        """Return the network's input, 0...1."""

    def forward(self, maps: Maps) -> Float[Tensor, "item range direction"]:
        """Compute logits of a surface in each cell of range and `DRAWN` columns."""
        x = self.seen(maps)
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.coarse and self.training):
            x = self.sharpen(through(x, self.down, self.up))
        return self.head(x.float())[:, 0]

    def estimate(self, maps: Maps) -> Float[Tensor, "item range direction"]:
        """Estimate the probability of a surface in each cell."""
        return torch.sigmoid(self(maps))


class RadarHdNet(DrawingNet):
    """Network from Capon's range-azimuth maps to a picture of the first surfaces on `columns(DRAWN)`.

    The original reads 256 ranges, 64 directions over half a circle and magnitudes of Bartlett's beamformer. This one
    reads the radar's ranges, the field of view of the scans, and the map of Capon's beamformer used by all networks.
    """

    kind = "radarhd"
    resampling: Float[Tensor, "azimuth column"]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        resampling = np.stack([np.interp(columns(SEEN), AZIMUTHS, row) for row in np.eye(len(AZIMUTHS))])
        self.register_buffer("resampling", torch.tensor(resampling, dtype=torch.float32), persistent=False)

    def seen(self, maps: Maps) -> Float[Tensor, "item channel row column"]:
        """Scale the upper 26 dB of each frame to 0...1, without leakage."""
        image = (maps @ self.resampling).flatten(1, 2)[:, :, _LEAKAGE:]
        image = (1 + (image - image.amax(dim=(2, 3), keepdim=True)) / _DEPTH).clamp_min(0)
        return pad(image, (0, 0, _LEAKAGE, 0))


class RadarHdPictureNet(DrawingNet):
    """Network from RadarHD's pictures (`radarize.signal.polar`) to those of its lidar, both over half a circle. Columns
    are `AZIMUTHS` and `BEAM_AZIMUTHS`, because upsampling keeps the outer columns in place."""

    kind, maker = "radarhd-pictures", PictureMaker

    def seen(self, maps: Maps) -> Float[Tensor, "item channel row column"]:
        """Scale pictures from 0...255 to 0...1; they have no leakage."""
        return maps.flatten(1, 2) / 255
