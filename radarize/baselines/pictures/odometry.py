"""Odometry from polar pictures: their scans are matched, and a network tells turns."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.baselines.pictures.scans import PictureStream
from radarize.baselines.pictures.turns import PictureTurnNet
from radarize.baselines.scan_matching.odometry import ScanMatching
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch


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


def odometry(inputs: Inputs) -> ScanMatching:
    """By the pipeline's scans."""
    return ScanMatching(rates=PictureRates(inputs).rates)


METHOD = Method("scan matching, turns by a network", odometry, ("picture-turns",), scans=True)
