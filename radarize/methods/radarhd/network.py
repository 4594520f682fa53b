"""RadarHD: a U-Net that draws, from 41 frames of a radar's range-azimuth maps, what a lidar would have seen.

Prabhakara et al., "High resolution point clouds from mmWave radar", ICRA 2023.
"""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, max_pool2d, pad

from radarize.features.maps import AZIMUTHS, MapMaker, Maps
from radarize.mapping.scans import BEARINGS
from radarize.nets.unet import double_convolution

#: Columns that the network sees, and those of its picture, over the field of the scans.
SEEN, DRAWN = 64, 512
#: Edges of the picture, rad: those of the scans' outer bearings.
_HALF = (BEARINGS[1] - BEARINGS[0]) / 2
FIELD = (float(BEARINGS[0] - _HALF), float(BEARINGS[-1] + _HALF))
#: Rows in which the transmitters leak into the receivers.
_LEAKAGE = 6
#: dB below a frame's maximum from which cells are dropped: 5 % of its magnitude.
_DEPTH = -20 * np.log10(0.05)


def columns(count: int) -> Float[np.ndarray, "count"]:
    """Middles of equal columns of the field, rad, positive to the left, ascending."""
    edges = np.linspace(*FIELD, count + 1)
    return (edges[1:] + edges[:-1]) / 2


class Up(nn.Module):
    """Twice the size by interpolation, the encoder's image of that size beside it, and fewer channels."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.mix = double_convolution(inputs, outputs, inputs // 2)

    def forward(self, x: Tensor, beside: Tensor) -> Tensor:
        x = interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=True)
        rows, columns = (beside.shape[axis] - x.shape[axis] for axis in (2, 3))  # 1 where an odd size was halved
        return self.mix(torch.cat([beside, pad(x, (0, columns, 0, rows))], dim=1))


class Sharper(nn.Module):
    """Twice the columns."""

    def __init__(self, width: int):
        super().__init__()
        self.mix = double_convolution(width, width)

    def forward(self, x: Tensor) -> Tensor:
        return self.mix(interpolate(x, scale_factor=(1.0, 2.0), mode="bilinear", align_corners=True))


class RadarHdNet(nn.Module):
    """Range-azimuth maps to a picture of the first surfaces, of eight times as many columns.

    The original sees 256 ranges, 64 directions of half a circle and a Bartlett beamformer's magnitudes; this one sees
    the ranges of the radar, the field of its scans, and the map of Capon's beamformer that all networks share.

    Args:
        frames: of a window, oldest first; 41 in the original.
        maps: names of a frame's maps: one.
        width: channels of the first level; 64 in the original, with 17.51 M parameters.
    """

    kind, setting, maker, scaled = "radarhd", "corrected", MapMaker, False
    inputs, outputs = ("maps",), ("probability",)

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__()
        self.frames, self.maps, self.width = frames, tuple(maps), width
        widths = [width * scale for scale in (1, 2, 4, 8, 8)]
        inputs = [frames * len(self.maps), *widths[:-1]]
        self.down = nn.ModuleList(double_convolution(a, b) for a, b in zip(inputs, widths, strict=True))
        sizes = [width * scale for scale in (8, 4, 2, 1, 1)]
        self.up = nn.ModuleList(Up(2 * a, b) for a, b in zip(sizes[:-1], sizes[1:], strict=True))
        self.sharpen = nn.Sequential(*(Sharper(width) for _ in range((DRAWN // SEEN).bit_length() - 1)))
        self.head = nn.Conv2d(width, 1, 1)
        self.coarse = False  # whether training rounds convolutions to bfloat16, see `ResNet18`
        resampling = np.stack([np.interp(columns(SEEN), AZIMUTHS, row) for row in np.eye(len(AZIMUTHS))])
        self.register_buffer("resampling", torch.tensor(resampling, dtype=torch.float32), persistent=False)
        #: Probability from which a cell counts as a surface; training fits it on validation data.
        self.register_buffer("least", torch.tensor(0.5))

    def seen(self, maps: Maps) -> Float[Tensor, "item channel row column"]:
        """The frames as the network sees them: the strongest 26 dB of each as 0...1, without leakage."""
        image = (maps @ self.resampling).flatten(1, 2)[:, :, _LEAKAGE:]
        image = (1 + (image - image.amax(dim=(2, 3), keepdim=True)) / _DEPTH).clamp_min(0)
        return pad(image, (0, 0, _LEAKAGE, 0))

    def forward(self, maps: Maps) -> Float[Tensor, "item range direction"]:
        """Logits of a surface in a cell of range and `columns(DRAWN)`."""
        x = self.seen(maps)
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.coarse and self.training):
            levels = [self.down[0](x)]
            for convolution in self.down[1:]:
                levels.append(convolution(max_pool2d(levels[-1], 2)))
            x = levels.pop()
            for up in self.up:
                x = up(x, levels.pop())
            x = self.sharpen(x)
        return self.head(x.float())[:, 0]

    def estimate(self, maps: Maps) -> Float[Tensor, "item range direction"]:
        """Probability of the same."""
        return torch.sigmoid(self(maps))
