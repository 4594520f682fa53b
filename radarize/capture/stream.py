"""Stream of frames from a separate process, so that no packet is missed while the main process works."""

import contextlib
import signal
import time
from collections.abc import Callable, Iterator
from ctypes import Array, c_double
from dataclasses import astuple, dataclass, fields
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event as Flag
from threading import Event
from typing import Any, TypeVar

import numpy as np

from radarize.capture.ring import CONTEXT, FrameRing
from radarize.io.errors import InputError
from radarize.radar.assembler import PacketCounts
from radarize.radar.config import RadarConfig

#: s between checks of a waiting process whether to end.
GLANCE = 0.2
#: s without a frame after which a stream is considered ended.
SILENCE = 5.0
#: s for a process to start, with imports of numpy and pydantic on a busy machine.
_START_PATIENCE = 60.0


@dataclass
class StreamCounts:
    """Counts of a stream.

    Attributes:
        frames: number of frames, lost ones included.
        dropped: number of these that were dropped because the reader was too slow.
        foreign: packets from other senders.
        first: s since 1970, arrival of the first packet; 0 before.
    """

    frames: int = 0
    dropped: int = 0
    foreign: int = 0
    first: float = 0.0


_Counts = TypeVar("_Counts", StreamCounts, PacketCounts)


class Outlet:
    """Writer's end of a stream, used by a source (`Source`)."""

    def __init__(self, ring: FrameRing, stop: Flag, ready: Flag, shared: Array[c_double]):
        self.ring, self._stop, self._ready, self._shared = ring, stop, ready, shared
        self.counts = StreamCounts()

    def ready(self) -> None:
        """Signal that the source is listening."""
        self._ready.set()

    def put(self, time: float, adc: np.ndarray, valid: np.ndarray) -> None:
        """Pass on a frame, or drop and count it."""
        self.counts.dropped += not self.ring.put(self.counts.frames, time, adc, valid)
        self.counts.frames += 1

    def publish(self, packets: PacketCounts) -> None:
        """Publish the packet counts to the reader."""
        self._shared[:] = [*astuple(self.counts), *astuple(packets)]

    @property
    def stopped(self) -> bool:
        """Whether the reader has asked to end when no more frames arrive."""
        return self._stop.is_set() or self.orphaned

    @property
    def orphaned(self) -> bool:
        """Whether the reader's process has ended."""
        reader = parent_process()
        assert reader is not None  # this is the filling process
        return not reader.is_alive()


#: Function that writes to an outlet until it is stopped or finished; runs in another process, so it must be at module
#: level.
Source = Callable[..., None]


class FrameStream:
    """Stream of frames from a source in a separate process; a context manager.

    Args:
        source: see `Source`; called with an `Outlet` and `arguments`.
        arguments: picklable.
        slots: number of frames that may wait before frames are dropped.

    Attributes:
        text: text of the configuration.
    """

    text = ""

    @property
    def facts(self) -> dict[str, object]:
        """Attributes on the origin, for a recording."""
        return {}

    def __init__(self, config: RadarConfig, source: Source, *arguments: object, slots: int = 64):
        self.config = config
        self.ring = FrameRing(config, slots)
        self._stop, self._ready = CONTEXT.Event(), CONTEXT.Event()
        self._counts = CONTEXT.RawArray("d", len(fields(StreamCounts)) + len(fields(PacketCounts)))
        self._failure, failure = CONTEXT.Pipe(duplex=False)
        shared = (self.ring, self._stop, self._ready, self._counts)
        self._process = CONTEXT.Process(target=_fill, args=(source, arguments, shared, failure), daemon=True)

    def __enter__(self) -> "FrameStream":
        self._process.start()
        deadline = time.monotonic() + _START_PATIENCE
        while not self._ready.wait(GLANCE):
            if not self._process.is_alive() or time.monotonic() > deadline:
                self.__exit__()
                raise InputError("the receiving process does not start; is there memory left?")
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.pid is None:
            return
        self._stop.set()
        self._process.join(5 * GLANCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def stop(self) -> None:
        """Ask the source to end; frames in transit can still be read."""
        self._stop.set()

    def frames(self, most: int, patience: float = GLANCE) -> np.ndarray | None:
        """Return the waiting frames, see `FrameRing.get`; None after the last one.

        Raises:
            InputError: the source failed.
        """
        found = self.ring.get(most, patience)
        if found is not None and (len(found) or self._process.is_alive()):
            return found
        with contextlib.suppress(EOFError):
            if self._failure.poll():
                raise InputError(self._failure.recv())
        if found is not None:
            raise InputError(f"the receiving process has died (exit code {self._process.exitcode})")
        return None

    def troubles(self) -> list[str]:
        """Warnings on the stream so far."""
        counts = self.counts
        found = []
        if counts.dropped:
            found.append(f"{counts.dropped} of {counts.frames} frames were dropped: this computer is too slow for them")
        if counts.foreign:
            found.append(f"{counts.foreign} packets came from elsewhere and are ignored")
        return found + self.packets.warnings()

    def silent(self, seconds: float, at_all: bool) -> None:
        """Handle the absence of frames: store the reason, or raise InputError."""

    @property
    def counts(self) -> StreamCounts:
        """Counts of frames so far."""
        return _read(StreamCounts, self._counts[: len(fields(StreamCounts))])

    @property
    def packets(self) -> PacketCounts:
        """Counts of packets so far."""
        return _read(PacketCounts, self._counts[len(fields(StreamCounts)) :])


def _read(kind: type[_Counts], values: list[float]) -> _Counts:
    named = zip(fields(kind), values, strict=True)
    counts: dict[str, Any] = {field.name: value if field.type is float else int(value) for field, value in named}
    return kind(**counts)


def _fill(source: Source, arguments: tuple, shared: tuple, failure: Connection) -> None:
    # The terminal's signals reach this process, too, but the main process ends it after everything has been received.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    outlet = Outlet(*shared)
    try:
        source(outlet, *arguments)
    except InputError as error:
        failure.send(str(error))
    while not outlet.ring.end(GLANCE) and not outlet.orphaned:
        pass


def follow(stream: FrameStream, stopping: Event, *, most: int, frames: int | None = None) -> Iterator[np.ndarray]:
    """Yield batches of frames of `FrameRing.dtype`, until the stream ends, the user stops it, or the count is reached.

    Args:
        stream: open stream; stopped here.
        stopping: event that ends the stream; frames in transit are still yielded.
        most: maximum number of frames in a batch.
        frames: end before the frame with this number.

    Raises:
        InputError: no frame was received, or the source failed.
    """
    stopped, last, number, came = False, time.monotonic(), -1, 0
    patience = SILENCE + 2 * stream.config.frame_period
    while (found := stream.frames(most)) is not None:
        if len(found):
            number = int(found["number"][-1])
            wanted = found if frames is None else found[found["number"] < frames]
            if len(wanted):
                yield wanted
            last = time.monotonic()  # without the time taken by the reader
        if (received := stream.packets.received) > came:  # a frame may be long
            came, last = received, time.monotonic()
        silent = time.monotonic() - last > patience
        enough = frames is not None and number >= frames - 1
        if not stopped and (stopping.is_set() or enough or silent):
            if silent:
                stream.silent(patience, number < 0)
            stopped = True
            stream.stop()
