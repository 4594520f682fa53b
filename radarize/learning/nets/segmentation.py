"""Occupancy from heat maps: cells of range and bearing with the first surface (paper, section 4.4)."""

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
    """Return weights (azimuth, bearing) of the linear interpolation from map azimuths to scan bearings."""
    weights = np.stack([np.interp(BEARINGS, AZIMUTHS, row) for row in np.eye(len(AZIMUTHS))])
    return torch.tensor(weights, dtype=torch.float32)


class SegmentationNet(Network):
    """U-Net on range-azimuth maps, azimuth and elevation-aware; its output for the newest frame is on the grid of the
    occupancy labels."""

    kind, outputs = "segmentation", ("probability",)
    resampling: Float[Tensor, "azimuth bearing"]
    scale: Float[Tensor, ""]
    offset: Float[Tensor, ""]

    def __init__(self, frames: int, maps: Sequence[str], width: int = 16):
        super().__init__(frames, maps, width)
        self.unet = UNet(frames * len(self.maps) + 2, 1, width)
        self.register_buffer("resampling", _resampling(), persistent=False)
        # Balanced classes overestimate the probability of surfaces; scale and offset are fitted to validation data.
        self.register_buffer("scale", torch.ones(()))
        self.register_buffer("offset", torch.zeros(()))

    def forward(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Return logits of a cell to have the first surface, given that no cell before it has."""
        image = (level(maps) @ self.resampling).flatten(1, 2)
        return self.unet(torch.cat([image, coordinates(image)], dim=1))[:, 0]

    def estimate(self, maps: Maps) -> Float[Tensor, "item range bearing"]:
        """Return the probability of a cell to have the first surface, given that no cell before it has."""
        return torch.sigmoid(self(maps) * self.scale + self.offset)
