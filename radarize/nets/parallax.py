"""Maps as they would have looked from a step away: what is left between two of them is the turn."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import grid_sample

from radarize.features.maps import AZIMUTHS


class Moved(nn.Module):
    """Range-azimuth maps seen from somewhere else with the same heading; what no map saw reads zero.

    Args:
        step: m from row to row.
    """

    def __init__(self, step: float):
        super().__init__()
        self.step = step
        self.register_buffer("azimuths", torch.tensor(AZIMUTHS, dtype=torch.float32), persistent=False)

    def forward(
        self, maps: Float[Tensor, "item map row azimuth"], travel: Float[Tensor, "item 2"]
    ) -> Float[Tensor, "item map row azimuth"]:
        """Maps after the sensor has moved by `travel` (forward, left), m."""
        rows = maps.shape[2]
        ranges = self.step * torch.arange(rows, dtype=maps.dtype, device=maps.device)[:, None]
        ahead = ranges * self.azimuths.cos() + travel[:, 0, None, None]
        left = ranges * self.azimuths.sin() + travel[:, 1, None, None]
        row = (ahead.square() + left.square() + 1e-9).sqrt() / self.step
        column = torch.atan2(left, ahead)
        place = torch.stack([column / self.azimuths[-1], 2 * row / (rows - 1) - 1], dim=-1)
        return grid_sample(maps, place, align_corners=True)
