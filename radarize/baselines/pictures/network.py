"""U-Net from polar pictures to a distribution over the range of a lidar's points, for each azimuth."""

from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import pixel_shuffle

from radarize.baselines.pictures.maps import PictureMaker
from radarize.learning.features import augment
from radarize.learning.nets.maps import coordinates
from radarize.learning.nets.unet import UNet
from radarize.learning.nets.weights import Network
from radarize.signal import polar
from radarize.signal.maps import Maps

#: Columns of the output over half a circle: four beams of the lidar each.
COLUMNS = 128
#: Factor by which rows are folded into channels, and channels into rows and columns of the output.
_FOLD = 2


class PictureNet(Network):
    """Network from the polar pictures of a second to a distribution over range, or no point, for every column.

    Args:
        frames: frames of a window; the output belongs to the newest.
        maps: names of the maps of a frame.
        width: width of the U-Net.
    """

    kind, outputs = "pictures", ("probability",)
    maker = PictureMaker

    def __init__(self, frames: int, maps: Sequence[str], width: int = 8):
        super().__init__(frames, maps, width)
        self.unet = UNet(_FOLD * frames * len(self.maps) + 2, _FOLD * COLUMNS // polar.COLUMNS, width)
        self.nothing = nn.Parameter(torch.zeros(()))
        #: Probability above which every cell has a point (`points`); fitted after training.
        self.register_buffer("dense", torch.tensor(0.03))

    def forward(self, maps: Maps) -> Float[Tensor, "item 257 column"]:
        """Compute logarithms of the probability of each row, and in the last row that of no point."""
        image = (maps.flatten(1, 2) / 255).unflatten(2, (-1, _FOLD)).transpose(2, 3).flatten(1, 2)
        logits = pixel_shuffle(self.unet(torch.cat([image, coordinates(image)], dim=1)), _FOLD)[:, 0]
        nothing = self.nothing.expand(len(logits), 1, logits.shape[2])
        return torch.cat([logits, nothing], dim=1).log_softmax(dim=1)

    def estimate(self, maps: Maps) -> Float[Tensor, "item 257 column"]:
        """Estimate the probabilities of `forward`, averaged over a window and its mirror image."""
        return (self(maps).exp() + self(augment.mirrored(maps)).exp().flip(2)) / 2
