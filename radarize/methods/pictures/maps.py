"""Polar pictures as maps that networks see."""

import numpy as np

from radarize import polar
from radarize.features.maps import Axes, Maker
from radarize.radar.config import RadarConfig

#: What `levels` reads where no cell of the radar lies, and the least that it reads elsewhere, dB.
FLOOR = -90.0


class PictureMaker(Maker):
    """Makes polar pictures of one radar configuration.

    Args:
        config: radar configuration.
    """

    maps = {
        "picture": "RadarHD's picture of one loop, 0...255",
        "levels": "what a picture is made of before anything is dropped, dB below the largest",
    }

    def __init__(self, config: RadarConfig):
        self.config, self.names = config, tuple(self.maps)

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Rows and columns of a map."""
        return Axes(polar.ROWS, polar.RANGES[1], polar.AZIMUTHS)

    def __call__(self, adc, valid=None, names=None, frames=slice(None)):
        made = {}
        if "picture" in (names or self.names):
            made["picture"] = polar.pictures(adc[frames], self.config).astype(np.float16)
        if "levels" in (names or self.names):
            made["levels"] = np.maximum(polar.levels(adc[frames], self.config), FLOOR).astype(np.float16)
        return made
