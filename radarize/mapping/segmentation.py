"""Scans by the segmentation network: occupancy of every cell, of which each bearing's first is the surface."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Complex64, Float

from radarize.mapping import echoes
from radarize.odometry.learned import Windows
from radarize.training.maps import MapMaker

#: Least probability of a cell that counts as occupied.
LEAST = 0.5


class Segmentation:
    """Scans of a stream's frames.

    Args:
        maker: of the maps; shared with the odometry's networks, so that maps are made once.
        weights: file; the shipped ones if None.
        least: probability from which a cell is occupied: higher leaves fewer ghosts and fewer bearings.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, maker: MapMaker, weights: Path | None = None, least: float = LEAST):
        self._windows, self._ranges = Windows(maker, "segmentation", weights), maker.heatmaps.ranges
        self.least = least

    @torch.inference_mode()
    def occupancy(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float[np.ndarray, "frame range bearing"]:
        """Probability that a cell holds a bearing's first surface, if nothing is before it."""
        return self._windows.net.estimate(self._windows.push(spectrum)[0]).numpy()

    def scan(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.mapping.scans.BEARINGS`, m, inf where nothing is seen."""
        likely = self.occupancy(spectrum)
        bins = echoes.first(likely >= self.least, likely)
        return np.where(np.isfinite(bins), self._ranges[0] + bins * (self._ranges[1] - self._ranges[0]), np.inf)
