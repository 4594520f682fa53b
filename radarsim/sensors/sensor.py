"""What every sensor of a recording is: streams and products, and rows for some frames."""

from abc import ABC, abstractmethod
from collections.abc import Mapping

import numpy as np

from radarize.recording import Product, Stream
from radarsim.scenario import Frames, Scenario


class Sensor(ABC):
    """A sensor beside the radar, or a truth that no sensor measures.

    What it gives for some frames depends on nothing else than their instants: errors that drift are laid down for the
    whole motion, noise is drawn by instant (`Scenario.rng`).

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
