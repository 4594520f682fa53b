"""What all networks do to heat maps first."""

import torch
from jaxtyping import Float
from torch import Tensor

from radarize.signal.maps import Maps

#: dB that become 1: about the standard deviation of a map's cells.
SCALE = 10.0


def level(maps: Maps) -> Maps:
    """Maps of dB about their own mean, so that the receiver's gain, which differs from board to board, drops out."""
    return (maps - maps.mean(dim=(3, 4), keepdim=True)) / SCALE


def coordinates(image: Float[Tensor, "item channel row column"]) -> Float[Tensor, "item 2 row column"]:
    """Row and column of every cell, -1...1: a ridge's place is the answer, and averages over an image forget it (Liu et
    al., "An intriguing failing of convolutional neural networks and the CoordConv solution", 2018)."""
    rows, columns = (torch.linspace(-1, 1, size, dtype=image.dtype, device=image.device) for size in image.shape[2:])
    grid = torch.stack([rows[:, None].expand(-1, image.shape[3]), columns[None].expand(image.shape[2], -1)])
    return grid[None].expand(image.shape[0], -1, -1, -1)  # len() would fix it at export
