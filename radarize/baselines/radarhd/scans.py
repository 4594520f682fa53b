"""Scans by RadarHD: of the picture that it draws, the first surface on each bearing."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch.nn.functional import adaptive_max_pool2d

from radarize.baselines.radarhd.network import RadarHdNet
from radarize.io.stopwatch import stage
from radarize.learning.nets.weights import load
from radarize.pipeline.method import Inputs, Method
from radarize.radar.config import RadarConfig
from radarize.scans import echoes
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS


class RadarHdScans:
    """Scans of a stream's frames.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path):
        self._net, header = load(weights, RadarHdNet, radar)
        self._windows, self._ranges = header.windows(radar, self._net.maker), header.ranges(radar)

    @torch.inference_mode()
    def picture(self, batch: Batch) -> Float[torch.Tensor, "frame range direction"]:
        """Probability of a surface in cells of range and `radarize.baselines.radarhd.network.columns(DRAWN)`."""
        shown = self._windows.push(batch.maps(self._windows.maps), batch.stamps)[0]
        # One by one: a window has 41 maps.
        return torch.cat([self._net.estimate(window[None]) for window in shown.maps])

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is seen."""
        with stage("scans"):
            likely = adaptive_max_pool2d(self.picture(batch), (len(self._ranges), len(BEARINGS))).numpy()
            bins = echoes.first(likely > float(self._net.least), likely)
        return echoes.bins_to_ranges(bins, self._ranges)


def scans(inputs: Inputs) -> RadarHdScans:
    """By the inputs' weights."""
    return RadarHdScans(inputs.radar, inputs.weights.of("radarhd"))


METHOD = Method("RadarHD", scans, ("radarhd",))
