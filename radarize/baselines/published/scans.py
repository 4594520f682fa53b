"""Scans as in the published artefact: the first occupied cell of each bearing."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.baselines.published import labels
from radarize.baselines.published.maps import PublishedStream
from radarize.baselines.published.odometry import window
from radarize.io.stopwatch import stage
from radarize.learning.nets.weights import Network
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS

#: Column of the occupancy label nearest to each bearing of a scan.
_COLUMNS = np.abs(BEARINGS[:, None] - labels.BEARINGS).argmin(axis=1)


class PublishedScans:
    """Scan extraction at the frames that the artefact uses; scans of the other frames are empty."""

    def __init__(self, stream: PublishedStream, segmentation: Network):
        self._stream, self._net = stream, segmentation

    @torch.inference_mode()
    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Estimate ranges on `radarize.signal.bearings.BEARINGS`, m; inf without a surface."""
        used, made = self._stream.maps(batch)
        ranges = np.full((len(batch), len(BEARINGS)), np.inf)
        if len(used):
            with stage("scans"):
                ranges[used] = first_occupied(self._net.estimate(window(self._net, made)[:, None]).numpy())
        return ranges


def first_occupied(likely: Float[np.ndarray, "frame range bearing"]) -> Float[np.ndarray, "frame bearing"]:
    """Return the range of the first cell with an occupancy above 0.5 on each bearing, m; inf without such a cell."""
    cells = likely[:, :, _COLUMNS] > 0.5
    return np.where(cells.any(axis=1), labels.RANGES[cells.argmax(axis=1)], np.inf)
