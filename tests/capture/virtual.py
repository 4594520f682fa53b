"""A virtual sensor, and our client of it."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from radarize.capture.board import Network
from radarize.capture.sensor import Sensor
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarsim.emulator.disturbance import Disturbance
from radarsim.emulator.emulator import Emulator
from radarsim.emulator.source import Playback
from tests.emulator.rig import BOARD, COMPUTER, free_ports

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


def network() -> Network:
    """Addresses on this machine with ports that nobody uses."""
    return Network(COMPUTER, BOARD, *free_ports())


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


def sensor(emulator: Emulator, where: Network, config: RadarConfig = SMALL) -> Sensor:
    """Our client of a virtual sensor."""
    return Sensor(config, write_cfg(config), "test.cfg", emulator.port, network=where, slots=256)
