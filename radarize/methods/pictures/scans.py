"""Scans by the network on polar pictures."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from radarize.batch import Batch
from radarize.features.windows import Shown
from radarize.mapping.scans import BEARINGS
from radarize.methods.method import Inputs
from radarize.methods.pictures.maps import PictureMaker
from radarize.methods.pictures.network import COLUMNS, PictureNet
from radarize.methods.pictures.points import first_surfaces
from radarize.nets.weights import Header, load
from radarize.polar import azimuths
from radarize.radar.config import RadarConfig
from radarize.stopwatch import stage


class PictureStream:
    """Windows of a stream's pictures, such as a recording holds, or as samples make them.

    Attributes:
        stride: frames from one picture of a window to the next.
    """

    def __init__(self, radar: RadarConfig, header: Header):
        self._windows, self._maker = header.windows(radar), PictureMaker(radar)
        self.stride = self._windows.stride

    def windows(self, batch: Batch) -> Shown:
        """Of the next frames."""
        known = batch.samples is None
        pictures = batch.maps(("picture",)) if known else self._maker(batch.samples, names=("picture",))
        return self._windows.push({"picture": pictures["picture"].astype(np.float16)}, batch.stamps)[0]


class PictureScans:
    """Scans of a stream's frames.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path):
        self._net, header = load(weights, PictureNet, radar)
        self._stream = PictureStream(radar, header)

    @torch.inference_mode()
    def scan(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.mapping.scans.BEARINGS`, m, inf where nothing is seen."""
        with stage("scans"):
            likely = self._net.estimate(self._stream.windows(batch).maps)
            return on_bearings(first_surfaces(likely), BEARINGS)


def on_bearings(
    ranges: Float[np.ndarray, "frame column"], bearings: Float[np.ndarray, "bearing"]
) -> Float[np.ndarray, "frame bearing"]:
    """Ranges of the columns next to some bearings, rad."""
    return ranges[:, np.abs(azimuths(COLUMNS)[:, None] - bearings).argmin(axis=0)]


def scanner(inputs: Inputs) -> PictureScans:
    """With the shipped weights, or those of a folder."""
    return PictureScans(inputs.radar, inputs.weights.of("pictures"))
