"""Polar pictures as input maps of networks, and the antenna signals that they are computed from."""

import numpy as np
from jaxtyping import Float16

from radarize.radar.config import RadarConfig
from radarize.signal import polar
from radarize.signal.batch import Batch
from radarize.signal.maps import Axes, Maker

#: Range bins within the range of a picture; values of a bin: real and imaginary part of four antennas.
BINS, NUMBERS = 257, 8


class PictureMaker(Maker):
    """Computes polar pictures of a radar configuration, with the beam width of the real pictures.

    Args:
        config: radar configuration.
    """

    maps = {
        "picture": "RadarHD's picture of one loop, 0...255",
        "antennas": "range spectra of the four antennas of a picture, relative to the frame's largest magnitude",
    }

    def __init__(self, config: RadarConfig):
        self.config = config

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Return the axes of a map."""
        if name == "antennas":
            return Axes(BINS, config.range_resolution, np.arange(float(NUMBERS)))
        return Axes(polar.ROWS, polar.RANGES[1], polar.AZIMUTHS)

    def of(self, batch: Batch) -> Float16[np.ndarray, "frame range azimuth"]:
        """Return the pictures of a batch's frames: those of the recording, or computed from its samples."""
        if "picture" not in batch.known:
            batch.known |= self(batch.samples, names=("picture",))
        return batch.known["picture"].astype(np.float16, copy=False)

    def __call__(self, adc, valid=None, names=None, frames=slice(None)):
        made = {}
        if "picture" in (names or self.names):
            made["picture"] = polar.pictures(adc[frames], self.config, polar.MEASURED).astype(np.float16)
        if "antennas" in (names or self.names):
            heard = polar.antennas(adc[frames], self.config, polar.MEASURED)[:, :, :BINS].swapaxes(1, 2)
            largest = np.abs(heard[:, polar.LEAKAGE :]).max(axis=(1, 2), keepdims=True)
            heard = (heard / np.maximum(largest, 1e-30)).astype(np.complex64)
            made["antennas"] = np.ascontiguousarray(heard).view(np.float32).astype(np.float16)
        return made
