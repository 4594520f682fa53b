"""A virtual sensor on free ports, and recordings for it."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from radarize.capture.board import Network
from radarize.capture.sensor import Sensor
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarize.recording import RecordingWriter
from radarsim.emulator.disturbance import Disturbance
from radarsim.emulator.emulator import Emulator
from radarsim.emulator.source import Playback

#: 9,216 bytes a frame, 768 a chirp: neither is a multiple of the packets' 1456.
SMALL = RadarConfig(
    start_frequency=77e9,
    slope=60e12,
    idle_time=20e-6,
    adc_start_time=5e-6,
    ramp_end_time=60e-6,
    samples=48,
    sample_rate=5e6,
    loops=4,
    frame_period=20e-3,
    tx_order=(0, 2, 1),
)


def noise(path: Path, config: RadarConfig, frames: int) -> np.ndarray:
    """Write a recording of random samples; returns them."""
    adc = np.random.default_rng(0).integers(-(2**15), 2**15, (frames, *config.frame_shape), dtype=np.int16)
    with RecordingWriter(path, config) as writer:
        writer.append(adc, np.arange(frames) * config.frame_period)
    return adc


def network() -> Network:
    """Addresses on this machine with ports that nobody uses."""
    ports: list[int] = []
    while len(ports) < 2:
        kinds = socket.AF_INET, socket.SOCK_DGRAM
        with socket.socket(*kinds) as computer, socket.socket(*kinds) as board:
            computer.bind(("127.0.0.1", 0))
            try:
                board.bind(("127.0.0.2", computer.getsockname()[1]))
            except OSError:
                continue
            ports.append(computer.getsockname()[1])
    return Network("127.0.0.1", "127.0.0.2", *ports)


@contextmanager
def emulated(path: Path, disturbance: Disturbance | None = None) -> Iterator[tuple[Emulator, Network]]:
    """A virtual sensor that plays a recording, with its first frames ready."""
    where = network()
    with Emulator(
        Playback(path),
        board=where.dca,
        computer=where.host,
        command_port=where.command_port,
        data_port=where.data_port,
        disturbance=disturbance,
        say=lambda words: None,
    ) as emulator:
        while not emulator.ready:
            time.sleep(0.02)
        yield emulator, where


def sensor(emulator: Emulator, where: Network, config: RadarConfig = SMALL, **more) -> Sensor:
    """Our client of a virtual sensor."""
    return Sensor(config, write_cfg(config), "test.cfg", emulator.port, network=where, **more)
