"""Scans by a network on polar pictures."""

import numpy as np
import torch
from jaxtyping import Float

from radarize.baselines.pictures.maps import PictureMaker
from radarize.baselines.pictures.network import COLUMNS, PictureNet
from radarize.baselines.pictures.points import first_surfaces
from radarize.io.stopwatch import stage
from radarize.learning.features.windows import Shown
from radarize.learning.nets.weights import Network, load
from radarize.pipeline.method import Inputs, Method
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS
from radarize.signal.polar import azimuths


class PictureStream:
    """A network with its input: windows of the pictures of a stream, from the recording or computed from samples.

    Args:
        inputs: weights and radar.
        kind: class of the network.

    Attributes:
        net: the network.
        spacing: frames between the pictures of a window.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, inputs: Inputs, kind: type[Network]):
        self.net, header = load(inputs.weights.of(kind.kind), kind, inputs.radar)
        self._windows, self._maker = header.windows(inputs.radar, self.net.maker), PictureMaker(inputs.radar)
        self.spacing = self._windows.spacings[0]

    def windows(self, batch: Batch) -> Shown:
        """Return the windows that end at the next frames."""
        return self._windows.push({"picture": self._maker.of(batch)}, batch.stamps)[0]


class PictureScans:
    """Scan extraction by `PictureNet` from a stream of frames.

    Raises:
        InputError: see `PictureStream`.
    """

    def __init__(self, inputs: Inputs):
        self._stream = PictureStream(inputs, PictureNet)

    @torch.inference_mode()
    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Estimate ranges on `radarize.signal.bearings.BEARINGS`, m; inf without a surface."""
        with stage("scans"):
            likely = self._stream.net.estimate(self._stream.windows(batch).maps)
            return on_bearings(first_surfaces(likely), BEARINGS)


def on_bearings(
    ranges: Float[np.ndarray, "frame column"], bearings: Float[np.ndarray, "bearing"]
) -> Float[np.ndarray, "frame bearing"]:
    """Return the ranges (m) of the columns nearest to bearings (rad)."""
    return ranges[:, np.abs(azimuths(COLUMNS)[:, None] - bearings).argmin(axis=0)]


METHOD = Method("network on polar pictures", PictureScans, ("pictures",), pictures=True)
