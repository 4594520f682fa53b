"""Motion from heat maps: velocity from Doppler-azimuth, rotation from range-azimuth maps (paper, sections 4.2, 4.3).

Both networks are a ResNet18 on an image made from a window of maps in dB, newest frame last, and return a normal
distribution. `forward` is used in training, `estimate` in operation; the latter scales the covariance by `spread`,
which is fitted to validation data.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from radarize.learning.nets.correlation import Correlation, Moved
from radarize.learning.nets.gaussian import Gaussian
from radarize.learning.nets.maps import coordinates, level
from radarize.learning.nets.resnet import ResNet18
from radarize.learning.nets.weights import Network
from radarize.signal.maps import AZIMUTHS, Maps


class MotionNet(Network):
    """Base class of both networks.

    Args:
        frames, maps, width: see `Network`; the width is that of the ResNet.
        channels: channels of the image.

    Attributes:
        kind, dimensions, stride: set by the subclass; the stride is that of the ResNet's first convolution.
        spread: logarithm of the factor of standard deviations.
    """

    scaled = True
    dimensions: int
    stride: tuple[int, int]
    spread: Float[Tensor, ""]

    def __init__(self, frames: int, maps: Sequence[str], width: int, channels: int):
        super().__init__(frames, maps, width)
        self.resnet = ResNet18(channels + 2, Gaussian.numbers(self.dimensions), width, self.stride, pool=False)
        self.register_buffer("spread", torch.zeros(()))


class TranslationNet(MotionNet):
    """Velocity (forward, left), m/s, in the middle of the newest frame's burst, from Doppler-azimuth maps.

    It has two stages: the first estimates the velocity to a fraction of a Doppler bin. For the second, each column is
        shifted
    by the closing speed for that velocity, so that the ridge of the static world is flat and centred; a second ResNet
    estimates the remaining velocity. Its input is the same at any speed, so it needs fewer examples.

    Args:
        frames, maps, width: see `MotionNet`.
        step: step between rows, m/s.
    """

    kind, dimensions, stride = "translation", 2, (1, 2)
    #: m/s, maximum speed of a pedestrian.
    fastest = 4.0
    #: Rows above and below the ridge that the second stage uses.
    near = 6
    directions: Float[Tensor, "2 column"]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16, step: float = 0.1146):
        super().__init__(frames, maps, width, frames * len(maps))
        self.step = step
        self.second = ResNet18(frames * len(maps) + 2, Gaussian.numbers(2), width, self.stride, pool=False)
        self.register_buffer("directions", torch.tensor(_directions(), dtype=torch.float32), persistent=False)

    def forward(self, maps: Maps) -> Gaussian:
        """Return the velocities by the first stage for all windows, then by the second: twice as many."""
        image = level(maps).flatten(1, 2)
        first = self.resnet(torch.cat([image, coordinates(image)], dim=1))
        velocity = first[:, :2].detach().clamp(-self.fastest, self.fastest)
        flat = self._rolled(image, velocity)
        second = self.second(torch.cat([flat, coordinates(flat)], dim=1))
        second = torch.cat([second[:, :2] * self.step + velocity, second[:, 2:]], dim=1)
        return Gaussian.of(torch.cat([first, second]), 2)

    def _rolled(self, image: Tensor, velocity: Float[Tensor, "item 2"]) -> Float[Tensor, "item channel near column"]:
        """Shift columns so that closing speeds of a static world are in the middle row; linear between rows."""
        rows = image.shape[2]
        closing = velocity @ self.directions / self.step + rows // 2  # (item, column)
        window = torch.arange(-self.near, self.near + 1, device=image.device)
        place = closing[:, None, :] + window[:, None]
        below = place.floor()
        fraction = (place - below)[:, None]
        lower = (below.long() % rows)[:, None].expand(-1, image.shape[1], -1, -1)
        upper = (lower + 1) % rows
        return image.gather(2, lower) * (1 - fraction) + image.gather(2, upper) * fraction

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item 2"], Float[Tensor, "item 2 2"]]:
        """Return mean and covariance, by the second stage."""
        found, count = self(maps), maps.shape[0]
        return found.mean[count:], found.covariance[count:] * (2 * self.spread).exp()


def _directions() -> list[list[float]]:
    """Return forward and left parts (2, column) of the horizontal directions of a map's columns."""
    return [[math.cos(a) for a in AZIMUTHS], [math.sin(a) for a in AZIMUTHS]]


class RotationNet(MotionNet):
    """Change of yaw from the oldest frame of a window to the newest, rad, positive to the left, from range-azimuth
    maps.

    In the paper, the two maps are channels of one image, and the network has to learn that a rotation shifts one
    against the other, that a sideways step has nearly the same effect, and how the two differ. Here the translation is
    known from the velocities: both maps are first moved to the midpoint (`Moved`), after which a rotation shifts all
        ranges equally.
    The image is their correlation (`Correlation`), in which the rotation is a position.

    Args:
        frames, maps, width: see `TranslationNet`.
        step: step between rows, m.
    """

    kind, dimensions, stride = "rotation", 1, (1, 2)
    inputs = ("maps", "travel")

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16, step: float = 0.0446):
        correlation = Correlation(len(maps), len(AZIMUTHS))
        super().__init__(frames, maps, width, (frames - 1) * correlation.channels + 2)
        self.moved, self.correlation = Moved(step), correlation

    def forward(self, maps: Maps, travel: Float[Tensor, "item 2"]) -> Gaussian:
        """Return the rotations of all windows, then of all reversed windows: twice as many.

        Args:
            maps: in dB.
            travel: translation (forward, left), m: mean of the velocities at the window's ends times its duration.
        """
        # Frames before the newest are spaced evenly along the path.
        ago = torch.linspace(0.5, -0.5, self.frames, device=maps.device)
        steps = (travel[:, None] * ago[:, None]).flatten(0, 1)
        moved = self.moved(level(maps).flatten(0, 1), steps).unflatten(0, maps.shape[:2])
        shifts = self.correlation(moved, reversed_too=True)
        translation = torch.cat([travel, -travel])[:, :, None, None].expand(-1, -1, *shifts.shape[2:])
        image = torch.cat([shifts, translation, coordinates(shifts)], dim=1)
        return Gaussian.of(self.resnet(image), self.dimensions)

    def estimate(
        self, maps: Maps, travel: Float[Tensor, "item 2"]
    ) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Return mean and covariance of the rotation, averaged over the window and its reverse (paper, section 4.3).

        Without the reverse, errors are 4 % larger, which matters on long handheld walks.
        """
        both, count = self(maps, travel), maps.shape[0]
        forth, back = both.mean[:count], both.mean[count:]
        # Both have the same noise, so the average counts as no more accurate than either.
        return (forth - back) / 2, (both.covariance[:count] + both.covariance[count:]) / 2 * (2 * self.spread).exp()
