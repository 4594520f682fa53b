"""Polar pictures as maps that networks see, and what they are made of."""

import numpy as np
from jaxtyping import Float16

from radarize.radar.config import RadarConfig
from radarize.signal import polar
from radarize.signal.batch import Batch
from radarize.signal.maps import Axes, Maker

#: Range bins within reach of a picture; numbers of a bin: real and imaginary part of four antennas.
BINS, NUMBERS = 257, 8


class PictureMaker(Maker):
    """Makes polar pictures of one radar configuration, with the beam that the real ones have.

    Args:
        config: radar configuration.
    """

    maps = {
        "picture": "RadarHD's picture of one loop, 0...255",
        "antennas": "what a picture is made of: four antennas over range, the frame's largest magnitude 1",
    }

    def __init__(self, config: RadarConfig):
        self.config = config

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Rows and columns of a map."""
        if name == "antennas":
            return Axes(BINS, config.range_resolution, np.arange(float(NUMBERS)))
        return Axes(polar.ROWS, polar.RANGES[1], polar.AZIMUTHS)

    def of(self, batch: Batch) -> Float16[np.ndarray, "frame range azimuth"]:
        """Pictures of a batch's frames: those that are known, or as its samples make them."""
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
