"""What every sensor of a recording is: streams and products, and rows for each batch of frames."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int16

from radarize.radar.config import RadarConfig
from radarize.recording import Product, Stream
from radarsim.motion import Motion
from radarsim.physics.echoes import Echoes
from radarsim.physics.frontend import FrontEnd
from radarsim.scene.scene import Scene
from radarsim.sensors.sight import Sight


@dataclass(frozen=True)
class Rig:
    """Where sensors are mounted: beside a radar that moves through a scene.

    Attributes:
        scene: the world.
        motion: of the radar.
        config: radar configuration.
        front_end: of the radar.
        sight: first surfaces of the scene, things that move included.
    """

    scene: Scene
    motion: Motion
    config: RadarConfig
    front_end: FrontEnd
    sight: Sight


@dataclass(frozen=True)
class Frames:
    """A batch of simulated frames.

    Attributes:
        times: start of each frame's first chirp, s.
        samples: I/Q.
        echoes: of each frame.
        lengths: path lengths of each frame's echoes, see `Echoes.lengths`.
        received: amplitudes of each frame's echoes behind the IF filters.
        by_cause: counts by cause before noise and converter, where asked for.
    """

    times: Float[np.ndarray, "frame"]
    samples: Int16[np.ndarray, "frame loop tx rx sample 2"]
    echoes: list[Echoes]
    lengths: list[Float[np.ndarray, "echo virtual 3"]]
    received: list[Complex[np.ndarray, "echo"]]
    by_cause: Complex[np.ndarray, "frame cause loop tx rx sample"] | None = None

    def __len__(self) -> int:
        return len(self.times)


class Sensor(ABC):
    """A sensor on a rig, or a truth that no sensor measures.

    Sensors see every batch of frames once, in order, and may keep a state (a bias, a drift).

    Attributes:
        streams: growing data sets of the recording by path.
        products: data sets written once, by path.
        of_radar: whether it looks at the radar's echoes or samples, rather than at the world.
    """

    of_radar: bool = False
    streams: Mapping[str, Stream]
    products: Mapping[str, Product] = {}

    @abstractmethod
    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Rows of each stream for a batch of frames: one a frame, or as many as its own clock ticks until the next."""


class Ticker:
    """Instants at which a sensor with a rate of its own samples, batch by batch.

    Args:
        config: radar configuration.
        rate: Hz; the first sample is taken at time 0.
    """

    def __init__(self, config: RadarConfig, rate: float):
        self.period, self._frame_period, self._next = 1 / rate, config.frame_period, 0

    def __call__(self, frames: Frames) -> Float[np.ndarray, "tick"]:
        """Instants from the last batch's end to the start of the frame after `frames`, s."""
        end = int(np.ceil((frames.times[-1] + self._frame_period) / self.period - 1e-6))
        ticks = np.arange(self._next, end) * self.period
        self._next = end
        return ticks
