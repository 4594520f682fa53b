"""A virtual radar for tests: recordings to play, free ports, and the command line's emulator in a process."""

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarize.radar.config import RadarConfig
from radarize.recording import RecordingWriter

BOARD, COMPUTER = "127.0.0.2", "127.0.0.1"
#: Powers of two, as `xwr` wants them; 25 frames/s of 196,608 bytes.
CONFIG = RadarConfig(
    start_frequency=77e9,
    slope=60e12,
    idle_time=30e-6,
    adc_start_time=5e-6,
    ramp_end_time=60e-6,
    samples=128,
    sample_rate=5e6,
    loops=32,
    frame_period=40e-3,
    tx_order=(0, 1, 2),
)


def record(path: Path, config: RadarConfig, frames: int) -> np.ndarray:
    """A recording of random samples."""
    adc = np.random.default_rng(0).integers(-(2**15), 2**15, (frames, *config.frame_shape), dtype=np.int16)
    with RecordingWriter(path, config) as writer:
        writer.append(adc, np.arange(frames) * config.frame_period)
    return adc


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


@dataclass
class Running:
    """An emulator's process: its serial port, its UDP ports, and, when it has ended, what it said."""

    port: Path
    command_port: int
    data_port: int
    said: str = ""


@contextmanager
def emulator(source: Path | str, folder: Path, *options: object) -> Iterator[Running]:
    """`radarsim emulate`, ended by an interrupt."""
    ports = free_ports()
    running = Running(folder / "tty", *ports)
    command = [
        sys.executable, "-m", "radarsim.cli", "emulate", source, "--port-link", running.port,
        "--command-port", ports[0], "--data-port", ports[1], *options,
    ]  # fmt: skip
    process = subprocess.Popen([*map(str, command)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert process.stdout.readline() == f"serial port {running.port}, 115200 baud\n"
        assert "DCA1000 127.0.0.2" in process.stdout.readline()
        yield running
    finally:
        process.send_signal(signal.SIGINT)
        running.said = process.communicate(timeout=60)[0]
    assert process.returncode == 0 and not running.port.is_symlink()
