"""Interface of a recording's sensors: streams, products, and rows for some frames."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from radarize.io.recording import Product, Stream
from radarsim.scenario import Frames, Scenario


class Sensor(ABC):
    """A sensor beside the radar, or a truth that no sensor measures.

    Rows of a frame depend on its instant alone: drifting errors are drawn for the whole motion, noise is keyed by the
    instant (`Scenario.rng`).

    Args:
        scenario: that it is part of.

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
        """Rows of each stream: one a frame, or as many as its own clock ticks until the next. Clocks in s are the
        motion's; those that count frames start with 0 at the first of `frames`."""
