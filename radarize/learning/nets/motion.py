"""Motion from heat maps: velocity from Doppler over azimuth, turns from range over azimuth (paper, sections 4.2, 4.3).

Both are ResNet18 on an image made of a window of maps in dB, newest frame last, and answer with a normal distribution.
`forward` gives what is trained; `estimate` what is used, its covariance scaled by `spread`, which training fits on
validation data.
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
    """What the two have in common.

    Args:
        frames, maps, width: see `Network`; the width is that of the ResNet.
        channels: of the image.

    Attributes:
        kind, dimensions, stride: set by the subclass; the stride is that of the ResNet's first convolution.
        spread: logarithm of what standard deviations are multiplied with.
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
    """Doppler-azimuth maps to the sensor's velocity (forward, left), m/s, in the middle of the newest frame's burst.

    In two looks: the first finds the velocity to a fraction of a Doppler bin. For the second, every column is rolled by
    what that velocity closes at, so that the static world's ridge lies flat and in the middle, where a second ResNet
    reads what is missing; it sees the same picture whatever the speed, and needs the fewer examples.

    Args:
        frames, maps, width: see `MotionNet`.
        step: m/s from row to row.
    """

    kind, dimensions, stride = "translation", 2, (1, 2)
    #: m/s; nobody walks faster.
    fastest = 4.0
    #: Rows that the second look sees above and below the ridge.
    near = 6
    directions: Float[Tensor, "2 column"]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16, step: float = 0.1146):
        super().__init__(frames, maps, width, frames * len(maps))
        self.step = step
        self.second = ResNet18(frames * len(maps) + 2, Gaussian.numbers(2), width, self.stride, pool=False)
        self.register_buffer("directions", torch.tensor(_directions(), dtype=torch.float32), persistent=False)

    def forward(self, maps: Maps) -> Gaussian:
        """Velocities by the first look at all windows, then by the second: twice as many."""
        image = level(maps).flatten(1, 2)
        first = self.resnet(torch.cat([image, coordinates(image)], dim=1))
        velocity = first[:, :2].detach().clamp(-self.fastest, self.fastest)
        flat = self._rolled(image, velocity)
        second = self.second(torch.cat([flat, coordinates(flat)], dim=1))
        second = torch.cat([second[:, :2] * self.step + velocity, second[:, 2:]], dim=1)
        return Gaussian.of(torch.cat([first, second]), 2)

    def _rolled(self, image: Tensor, velocity: Float[Tensor, "item 2"]) -> Float[Tensor, "item channel near column"]:
        """Columns rolled so that what closes as a static world does lies in the middle row; linear between rows."""
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
        """Mean and covariance, by the second look."""
        found, count = self(maps), maps.shape[0]
        return found.mean[count:], found.covariance[count:] * (2 * self.spread).exp()


def _directions() -> list[list[float]]:
    """(2, column): forward and left parts of the horizontal directions of a map's columns."""
    return [[math.cos(a) for a in AZIMUTHS], [math.sin(a) for a in AZIMUTHS]]


class RotationNet(MotionNet):
    """Range-azimuth maps to the change of yaw from the oldest frame of the window to the newest, rad, positive to the
    left.

    The paper's network sees the two maps as channels of one image and has to find out by itself that a turn shifts the
    one against the other, that a step to the side does nearly the same, and how the two differ. Here the step is known
    from the velocities: both maps are first moved to half way between them (`Moved`), after which a turn shifts all
    ranges alike. Their correlation (`Correlation`) is the image, in which a turn is a place.

    Args:
        frames, maps, width: as of `TranslationNet`.
        step: m from row to row.
    """

    kind, dimensions, stride = "rotation", 1, (1, 2)
    inputs = ("maps", "travel")

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16, step: float = 0.0446):
        correlation = Correlation(len(maps), len(AZIMUTHS))
        super().__init__(frames, maps, width, (frames - 1) * correlation.channels + 2)
        self.moved, self.correlation = Moved(step), correlation

    def forward(self, maps: Maps, travel: Float[Tensor, "item 2"]) -> Gaussian:
        """Turns of all windows, then of all windows reversed: twice as many.

        Args:
            maps: in dB.
            travel: mean of the sensor's velocities at the window's ends times its duration, m (forward, left).
        """
        # Frames before the newest lie evenly on the way to it.
        ago = torch.linspace(0.5, -0.5, self.frames, device=maps.device)
        steps = (travel[:, None] * ago[:, None]).flatten(0, 1)
        moved = self.moved(level(maps).flatten(0, 1), steps).unflatten(0, maps.shape[:2])
        shifts = self.correlation(moved, reversed_too=True)
        told = torch.cat([travel, -travel])[:, :, None, None].expand(-1, -1, *shifts.shape[2:])
        image = torch.cat([shifts, told, coordinates(shifts)], dim=1)
        return Gaussian.of(self.resnet(image), self.dimensions)

    def estimate(
        self, maps: Maps, travel: Float[Tensor, "item 2"]
    ) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Mean and covariance of the turn, averaged over the window and its reverse (paper, section 4.3): without the
        reverse, errors are 4 % larger, which on long walks by hand is much."""
        both, count = self(maps, travel), maps.shape[0]
        forth, back = both.mean[:count], both.mean[count:]
        # Both see the same noise: the average is not taken to be better than either.
        return (forth - back) / 2, (both.covariance[:count] + both.covariance[count:]) / 2 * (2 * self.spread).exp()
