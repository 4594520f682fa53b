"""Preprocessing of heat maps common to all networks."""

import torch
from jaxtyping import Float
from torch import Tensor

from radarize.signal.maps import Maps

#: dB that are scaled to 1: about the standard deviation of a map's cells.
SCALE = 10.0


def level(maps: Maps) -> Maps:
    """Subtract the mean of maps in dB and scale, to remove the receiver's gain, which differs between boards."""
    return (maps - maps.mean(dim=(3, 4), keepdim=True)) / SCALE


def coordinates(image: Float[Tensor, "item channel row column"]) -> Float[Tensor, "item 2 row column"]:
    """Return row and column of every cell, -1 to 1. The place of a ridge is the answer, and averages over an image lose
    it (Liu et al., "An intriguing failing of convolutional neural networks and the CoordConv solution", 2018)."""
    rows, columns = (torch.linspace(-1, 1, size, dtype=image.dtype, device=image.device) for size in image.shape[2:])
    grid = torch.stack([rows[:, None].expand(-1, image.shape[3]), columns[None].expand(image.shape[2], -1)])
    return grid[None].expand(image.shape[0], -1, -1, -1)  # len() would become a constant in the export
