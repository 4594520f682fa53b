"""Odometry from polar pictures: their scans are matched, and a network tells turns."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from radarize.batch import Batch
from radarize.methods.method import Inputs
from radarize.methods.pictures.scans import PictureStream
from radarize.methods.pictures.turns import PictureTurnNet
from radarize.methods.scan_matching.odometry import ScanMatching
from radarize.nets.weights import load
from radarize.pipeline import Scanner
from radarize.radar.config import RadarConfig


class PictureRates:
    """Rates of turning by the network on polar pictures.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path):
        self._net, header = load(weights, PictureTurnNet, radar)
        self._stream = PictureStream(radar, header)
        self._span = header.windows(radar).stride * radar.frame_period

    @torch.inference_mode()
    def rates(self, batch: Batch) -> Float[np.ndarray, "frame 2"]:
        """Rate of turning over the last frames (rad/s) and its variance; NaN where pictures are missing.

        Spans overlap, so that as many rates as fit into one have much the same error: each counts as a share.
        """
        shown = self._stream.windows(batch)
        mean, covariance = self._net.estimate(shown.maps)
        alike = self._stream.stride
        told = np.column_stack([mean[:, 0] / self._span, alike * covariance[:, 0, 0] / self._span**2])
        return np.where(shown.whole[:, None], told, np.nan)


def odometry(inputs: Inputs, scanner: Scanner) -> ScanMatching:
    """By the pipeline's scans."""
    return ScanMatching(scanner, rates=PictureRates(inputs.radar, inputs.weights.of("picture-turns")).rates)
