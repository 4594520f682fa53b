"""Definition of a reader of foreign bytes, and limits on its behaviour."""

import re
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hypothesis.strategies import SearchStrategy

import radarize.io.importers.bag  # noqa: F401 -- imported at first use, and what its libraries take is no input's memory
from radarize.evaluation.report.contents import contents
from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from radarize.radar.config import RadarConfig

RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "recordings"
#: Largest processor time (s) and memory (bytes) of a reader: fixed buffers plus `MOST_TIMES` times the input.
MOST_SECONDS, MOST_MEMORY, MOST_TIMES = 5.0, 96 << 20, 20
#: 3,072 bytes a frame.
CONFIG = RadarConfig(
    start_frequency=77e9, slope=60e12, idle_time=20e-6, adc_start_time=5e-6, ramp_end_time=60e-6, samples=32,
    sample_rate=5e6, loops=2, frame_period=50e-3, tx_order=(0, 2, 1),
)  # fmt: skip
FRAMES = np.random.default_rng(0).integers(-300, 300, (3, *CONFIG.frame_shape), dtype=np.int16)
CUBE = FRAMES[..., 0] + 1j * FRAMES[..., 1].astype(np.float32)


@dataclass(frozen=True)
class Reader:
    """A reader and what it is tried on.

    Attributes:
        inputs: what is drawn.
        place: writes an input's files into an empty folder; gives what `read` takes.
        read: raises InputError to refuse its input.
        size: bytes of an input.
    """

    inputs: SearchStrategy
    place: Callable[[object, Path], object]
    read: Callable[[object], None]
    size: Callable[[object], int] = len


@dataclass(frozen=True)
class Attempt:
    """Result of an input: whether it was read, processor time (s), and additional memory (bytes)."""

    accepted: bool
    seconds: float
    memory: int


def attempt(reader: Reader, data: object, folder: Path) -> Attempt:
    """Place an input in an empty folder, read it, and clear the folder.

    Raises:
        AssertionError: it was refused in other words than a sentence, took too long, or too much memory.
        Exception: whatever else than an InputError the reader raised.
    """
    placed, accepted = reader.place(data, folder), True
    before, start = _peak_memory(anew=True), time.process_time()
    try:
        reader.read(placed)
    except InputError as error:
        accepted, text = False, str(error)
        assert text.isprintable() and 10 < len(text) < 1500, f"{text[:200]!r}... is no sentence"
    seconds, memory = time.process_time() - start, _peak_memory() - before
    assert seconds < MOST_SECONDS, f"took {seconds:.1f} s"
    assert memory < MOST_MEMORY + MOST_TIMES * reader.size(data), f"took {memory >> 20} MiB"
    clear(folder)  # of what failed it stays
    return Attempt(accepted, seconds, memory)


def _peak_memory(anew: bool = False) -> int:
    """Largest resident memory of this process, bytes; `anew`: of all times to come, now (proc(5), clear_refs)."""
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    return 1024 * int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1])


def clear(folder: Path) -> None:
    """Empty a folder."""
    for path in folder.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


def file(name: str) -> Callable[[bytes, Path], Path]:
    """Store an input as a file of a given name."""

    def place(data: bytes, folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return place


def importing(**more) -> Callable[[Path], None]:
    """Import a file, and read the result."""

    def read(path: Path) -> None:
        use(import_recording(path, path.with_name("out.h5"), Given(**({"config": CONFIG} | more))))

    return read


def use(path: Path) -> None:
    """Read a recording like the commands."""
    contents(path)
    with Recording(path) as recording:
        for name in recording.names():
            for read in (recording.describe, recording.read, lambda name: recording.rows(name, 0, 2)):
                try:
                    read(name)
                except InputError:
                    pass  # the others may be sound
        for batch, adc in recording.batches(16):
            assert len(recording.valid(batch.start, batch.stop)) == len(adc)
