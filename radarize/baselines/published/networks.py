"""The artefact's networks: what it adds to ResNet18 and U-Net.

They see maps of 0...1 as they are, newest frame last, and answer with a number, not a distribution. `estimate` gives a
covariance all the same, the same for every item: the error on validation data, for what comes after them.
"""

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
    """Channels weighed by what all of an image says of them (Woo et al., "CBAM: convolutional block attention module",
    2018, section 3.1)."""

    def __init__(self, channels: int, reduction: int = 16):
        super().__init__()
        hidden = max(channels // reduction, 1)
        self.mix = nn.Sequential(
            nn.Conv2d(channels, hidden, 1, bias=False), nn.ReLU(), nn.Conv2d(hidden, channels, 1, bias=False)
        )

    def forward(self, x: Tensor) -> Tensor:
        mean, most = x.mean(dim=(2, 3), keepdim=True), x.amax(dim=(2, 3), keepdim=True)
        return x * torch.sigmoid(self.mix(mean) + self.mix(most))


class PublishedMotionNet(Network):
    """What the two have in common.

    Attributes:
        kind, dimensions, pool: set by the subclass; the last as of `ResNet18`.
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
        """Value and covariance."""
        return self(maps), torch.diag(self.error).expand(maps.shape[0], -1, -1)


class PublishedTranslationNet(PublishedMotionNet):
    """Doppler-azimuth maps of both arrays to the velocity (forward, left), m/s, since the frame before."""

    kind, dimensions, pool = "translation", 2, True


class PublishedRotationNet(PublishedMotionNet):
    """Range-azimuth maps of one, three and five frames, at two instants, to the turn between them, rad."""

    kind, dimensions, pool = "rotation", 1, False

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        for module in self.resnet.modules():
            if isinstance(module, Block):
                last = module.body[-1]
                assert isinstance(last, nn.BatchNorm2d)  # of a block over images
                module.body.append(Attention(last.num_features))
        layers = (8 * width, 32, 256, 1)
        pairs = [(nn.Linear(a, b), nn.ReLU()) for a, b in zip(layers[:-1], layers[1:], strict=True)]
        self.resnet.head = nn.Sequential(*[layer for pair in pairs for layer in pair][:-1])

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Turn, the mean of forward and, negated, reverse; and its covariance."""
        turn = (self(maps) - self(maps.flip(1))) / 2
        return turn, torch.diag(self.error).expand(maps.shape[0], -1, -1)


class PublishedSegmentationNet(Network):
    """Range-azimuth maps of one, three and five frames of both arrays to occupancy, of two classes."""

    kind, setting, maker, outputs = "segmentation", "published", PublishedMaps, ("probability",)

    def __init__(self, frames: int, maps: Sequence[str], width: int = 64):
        super().__init__(frames, maps, width)
        self.unet = UNet(frames * len(self.maps), 2, width)

    def forward(self, maps: Maps) -> Float[Tensor, "item class range bearing"]:
        """Logits of free (0) and occupied (1) cells."""
        return self.unet(maps.flatten(1, 2))

    def estimate(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Probability that a cell is occupied."""
        return self(maps).softmax(dim=1)[:, 1]
