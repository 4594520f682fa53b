"""Virtual IWR1843BOOST with a DCA1000: serial port, capture board and the radar's frame clock.

Commands on the UART start the radar; the radar sends each chirp's samples over LVDS at the end of the chirp; the
board, while recording, sends them as packets.
"""

import threading
import time
from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarsim.emulator.board import Addresses, Board, BoardSockets
from radarsim.emulator.commandline import CommandLine
from radarsim.emulator.disturbance import Disturbance
from radarsim.emulator.feed import Feed
from radarsim.emulator.link import Link
from radarsim.emulator.source import NOT_IN_SAMPLES, Source
from radarsim.emulator.uart import Uart

#: Lag (s) that the radar catches up with after a delay by the machine. If it lags further, or if the source is too
#: slow, its clock is set back and frames are late.
_CATCH_UP = 0.25
_ON_TIME = 5e-3  # s
_WAKE_UP = 1e-3  # s: chirps within this time are sent together, because waking up for each would cost too much
_IDLE = 0.01  # s
_PREPARATION = 120.0  # s, longest time that sensorStart waits for the first frame


class Emulator:
    """Virtual radar and capture board; a context manager.

    Args:
        source: source of the samples.
        addresses: of the board and the capture computer.
        port_link: symbolic link to the serial port to create.
        disturbance: network faults of the packets.
        ahead: time simulated ahead of transmission, s.
        log: takes a line for the user, such as "radar: stopped".

    Attributes:
        port: path of the serial port.
        frames: number of frames sent.
        late: number of times that the radar's clock was set back because the source or this machine was too slow.
        lateness: total delay by this, s.

    Raises:
        InputError: source, address or link cannot be used.
    """

    def __init__(
        self,
        source: Source,
        *,
        addresses: Addresses = Addresses(),  # noqa: B008
        port_link: Path | None = None,
        disturbance: Disturbance | None = None,
        ahead: float = 10.0,
        log: Callable[[str], None] = print,
    ):
        self.source, self._ahead, self._log = source, ahead, log
        self.frames = self.late = 0
        self.lateness = 0.0
        self._running = threading.Event()  # from sensorStart to the end of the last frame
        self._stopping, self._closed = threading.Event(), threading.Event()
        self._left = self._resets = 0
        self._lock = threading.Lock()  # resets and starts come from different threads
        expected = source.expected()
        self._sockets = BoardSockets(addresses, log)
        self.link = Link(self._sockets.data, self._sockets.report, disturbance)
        try:
            self._uart = Uart(lambda: CommandLine(self).execute, port_link)
        except InputError:
            self._sockets.close()
            raise
        self.port = self._uart.path
        self._feed = self._feeding(expected)
        self._sockets.serve(Board(self.link, self._reset, log).execute)
        self._thread = threading.Thread(target=self._live, name="radar", daemon=True)
        self._thread.start()

    def __enter__(self) -> "Emulator":
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._closed.set()
        self._thread.join()
        self._sockets.close()
        self._uart.close()
        self._feed.close()

    @property
    def ready(self) -> int:
        """Number of frames made ahead.

        Raises:
            InputError: the source failed.
        """
        if self._feed.failure:
            raise self._feed.failure
        return self._feed.waiting

    # --- what the command line acts on --------------------------------------------------------------------------------
    def start(self, config: RadarConfig, frames: int) -> None:
        """Start to send frames, and return once the first one is ready.

        Raises:
            InputError: the source has no such configuration, or the radar was reset meanwhile.
        """
        resets = self._resets
        try:
            self.source.check(config)
            self._prepare(config)
        except InputError as error:
            self._log(f"radar: sensorStart refused: {error}")
            raise
        with self._lock:
            if self._resets != resets:
                raise InputError("the radar was reset while it started")
            self._left = frames or -1
            self._stopping.clear()
            self._running.set()
        self._log(f"radar: started, {config.frame_rate:.2f} frames/s of {config.frame_bytes} bytes")

    def stop(self) -> None:
        """Stop at the end of the frame in progress, and return then."""
        self._stopping.set()
        while self._running.is_set() and not self._closed.is_set():
            time.sleep(1e-3)
        self._log(f"radar: stopped; {self}")

    def __str__(self) -> str:
        late = f", {self.late} of them late, {self.lateness:.2f} s in all" if self.late else ""
        return f"{self.frames} frames sent{late}; {self.link.packets} packets"

    def _reset(self) -> None:
        with self._lock:
            self._resets += 1
            self._stopping.set()
        self._uart.reset()

    def _feeding(self, config: RadarConfig) -> Feed:
        self._touched = False
        return Feed(self.source, config, round(self._ahead * config.frame_rate))

    def _prepare(self, config: RadarConfig) -> None:
        """Wait for the source's first frames."""
        made, asked = (c.model_dump(exclude=NOT_IN_SAMPLES) for c in (self._feed.config, config))
        if self._touched or made != asked:
            self._feed.close()
            self._feed = self._feeding(config)
        deadline = time.monotonic() + _PREPARATION
        while not self.ready:
            if self._closed.wait(_IDLE) or time.monotonic() > deadline:
                raise InputError(f"the source gave no frame within {_PREPARATION:g} s")

    # --- the radar's clock --------------------------------------------------------------------------------------------
    def _live(self) -> None:
        while not self._closed.is_set():
            if self._running.is_set():
                try:
                    self._send(self._feed)
                except InputError as error:
                    self._log(f"radar: {error}")
                finally:
                    self._running.clear()
            self.link.advance(time.monotonic() + _IDLE)

    def _send(self, feed: Feed) -> None:
        config = feed.config
        chirps = config.loops * len(config.tx_order)
        together = max(round(_WAKE_UP / config.chirp_time), 1)
        size = config.frame_bytes // chirps
        due = time.monotonic()
        while self._left and not self._stopping.is_set():
            self._touched = True
            starved = not feed.waiting
            if (frame := self._next(feed)) is None:
                if not self._stopping.is_set():
                    self._log(f"radar: end of the source; {self}")
                break
            if (behind := time.monotonic() - due) > (_ON_TIME if starved else _CATCH_UP):
                if not self.late:
                    why = "the source" if starved else "this machine"
                    self._log(f"radar: frame {self.frames + 1} is {behind * 1e3:.0f} ms late: {why} is too slow")
                self.late += 1
                self.lateness += behind
                due += behind
            lvds = memoryview(frame)
            for first in range(0, chirps, together):
                end = min(first + together, chirps)
                self.link.take(lvds[first * size : end * size], due + end * config.chirp_time)
            due += config.frame_period
            self.frames += 1
            self._left -= 1

    def _next(self, feed: Feed) -> bytes | None:
        while not self._stopping.is_set():
            try:
                return feed.next(_IDLE)
            except TimeoutError:
                self.link.advance(time.monotonic())  # a pause may complete the recording
        return None
