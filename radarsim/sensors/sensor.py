"""Interface of a recording's sensors: streams, products, and the rows of some frames."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from radarize.io.recording import Product, Stream
from radarsim.scenario import Frames, Scenario


class Sensor(ABC):
    """Sensor beside the radar, or ground truth.

    Rows of a frame depend only on its time: drifting errors are drawn for the whole motion, noise is keyed by the time
    (`Scenario.rng`).

    Args:
        scenario: scenario of the recording.

    Attributes:
        streams: growing data sets of the recording by path.
        products: data sets written once, by path.
    """

    streams: Mapping[str, Stream]
    products: Mapping[str, Product] = {}

    def __init__(self, scenario: Scenario):
        self.scenario = scenario

    @abstractmethod
    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Rows of each stream: one per frame, or all ticks of its own clock until the next frame. Clocks in s are the
        motion's; those that count frames start with 0 at the first of `frames`."""
