"""Inference of networks on the pictures of a real walk: points, and first surfaces where a network estimates them."""

from abc import ABC, abstractmethod
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from radarize.baselines.pictures.memory import Memory
from radarize.baselines.pictures.network import PictureNet
from radarize.baselines.pictures.points import first_surfaces, points
from radarize.baselines.pictures.scans import on_bearings
from radarize.baselines.radarhd.network import RadarHdPictureNet
from radarize.baselines.walks.poses import BEARINGS
from radarize.learning.nets.weights import Network, load
from radarize.pipeline.method import Weights
from radarize.radar.presets import PRESETS

#: Cells that hold points, and ranges of first surfaces on `BEARINGS`, m; None: those of the nearest points.
Seen = tuple[Bool[np.ndarray, "frame range column"], Float[np.ndarray, "frame bearing"] | None]


class Reader(ABC):
    """Inference of a network on a stream of pictures.

    Args:
        path: file of the network's weights.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    network: type[Network]

    def __init__(self, path: Path):
        self.net, header = load(path, self.network, PRESETS["radarhd"])
        self._windows = header.windows(PRESETS["radarhd"], self.network.maker)

    @torch.inference_mode()
    def see(self, pictures: UInt8[np.ndarray, "frame range azimuth"], times: Float[np.ndarray, "frame"]) -> Seen:
        """Return points and first surfaces in the next pictures of a walk.

        Args:
            pictures: the radar's pictures, 0...255.
            times: time stamps of the pictures, s.
        """
        shown = self._windows.push({"picture": pictures.astype(np.float16)}, times)[0]
        return self._seen(self.net.estimate(shown.maps), times)

    @abstractmethod
    def _seen(self, likely: Tensor, times: Float[np.ndarray, "frame"]) -> Seen:
        """Convert the network's probabilities to points and first surfaces."""


class _Distributions(Reader):
    """Our network (`radarize.baselines.pictures`)."""

    network = PictureNet

    def __init__(self, path: Path):
        super().__init__(path)
        self._memory = Memory()

    def _seen(self, likely, times):
        # Scans are not averaged over time, because mapping averages them.
        cells = points(self._memory.push(likely, times), self.net.dense).numpy()
        return cells, on_bearings(first_surfaces(likely), BEARINGS)


class _Drawings(Reader):
    """RadarHD's network: each cell above a probability is a point."""

    network = RadarHdPictureNet

    def _seen(self, likely, times):
        return (likely > self.net.least).numpy(), None


#: Networks by their names in the tables.
READERS: dict[str, type[Reader]] = {"network": _Distributions, "radarhd-simulated": _Drawings}


def readers(weights: Weights) -> dict[str, Reader]:
    """Return the networks whose weights are available, by name."""
    paths = {name: weights.of(kind.network.kind) for name, kind in READERS.items()}
    return {name: READERS[name](path) for name, path in paths.items() if path.is_file()}
