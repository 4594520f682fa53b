"""Changes of yaw from polar pictures: columns are uniform in azimuth, so a rotation shifts all columns equally."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Generator, Tensor, nn

from radarize.baselines.pictures import roughening
from radarize.baselines.pictures.maps import PictureMaker
from radarize.baselines.pictures.task import PictureTask
from radarize.learning.features import augment
from radarize.learning.features.table import YAW, FeatureTable
from radarize.learning.nets import losses
from radarize.learning.nets.correlation import Correlation
from radarize.learning.nets.gaussian import Gaussian
from radarize.learning.nets.maps import coordinates
from radarize.learning.nets.resnet import ResNet18
from radarize.learning.nets.weights import Network
from radarize.learning.task import Motion, Settings, turns
from radarize.signal import polar
from radarize.signal.maps import Maps

#: Maximum shift between pictures, columns: 34 deg to either side.
_SHIFTS = 12


class PictureTurnNet(Network):
    """Network from polar pictures to the change of yaw between the two newest pictures, rad, positive to the left.

    Args:
        frames: frames of a window.
        maps: names of the maps of a frame.
        width: width of the ResNet.

    Attributes:
        spread: logarithm of a factor of the standard deviations; fitted after training.
    """

    kind, outputs = "picture-turns", ("turn", "covariance")
    maker = PictureMaker
    spread: Float[Tensor, ""]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 8):
        super().__init__(frames, maps, width)
        self.correlation = Correlation(len(self.maps), polar.COLUMNS, turns=_SHIFTS)
        self.resnet = ResNet18(
            (frames - 1) * self.correlation.channels + 2, Gaussian.numbers(1), width, (1, 2), pool=False
        )
        self.register_buffer("spread", torch.zeros(()))

    def forward(self, maps: Maps) -> Gaussian:
        """Compute the distribution of the change of yaw of each window."""
        image = self.correlation(maps / 255)
        return Gaussian.of(self.resnet(torch.cat([image, coordinates(image)], dim=1)), 1)

    def estimate(self, maps: Maps) -> tuple[Float[Tensor, "item 1"], Float[Tensor, "item 1 1"]]:
        """Estimate mean and covariance, averaged over a window and its mirror image, whose change of yaw is negated."""
        found, mirrored = self(maps), self(augment.mirrored(maps))
        covariance = (found.covariance + mirrored.covariance) / 2 * (2 * self.spread).exp()
        return (found.mean - mirrored.mean) / 2, covariance


class PictureTurns(PictureTask, Motion):
    """Training task: change of yaw between the two newest pictures, rad. Only the share of kept pixels is random,
    because additional echoes would not rotate with the scene."""

    network, truth = PictureTurnNet, (YAW,)
    error, size = "rmse_rad", "rms_turn_rad"
    least_frames = 2
    defaults = Settings(width=8, frames=5, epochs=24, batch=64, rate=1e-3, schedule="cosine")

    def label(self, table: FeatureTable, frames: Tensor) -> Float[Tensor, "item 1"]:
        return turns(table, frames[:, -2:])

    def augment(self, maps: Maps, label: Tensor, generator: Generator) -> tuple[Maps, Tensor]:
        pictures, left = self._pictures(maps, generator), augment.chosen(maps, generator)
        pictures = torch.where(left, augment.mirrored(pictures), pictures)
        return pictures, torch.where(left.flatten(1), -label, label)

    def loss(self, net: nn.Module, maps: Maps, label: Tensor) -> Float[Tensor, "item"]:
        return losses.likelihood(net(maps), label)

    def judge(self, net: Network, maps: Maps, label: Tensor) -> Float[Tensor, "item number"]:
        return super().judge(net, self._pictures(maps, Generator(maps.device).manual_seed(0)), label)

    @staticmethod
    def _pictures(maps: Maps, generator: Generator) -> Maps:
        return roughening.kept(roughening.levels(roughening.antennas_of(maps)), generator)
