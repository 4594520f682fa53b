"""Motion from heat maps: velocity from Doppler over azimuth, turns from range over azimuth (paper, sections 4.2, 4.3).

Both are ResNet18 on a window of maps in dB, newest frame last, and answer with a normal distribution. `forward` gives
what is trained; `estimate` what is used, its covariance scaled by `spread`, which training fits on validation data.
"""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from radarize.nets.gaussian import Gaussian
from radarize.nets.maps import Maps, coordinates, level
from radarize.nets.resnet import ResNet18


class MotionNet(nn.Module):
    """What the two have in common.

    Args:
        frames: of a window.
        maps: names of a frame's maps, see `radarize.training.maps.MAPS`.
        width: of the ResNet.

    Attributes:
        kind, dimensions, stride: set by the subclass.
        spread: logarithm of what standard deviations are multiplied with.
    """

    kind: str
    dimensions: int
    stride: tuple[int, int]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16):
        super().__init__()
        self.frames, self.maps, self.width = frames, tuple(maps), width
        outputs = Gaussian.numbers(self.dimensions)
        self.resnet = ResNet18(frames * len(self.maps) + 2, outputs, width, self.stride, pool=False)
        self.register_buffer("spread", torch.zeros(()))

    def forward(self, maps: Maps) -> Gaussian:
        image = level(maps).flatten(1, 2)
        image = torch.cat([image, coordinates(image)], dim=1)
        return Gaussian.of(self.resnet(image), self.dimensions)

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item dimension"], Float[Tensor, "item dimension dimension"]]:
        """Mean and covariance."""
        found = self(maps)
        return found.mean, found.covariance * (2 * self.spread).exp()


class TranslationNet(MotionNet):
    """Doppler-azimuth maps to the sensor's velocity (forward, left), m/s, in the middle of the newest frame's burst."""

    kind, dimensions, stride = "translation", 2, (1, 1)


class RotationNet(MotionNet):
    """Range-azimuth maps to the change of yaw from the oldest frame of the window to the newest, rad, positive to the
    left."""

    kind, dimensions, stride = "rotation", 1, (2, 1)

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Mean and covariance of the turn, averaged over the window and its reverse (paper, section 4.3)."""
        both = self(torch.cat([maps, maps.flip(1)]))
        count = maps.shape[0]
        forth, back = both.mean[:count], both.mean[count:]
        # Both see the same noise: the average is not taken to be better than either.
        return (forth - back) / 2, (both.covariance[:count] + both.covariance[count:]) / 2 * (2 * self.spread).exp()
