"""Odometry from polar pictures: scan matching, with yaw rates by a network."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.baselines.pictures.scans import PictureStream
from radarize.baselines.pictures.turns import PictureTurnNet
from radarize.baselines.scan_matching.odometry import ScanMatching
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch


class PictureRates:
    """Yaw rates by a network on polar pictures.

    Attributes:
        span: time span over which each yaw rate is averaged, s.

    Raises:
        InputError: see `PictureStream`.
    """

    def __init__(self, inputs: Inputs):
        self._stream = PictureStream(inputs, PictureTurnNet)
        self.span = self._stream.spacing * inputs.radar.frame_period

    @torch.inference_mode()
    def rates(self, batch: Batch) -> Float[np.ndarray, "frame 2"]:
        """Estimate the yaw rate over the last frames (rad/s) and its variance; NaN where pictures are missing.

        Time spans overlap, so errors of consecutive frames are correlated: variances are larger by the number of frames
        in a span.
        """
        shown = self._stream.windows(batch)
        mean, covariance = self._stream.net.estimate(shown.maps)
        rates = np.column_stack([mean[:, 0] / self.span, self._stream.spacing * covariance[:, 0, 0] / self.span**2])
        return np.where(shown.whole[:, None], rates, np.nan)


def odometry(inputs: Inputs) -> ScanMatching:
    """Make odometry by matching the pipeline's scans, with yaw rates by the network."""
    return ScanMatching(rates=PictureRates(inputs).rates)


METHOD = Method("scan matching, yaw rates by a network", odometry, ("picture-turns",), scans=True)
