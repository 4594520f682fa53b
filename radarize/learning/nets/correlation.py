"""Shift between maps: after compensation of the translation, the shift over azimuth between two maps is the rotation;
it is found by correlation over azimuth, range by range, between frames of a window.

The idea is that of FlowNet's correlation layer (Dosovitskiy et al., "FlowNet: learning optical flow with convolutional
networks", 2015), summed over azimuth: a rotation shifts all ranges equally, a sideways step shifts near ranges more,
and a forward step shifts rows against each other.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import grid_sample, normalize, pad

from radarize.signal.maps import AZIMUTHS, Maps


class Moved(nn.Module):
    """Range-azimuth maps as seen from another position with the same heading; cells that no map covers are zero.

    Args:
        step: step between rows, m.
    """

    azimuths: Float[Tensor, "azimuth"]

    def __init__(self, step: float):
        super().__init__()
        self.step = step
        self.register_buffer("azimuths", torch.tensor(AZIMUTHS, dtype=torch.float32), persistent=False)

    def forward(
        self, maps: Float[Tensor, "item map row azimuth"], travel: Float[Tensor, "item 2"]
    ) -> Float[Tensor, "item map row azimuth"]:
        """Return the maps after the sensor has moved by `travel` (forward, left), m."""
        rows = maps.shape[2]
        ranges = self.step * torch.arange(rows, dtype=maps.dtype, device=maps.device)[:, None]
        ahead = ranges * self.azimuths.cos() + travel[:, 0, None, None]
        left = ranges * self.azimuths.sin() + travel[:, 1, None, None]
        row = (ahead.square() + left.square() + 1e-9).sqrt() / self.step
        column = torch.atan2(left, ahead)
        place = torch.stack([column / self.azimuths[-1], 2 * row / (rows - 1) - 1], dim=-1)
        return grid_sample(maps, place, align_corners=True)


class Correlation(nn.Module):
    """Features of each frame from a small convolutional network, correlated between the newest frame and each other
    one.

    Args:
        maps: number of maps of a frame.
        columns: number of columns of a map.
        features: number of features per cell.
        turns: maximum shift between frames to either side, in azimuth columns.
        steps: maximum shift in rows of features (four range bins each).

    Attributes:
        channels: channels of the image, per frame other than the newest.
    """

    spectrum: Float[Tensor, "2 frequency column"]
    shift: Float[Tensor, "2 frequency shift"]

    def __init__(self, maps: int, columns: int, features: int = 8, turns: int = 25, steps: int = 1):
        super().__init__()
        self.steps, self.channels = steps, 2 * steps + 1
        self.features = nn.Sequential(
            nn.Conv2d(maps, features, 5, (2, 1), 2, bias=False),
            nn.BatchNorm2d(features),
            nn.ReLU(),
            nn.Conv2d(features, features, 5, (2, 1), 2),
        )
        # Correlation over azimuth as a product of spectra, computed with small matrices that all runtimes support. They
        # are created on the CPU even on device "meta" (see `load`), where arithmetic would import torch's compiler.
        with torch.device("cpu"):
            waves = torch.arange(columns + 1) * (math.pi / columns)  # of maps twice as wide: shifts do not wrap
            for name, places in (("spectrum", torch.arange(columns)), ("shift", torch.arange(-turns, turns + 1))):
                angles = waves[:, None] * places
                self.register_buffer(name, torch.stack([angles.cos(), -angles.sin()]), persistent=False)
            both = torch.full((columns + 1, 1), 2.0).index_fill(
                0, torch.tensor([0, columns]), 1.0
            )  # both signs of frequency
            self.shift *= both / (2 * columns) / columns**0.5

    def forward(self, maps: Maps, reversed_too: bool = False) -> Float[Tensor, "seen channel band shift"]:
        """Return correlation by shift in range (channel), range (row, of four bins) and shift in azimuth, of all
        windows; then, if requested, of all reversed windows."""
        found = self.features(maps.flatten(0, 1))
        # Only differences between cells contain information on shifts.
        found = normalize(found - found.mean(dim=3, keepdim=True), dim=1, eps=0.1)
        real, imaginary = ((found @ part.T).unflatten(0, maps.shape[:2]) for part in self.spectrum)
        if reversed_too:
            real, imaginary = (torch.cat([part, part.flip(1)]) for part in (real, imaginary))
        rows, image = real.shape[3], []
        for step in range(-self.steps, self.steps + 1):
            here, there = slice(max(0, -step), rows - max(0, step)), slice(max(0, step), rows - max(0, -step))
            a, b = real[:, -1:, :, there], imaginary[:, -1:, :, there]  # newest
            c, d = real[:, :-1, :, here], imaginary[:, :-1, :, here]
            shifted = (a * c + b * d).sum(dim=2) @ self.shift[0] + (b * c - a * d).sum(dim=2) @ self.shift[1]
            image.append(pad(shifted, (0, 0, here.start, rows - here.stop)))
        return torch.cat(image, dim=1)
