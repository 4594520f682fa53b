"""Heat maps of a recording as colour images."""

import numpy as np
from jaxtyping import Float, Shaped, UInt8

from radarize.evaluation.report.drawings import LEAKAGE
from radarize.io.recording import Recording
from radarize.radar.array import azimuth_row
from radarize.signal import polar
from radarize.signal.maps import MapMaker, maps_of

#: Maps that are shown; only the first for recordings of pictures, and none for a single virtual antenna.
MAPS = ("range_azimuth", "doppler_azimuth")


class ShownMaps:
    """Range-azimuth and Doppler-azimuth maps of a recording, or its pictures, as colour images."""

    def __init__(self, recording: Recording):
        self.recording, self._pictured = recording, polar.pictured(recording)
        self._maker = None if self._pictured or len(azimuth_row(recording.config)) < 2 else MapMaker(recording.config)

    def of(self, first: int, last: int) -> dict[str, UInt8[np.ndarray, "frame row azimuth 3"]]:
        """Return images of frames first...last-1, by name of the map.

        Raises:
            InputError: see `maps_of`.
        """
        if self._pictured:
            levels = self.recording.rows(polar.PICTURE, first, last).astype(np.float32)
            return {"range_azimuth": colored(levels, np.zeros(polar.ROWS, bool))}
        if self._maker is None:
            return {}
        near = {"range_azimuth": self._maker.heatmaps.ranges < LEAKAGE}
        maps = maps_of(self.recording, first, last, MAPS, self._maker)
        return {
            name: colored(levels.astype(np.float32), near.get(name, np.zeros(levels.shape[1], bool)))
            for name, levels in maps.items()
        }


def colored(
    levels: Float[np.ndarray, "frame row azimuth"], near: Shaped[np.ndarray, "row"]
) -> UInt8[np.ndarray, "frame row azimuth 3"]:
    """Convert maps in dB to colours, from the median to the maximum of rows not `near`; far is up, left is left."""
    from matplotlib import colormaps

    top = levels[:, ~near].max(axis=(1, 2), keepdims=True)
    low = np.median(levels, axis=(1, 2), keepdims=True)
    shade = np.clip((levels - low) / np.maximum(top - low, 1e-6), 0, 1)[:, ::-1, ::-1]
    return colormaps["magma"](shade, bytes=True)[..., :3]
