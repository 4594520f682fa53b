"""Odometry from polar pictures: their scans are matched, and a network tells turns."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.batch import Batch
from radarize.methods.method import Inputs
from radarize.methods.pictures.scans import PictureStream
from radarize.methods.pictures.turns import PictureTurnNet
from radarize.methods.scan_matching.odometry import ScanMatching
from radarize.pipeline import Scanner


class PictureRates:
    """Rates of turning by the network on polar pictures.

    Attributes:
        span: s, over which each is averaged.

    Raises:
        InputError: see `PictureStream`.
    """

    def __init__(self, inputs: Inputs):
        self._stream = PictureStream(inputs, PictureTurnNet)
        self.span = self._stream.spacing * inputs.radar.frame_period

    @torch.inference_mode()
    def rates(self, batch: Batch) -> Float[np.ndarray, "frame 2"]:
        """Rate of turning over the last frames (rad/s) and its variance; NaN where pictures are missing.

        Spans overlap, so that as many rates as fit into one have much the same error: each counts as a share.
        """
        shown = self._stream.windows(batch)
        mean, covariance = self._stream.net.estimate(shown.maps)
        told = np.column_stack([mean[:, 0] / self.span, self._stream.spacing * covariance[:, 0, 0] / self.span**2])
        return np.where(shown.whole[:, None], told, np.nan)


def odometry(inputs: Inputs, scanner: Scanner) -> ScanMatching:
    """By the pipeline's scans."""
    return ScanMatching(scanner, rates=PictureRates(inputs).rates)
