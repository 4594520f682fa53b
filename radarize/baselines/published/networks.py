"""The artefact's networks, based on ResNet18 and U-Net.

They read maps of 0...1, newest frame last, and return values without a distribution. `estimate` adds a constant
covariance, the mean squared error on validation data, for the back end.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.baselines.published.maps import PublishedMaps
from radarize.learning.nets.resnet import Block, ResNet18
from radarize.learning.nets.unet import UNet
from radarize.learning.nets.weights import Network
from radarize.signal.maps import Maps


class Attention(nn.Module):
    """Efficient channel attention: channels are weighted by a convolution over the channels' means (Wang et al.,
    "ECA-Net: efficient channel attention for deep convolutional neural networks", 2020, equation 12)."""

    def __init__(self, channels: int):
        super().__init__()
        size = int(abs((math.log2(channels) + 1) / 2))
        size += 1 - size % 2
        self.mix = nn.Conv1d(1, 1, size, padding=size // 2, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        weights = torch.sigmoid(self.mix(x.mean(dim=(2, 3))[:, None]))
        return x * weights[:, 0, :, None, None]


class PublishedMotionNet(Network):
    """Base class of the networks for translation and rotation.

    Attributes:
        kind, dimensions, pool: kind of network, number of outputs, and option of `ResNet18`; set by the subclass.
        error: mean squared error on validation data.
    """

    setting, maker = "published", PublishedMaps
    dimensions: int
    pool: bool
    error: Float[Tensor, "dimension"]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        self.resnet = ResNet18(frames * len(self.maps), self.dimensions, width, pool=self.pool)
        self.register_buffer("error", torch.ones(self.dimensions))

    def forward(self, maps: Maps) -> Float[Tensor, "item dimension"]:
        return self.resnet(maps.flatten(1, 2))

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item dimension"], Float[Tensor, "item dimension dimension"]]:
        """Return the estimate and its covariance."""
        return self(maps), torch.diag(self.error).expand(maps.shape[0], -1, -1)


class PublishedTranslationNet(PublishedMotionNet):
    """Network from Doppler-azimuth maps of both arrays to the mean velocity (forward, left) since the last frame,
    m/s."""

    kind, dimensions, pool = "translation", 2, True


class PublishedRotationNet(PublishedMotionNet):
    """Network from range-azimuth maps over 1, 3 and 5 frames, at two times, to the change of yaw between them, rad."""

    kind, dimensions, pool = "rotation", 1, False

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        for module in self.resnet.modules():
            if isinstance(module, Block):
                last = module.body[-1]
                assert isinstance(last, nn.BatchNorm2d)  # of a block over images
                module.body.append(Attention(last.num_features))
        self.resnet.head = nn.Sequential(nn.Linear(8 * width, 32), nn.Linear(32, 256), nn.ReLU(), nn.Linear(256, 1))

    def forward(self, maps: Maps) -> Float[Tensor, "item 1"]:
        """Estimate the change of yaw between frames a and b with maps 1, 3, 5. Channels are a1, a3, a5, b5, b3, b1,
        whose order time reversal inverts."""
        return self.resnet(torch.cat([maps[:, 0], maps[:, 1].flip(1)], dim=1))

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Return the change of yaw, the mean of the estimate and the negated estimate in reversed time; its
        covariance."""
        turn = (self(maps) - self(maps.flip(1))) / 2
        return turn, torch.diag(self.error).expand(maps.shape[0], -1, -1)


class PublishedSegmentationNet(Network):
    """Network from range-azimuth maps of both arrays over 1, 3 and 5 frames to occupancy, in two classes."""

    kind, setting, maker, outputs = "segmentation", "published", PublishedMaps, ("probability",)

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        self.unet = UNet(frames * len(self.maps), 2, width)

    def forward(self, maps: Maps) -> Float[Tensor, "item class range bearing"]:
        """Compute logits of free (0) and occupied (1) cells."""
        return self.unet(maps.flatten(1, 2))

    def estimate(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Estimate the probability that a cell is occupied."""
        return self(maps).softmax(dim=1)[:, 1]
