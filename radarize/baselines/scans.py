"""Scans by RadarHD: of the picture that it draws, the first surface on each bearing."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Complex64, Float
from torch.nn.functional import adaptive_max_pool2d

from radarize.mapping import echoes
from radarize.mapping.scans import BEARINGS
from radarize.nets.windows import Windows
from radarize.training.maps import MapMaker


class RadarHdScans:
    """Scans of a stream's frames.

    Args:
        maker: of the maps; shared with other networks, so that maps are made once.
        weights: file; the shipped ones if None.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, maker: MapMaker, weights: Path | None = None):
        self._windows, self._ranges = Windows(maker, "radarhd", weights), maker.heatmaps.ranges

    @torch.inference_mode()
    def picture(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float[torch.Tensor, "frame range direction"]:
        """Probability of a surface in cells of range and `radarhd.columns(DRAWN)`."""
        # One by one: a window has 41 maps.
        return torch.cat([self._windows.net.estimate(window[None]) for window in self._windows.push(spectrum)[0].maps])

    def scan(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.mapping.scans.BEARINGS`, m, inf where nothing is seen."""
        likely = adaptive_max_pool2d(self.picture(spectrum), (len(self._ranges), len(BEARINGS))).numpy()
        bins = echoes.first(likely > float(self._windows.net.least), likely)
        return np.where(np.isfinite(bins), self._ranges[0] + bins * (self._ranges[1] - self._ranges[0]), np.inf)
