"""Reception of a DCA1000's data packets from the network, and assembly of frames."""

import math
import socket
import time
from collections.abc import Iterator

import numpy as np

from radarize.capture.stream import GLANCE, Outlet
from radarize.radar.assembler import FrameAssembler, PacketCounts
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import HEADER, MAX_PAYLOAD, decode

#: Requested buffer size, bytes: half a second at the DCA1000's highest rate.
SOCKET_BUFFER = 64 << 20
#: Largest number of the board's ports observed until packets of one agree.
_PORTS = 16
#: Tolerance of the radar's clock relative to this computer's: s, and fraction of the time.
_AHEAD, _DRIFT = 2.0, 1e-3
#: Number of packets between checks for a stop.
_BLOCK = 64
#: s after which a stopped receiver ends even if packets still arrive: they are from another sender.
_REST = 5.0


def enlarge(receiver: socket.socket) -> int:
    """Enlarge a socket's buffer as far as permitted; return its size in bytes."""
    for option in (getattr(socket, "SO_RCVBUFFORCE", 33), socket.SO_RCVBUF):  # beyond the limit, for root only
        try:
            receiver.setsockopt(socket.SOL_SOCKET, option, SOCKET_BUFFER)
            break
        except OSError:
            continue
    return receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # Linux reports twice the requested size


def buffer_warning(size: int, config: RadarConfig) -> list[str]:
    """Warning if a socket's buffer holds less than a quarter of a second of samples."""
    wanted = int(0.25 * config.frame_bytes * config.frame_rate)
    if size >= wanted:
        return []
    return [
        f"the UDP buffer holds {size >> 10} KiB, a quarter of a second needs {wanted >> 10}: packets may be lost "
        f"(sudo sysctl net.core.rmem_max={SOCKET_BUFFER})"
    ]


class Origin:
    """Assemble frames from the port of a board's address whose packets form a stream; count those of other ports.

    A board sends from one port, unknown in advance: the first one of which several packets agree.

    Args:
        address: address of the board.
    """

    def __init__(self, address: str, config: RadarConfig):
        self._address, self._config = address, config
        self._rate = config.frame_bytes * config.frame_rate  # bytes/s
        self._known: dict[int, FrameAssembler] = {}
        self._port: int | None = None
        self._since = 0.0
        self.foreign = 0

    def take(self, sender: tuple[str, int], data: bytes | memoryview) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Process a packet of a sender; see `FrameAssembler.take`."""
        address, port = sender
        if address != self._address or self._port not in (None, port):
            self.foreign += 1
            return
        if port not in self._known:
            self._known[port] = FrameAssembler(self._config)
            if len(self._known) > _PORTS:
                self._drop(next(iter(self._known)))
        yield from self._known[port].take(data)
        if self._port is None and self._known[port].begun is not None:
            self._port, self._since = port, time.monotonic()
            for other in self._known.keys() - {port}:
                self._drop(other)

    def _drop(self, port: int) -> None:
        list(self._known[port].finish())
        self.foreign += self._known.pop(port).counts.packets

    def look(self) -> PacketCounts:
        """Update the limit of byte counts from the time, and return statistics of the packets so far."""
        if self._port is None:
            return PacketCounts()
        assembler = self._known[self._port]
        passed = (1 + _DRIFT) * (time.monotonic() - self._since) + _AHEAD
        if assembler.begun is not None:  # otherwise only damaged packets arrived
            assembler.furthest = assembler.begun + self._rate * passed
        return assembler.counts

    def finish(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield the remaining frames at the end of the stream."""
        if self._port is None and self._known:
            self._port = max(self._known, key=lambda port: self._known[port].waiting)
        if self._port is not None:
            yield from self._known[self._port].finish()


def receive(outlet: Outlet, receiver: socket.socket, sender: str, config: RadarConfig) -> None:
    """A `Source`: frames from packets that `sender` sends to a bound socket, until stopped and all packets in transit
    have arrived."""
    origin = Origin(sender, config)
    receiver.settimeout(GLANCE)
    buffer = bytearray(HEADER.size + MAX_PAYLOAD + 1)
    view = memoryview(buffer)

    def put(words: np.ndarray, valid: np.ndarray) -> None:
        time_ = outlet.counts.frames * config.frame_period
        outlet.put(time_, decode(words, config)[0], valid)

    outlet.ready()
    end = math.inf
    while not outlet.orphaned and (now := time.monotonic()) < end:
        if outlet.stopped:
            end = min(end, now + _REST)
        try:
            for _ in range(_BLOCK):
                size, address = receiver.recvfrom_into(buffer)
                if not outlet.counts.first and address[0] == sender:
                    outlet.counts.first = time.time()
                for frame in origin.take(address, view[:size]):
                    put(*frame)
                if time.monotonic() > now + GLANCE:
                    break
        except TimeoutError:
            if outlet.stopped:
                break
        counts = origin.look()
        outlet.counts.foreign = origin.foreign
        outlet.publish(counts)
    for frame in origin.finish():
        put(*frame)
    outlet.publish(origin.look())
