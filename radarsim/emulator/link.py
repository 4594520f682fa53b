"""Data side of the emulated DCA1000: LVDS bytes in, UDP packets out, at the board's rate.

The board fills packets regardless of frame borders, so the end of a frame is sent with the next frame. After 2 s
without data it sends the rest and a status that the recording is completed, as a real board does.
"""

import threading
import time
from collections.abc import Callable

from radarize.radar.dca1000 import MAX_PAYLOAD, Packet
from radarize.radar.dca1000_commands import Status
from radarsim.emulator.disturbance import Disturbance

SILENCE = 2.0  # s
MEMORY = 256 << 20  # the board's, bytes
_NEVER = float("inf")
#: While catching up: speed relative to real time, and longest burst (s), because receivers have small buffers.
_SPEED, _BURST = 4.0, 10e-3
_SHORTEST = 1e-4  # s, shortest wait worth going to sleep for
#: Time on the wire, s: 1456 bytes of samples and 52 of headers and gaps at 1 Gbit/s. With it, delays of 5, 10, 25 and
#: 50 us give 683, 526, 314 and 188 Mbit/s of samples; SPRUIJ4A specifies 706, 545, 325 and 193 including headers.
_WIRE_TIME = 8e-9 * (MAX_PAYLOAD + 52)


class Link:
    """Packetise the radar's bytes and send them at the board's rate.

    Only `advance` and `take`, called from one thread, wait; `start` and `stop` may be called from another.

    Args:
        send: function that sends a UDP payload to the computer's data port.
        report: function that sends a status to its command port.
        disturbance: network faults of the packets.
        clock, sleep: time functions, s.

    Attributes:
        recording: whether the board records: from `start` to `stop` or completion.
        packets: number of packets sent since power-up, before network faults.
    """

    def __init__(
        self,
        send: Callable[[bytes], None],
        report: Callable[[Status], None],
        disturbance: Disturbance | None = None,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ):
        self._send, self._report = send, report
        self._disturb = disturbance or Disturbance()
        self._clock, self._sleep = clock, sleep
        self._lock = threading.Lock()
        self.recording, self.packets = False, 0
        self._credit = _BURST  # s that may be caught up with at once
        self._waited = (clock(), clock())  # until when, and since when
        self._clear()

    def _clear(self) -> None:
        self._waiting = bytearray()
        self._sequence, self._offset = 1, 0
        self._free = 0.0  # earliest time of the next packet
        self._last: float | None = None  # time of the last bytes

    def start(self, delay: float = 25e-6, payload: int = MAX_PAYLOAD) -> None:
        """Record from now on, with `delay` seconds between packets of `payload` bytes."""
        with self._lock:
            self._clear()
            self._spacing, self._payload = delay + _WIRE_TIME, payload
            self.recording = True

    def stop(self) -> None:
        """Send the remaining bytes and stop recording."""
        with self._lock:
            if self.recording:
                self._finish()

    def take(self, data: bytes | memoryview, due: float) -> None:
        """Accept bytes that arrived over LVDS at time `due`; they are lost unless the board records."""
        self.advance(due)
        with self._lock:
            if not self.recording:
                return
            self._last = due
            if len(self._waiting) + len(data) > MEMORY:
                self.recording = False
                self._report(Status.MEMORY_FULL)
                return
            self._waiting += data
        self.advance(due)

    def advance(self, until: float) -> None:
        """Wait until a time and send the packets due before."""
        while True:
            with self._lock:
                departure = self._departure()
            if departure > until:
                break
            self._wait(departure)
            with self._lock:
                self._depart(departure)
        self._wait(until)

    def _wait(self, until: float) -> None:
        now = self._clock()
        if until > now:
            self._credit, left = _BURST, until - now
        else:  # behind: a busy machine held us up
            self._credit = min(self._credit + _SPEED * (now - self._waited[1]), _BURST) - (until - self._waited[0])
            left = -self._credit / _SPEED
        self._waited = until, now
        if left > _SHORTEST:
            self._sleep(left)

    def _departure(self) -> float:
        """Time of the next packet if no more bytes arrive."""
        if not self.recording or self._last is None:
            return _NEVER
        return max(self._free, self._last) if len(self._waiting) >= self._payload else self._last + SILENCE

    def _depart(self, now: float) -> None:
        if self._departure() > now:  # stopped, or started anew, while waiting
            return
        if len(self._waiting) >= self._payload:
            self._packet(self._payload)
            self._free = now + self._spacing
        else:
            self._finish()
            self._report(Status.RECORD_COMPLETED)

    def _finish(self) -> None:
        while self._waiting:
            self._packet(self._payload)
        for packet in self._disturb.rest():
            self._send(packet)
        self.recording = False

    def _packet(self, size: int) -> None:
        payload = bytes(self._waiting[:size])
        del self._waiting[:size]
        for packet in self._disturb(Packet(self._sequence, self._offset, payload).encode()):
            self._send(packet)
        self._sequence += 1
        self._offset += len(payload)
        self.packets += 1
