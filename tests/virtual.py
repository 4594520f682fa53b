"""A virtual radar for tests: recordings to play, addresses that are free, the emulator here or as a command."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tests.interruptible  # noqa: F401
from radarize.capture.board import NetworkAddresses
from radarize.capture.sensor import Sensor
from radarize.io.recording import RecordingWriter
from radarize.radar.cfg import write_cfg
from radarize.radar.config import RadarConfig
from radarsim.emulator.board import Addresses
from radarsim.emulator.emulator import Emulator
from radarsim.emulator.source import Playback, Source

BOARD, COMPUTER = "127.0.0.2", "127.0.0.1"
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
#: Powers of two, as `xwr` wants them; 25 frames/s of 196,608 bytes.
CONFIG = SMALL.model_copy(
    update={"idle_time": 30e-6, "samples": 128, "loops": 32, "frame_period": 40e-3, "tx_order": (0, 1, 2)}
)


def record(path: Path, config: RadarConfig, frames: int) -> np.ndarray:
    """A recording of random samples."""
    adc = np.random.default_rng(0).integers(-(2**15), 2**15, (frames, *config.frame_shape), dtype=np.int16)
    with RecordingWriter(path, config) as writer:
        writer.append(adc, np.arange(frames) * config.frame_period)
    return adc


def network() -> NetworkAddresses:
    """Addresses on this machine with ports that nobody uses."""
    return NetworkAddresses(COMPUTER, BOARD, *free_ports())


def free_ports() -> tuple[int, int]:
    """UDP ports that nobody uses, on the board's address or the computer's."""
    found: list[int] = []
    while len(found) < 2:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as computer,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board,
        ):
            computer.bind((COMPUTER, 0))
            port = computer.getsockname()[1]
            try:
                board.bind((BOARD, port))
            except OSError:
                continue
            found.append(port)
    return found[0], found[1]


@contextmanager
def emulated(source: Path | Source, **options: object) -> Iterator[tuple[Emulator, NetworkAddresses]]:
    """A virtual sensor in this process, by default playing a recording, with its first frames ready."""
    where = network()
    with Emulator(
        Playback(source) if isinstance(source, Path) else source,
        addresses=Addresses(where.dca, where.host, where.command_port, where.data_port),
        **{"log": lambda words: None} | options,
    ) as emulator:
        while not emulator.ready:
            time.sleep(0.02)
        yield emulator, where


def sensor(emulator: Emulator, where: NetworkAddresses, config: RadarConfig = SMALL) -> Sensor:
    """Our client of a virtual sensor."""
    return Sensor(config, write_cfg(config), "test.cfg", emulator.port, network=where, slots=256)


@dataclass
class Running:
    """An emulator's process, its serial port and UDP ports, and, when it has ended, what it output."""

    process: subprocess.Popen
    port: Path
    command_port: int
    data_port: int
    output: str = ""

    @property
    def options(self) -> list[str]:
        """Options of `radarize capture` and `live` for the virtual radar."""
        found = {
            "--port": self.port, "--host": COMPUTER, "--dca": BOARD,
            "--command-port": self.command_port, "--data-port": self.data_port,
        }  # fmt: skip
        return [str(word) for option in found.items() for word in option]


@contextmanager
def emulator(source: Path | str, folder: Path, *options: object) -> Iterator[Running]:
    """`radarsim emulate`, ended by an interrupt."""
    port, ports = folder / "tty", free_ports()
    command = [
        sys.executable, "-m", "radarsim.cli", "emulate", source, "--port-link", port,
        "--command-port", ports[0], "--data-port", ports[1], *options,
    ]  # fmt: skip
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    running = Running(process, port, *ports)
    try:
        assert process.stdout.readline() == f"serial port {running.port}, 115200 baud\n"
        assert "DCA1000 127.0.0.2" in process.stdout.readline()
        yield running
    finally:
        process.send_signal(signal.SIGINT)
        running.output = process.communicate(timeout=60)[0]
    assert process.returncode == 0 and not running.port.is_symlink()
