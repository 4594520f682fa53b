"""Networks at work on a real walk's pictures: points, and first surfaces of those that tell them."""

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
    """A network that goes through a walk once.

    Args:
        path: of its weights.

    Raises:
        InputError: no such weights, or they are for another radar.
    """

    network: type[Network]

    def __init__(self, path: Path):
        self.net, header = load(path, self.network, PRESETS["radarhd"])
        self._windows = header.windows(PRESETS["radarhd"], self.network.maker)

    @torch.inference_mode()
    def see(self, pictures: UInt8[np.ndarray, "frame range azimuth"], times: Float[np.ndarray, "frame"]) -> Seen:
        """What it sees in a walk's next pictures, by their times (s)."""
        shown = self._windows.push({"picture": pictures.astype(np.float16)}, times)[0]
        return self._told(self.net.estimate(shown.maps), times)

    @abstractmethod
    def _told(self, likely: Tensor, times: Float[np.ndarray, "frame"]) -> Seen:
        """What its estimates say."""


class _Distributions(Reader):
    """Ours: `radarize.baselines.pictures`."""

    network = PictureNet

    def __init__(self, path: Path):
        super().__init__(path)
        self._memory = Memory()

    def _told(self, likely, times):
        # Maps average over time themselves: their scans are each frame's own.
        cells = points(self._memory.push(likely, times), self.net.dense).numpy()
        return cells, on_bearings(first_surfaces(likely), BEARINGS)


class _Drawings(Reader):
    """RadarHD's: each cell that is likely enough is a point."""

    network = RadarHdPictureNet

    def _told(self, likely, times):
        return (likely > self.net.least).numpy(), None


#: By what tables call them.
READERS: dict[str, type[Reader]] = {"network": _Distributions, "radarhd-simulated": _Drawings}


def readers(weights: Weights) -> dict[str, Reader]:
    """Those whose weights are there."""
    paths = {name: weights.of(kind.network.kind) for name, kind in READERS.items()}
    return {name: READERS[name](path) for name, path in paths.items() if path.is_file()}
