"""Sources of streams for tests; they run in separate processes, which import this module."""

import os
import time

import numpy as np

from radarize.capture.stream import Outlet
from radarize.io.errors import InputError
from radarize.radar.assembler import PacketCounts
from radarize.radar.config import RadarConfig


def frame(config: RadarConfig, number: int) -> np.ndarray:
    """Samples that identify a frame."""
    return np.full(config.frame_shape, number, np.int16)


def count(outlet: Outlet, config: RadarConfig, frames: int, pause: float = 0.0) -> None:
    """Yield frames with consecutive numbers."""
    outlet.ready()
    for number in range(frames):
        outlet.put(number * config.frame_period, frame(config, number), np.ones(config.frame_shape[:2], bool))
        outlet.publish(PacketCounts(received=number + 1))
        time.sleep(pause)


def fail(outlet: Outlet) -> None:
    """Source that fails with a reason."""
    outlet.ready()
    raise InputError("the file is damaged")


def die(outlet: Outlet) -> None:
    """Source that is killed."""
    outlet.ready()
    os._exit(9)


def wait(outlet: Outlet) -> None:
    """Source without frames."""
    outlet.ready()
    while not outlet.stopped:
        time.sleep(0.01)
