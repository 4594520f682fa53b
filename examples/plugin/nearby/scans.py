"""Scans of what is strong after the loss over range is made up for: ``radarize run --scans nearby``."""

import numpy as np

from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS

#: m: nearer cells hold the transmitter's leakage.
LEAST = 0.3


class NearbyScans:
    """The cell of every bearing with the most power times range^4, which is the same for equal targets at any range."""

    def __init__(self, inputs: Inputs):  # also inputs.radar, inputs.configuration, inputs.weights, inputs.recording
        self.heatmaps = inputs.signal.heatmaps

    def extract(self, batch: Batch) -> np.ndarray:
        """Ranges (frame, bearing), m; inf would be no echo."""
        power = self.heatmaps.range_azimuth_of(batch.spectrum, "capon").numpy()  # (frame, range, azimuth)
        ranges = self.heatmaps.ranges
        weighed = power * np.where(ranges >= LEAST, ranges, 0.0)[:, None] ** 4
        columns = np.abs(self.heatmaps.azimuths[:, None] - BEARINGS).argmin(axis=0)
        return ranges[weighed.argmax(axis=1)][:, columns]


METHOD = Method("strongest echo for its range", NearbyScans)
