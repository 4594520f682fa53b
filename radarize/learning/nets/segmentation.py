"""Occupancy from heat maps: which cells of range and bearing hold the first surface (paper, section 4.4)."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from radarize.learning.nets.maps import coordinates, level
from radarize.learning.nets.unet import UNet
from radarize.learning.nets.weights import Network
from radarize.signal.bearings import BEARINGS
from radarize.signal.maps import AZIMUTHS, Maps


def _resampling() -> Tensor:
    """(azimuth, bearing) weights that take maps to the scan's bearings, linearly."""
    weights = np.stack([np.interp(BEARINGS, AZIMUTHS, row) for row in np.eye(len(AZIMUTHS))])
    return torch.tensor(weights, dtype=torch.float32)


class SegmentationNet(Network):
    """U-Net on range-azimuth maps, azimuth and elevation-aware, whose answers for the newest frame lie on the grid of
    the occupancy labels."""

    kind, outputs = "segmentation", ("probability",)
    resampling: Float[Tensor, "azimuth bearing"]
    scale: Float[Tensor, ""]
    offset: Float[Tensor, ""]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16):
        super().__init__(frames, maps, width)
        self.unet = UNet(frames * len(self.maps) + 2, 1, width)
        self.register_buffer("resampling", _resampling(), persistent=False)
        # Balanced classes make surfaces seem likelier than they are; training fits these on validation data.
        self.register_buffer("scale", torch.ones(()))
        self.register_buffer("offset", torch.zeros(()))

    def forward(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Logits of a cell's holding the first surface, given that nothing is before it."""
        image = (level(maps) @ self.resampling).flatten(1, 2)
        return self.unet(torch.cat([image, coordinates(image)], dim=1))[:, 0]

    def estimate(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Probability of the same."""
        return torch.sigmoid(self(maps) * self.scale + self.offset)
