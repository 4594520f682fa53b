"""Scans as the published artefact makes them: the first occupied cell of each bearing."""

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
    """Scans of those frames that the artefact uses; the others see nothing."""

    def __init__(self, stream: PublishedStream, segmentation: Network):
        self._stream, self._net = stream, segmentation

    @torch.inference_mode()
    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is seen."""
        used, made = self._stream.maps(batch)
        ranges = np.full((len(batch), len(BEARINGS)), np.inf)
        if len(used):
            with stage("scans"):
                ranges[used] = first_occupied(self._net.estimate(window(self._net, made)[:, None]).numpy())
        return ranges


def first_occupied(likely: Float[np.ndarray, "frame range bearing"]) -> Float[np.ndarray, "frame bearing"]:
    """Range of the first cell that is occupied rather than free per bearing of a scan, m, inf where there is none."""
    cells = likely[:, :, _COLUMNS] > 0.5
    return np.where(cells.any(axis=1), labels.RANGES[cells.argmax(axis=1)], np.inf)
