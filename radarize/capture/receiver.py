"""Data packets of a DCA1000 from the network, put together to frames."""

import socket
import time

from radarize.capture.stream import GLANCE, Outlet
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import HEADER, MAX_PAYLOAD, FrameAssembler, decode

#: Asked for, bytes: half a second at the DCA1000's fastest.
SOCKET_BUFFER = 64 << 20
#: s of samples that may be missing at once before a byte count is taken for damaged.
_LONGEST_GAP = 60.0
#: Packets between two looks at the clock and at whether to stop.
_BLOCK = 64


def enlarge(receiver: socket.socket) -> int:
    """Raise a socket's buffer as far as permitted; returns the bytes it holds."""
    for option in (getattr(socket, "SO_RCVBUFFORCE", 33), socket.SO_RCVBUF):  # beyond the limit for root alone
        try:
            receiver.setsockopt(socket.SOL_SOCKET, option, SOCKET_BUFFER)
            break
        except OSError:
            continue
    return receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2  # Linux reports twice what it was asked for


def buffer_warning(size: int, config: RadarConfig) -> list[str]:
    """A sentence if a socket's buffer holds less than a quarter of a second of samples."""
    wanted = int(0.25 * config.frame_bytes * config.frame_rate)
    if size >= wanted:
        return []
    return [
        f"the UDP buffer holds {size >> 10} KiB, a quarter of a second needs {wanted >> 10}: packets may be lost "
        f"(sudo sysctl net.core.rmem_max={SOCKET_BUFFER})"
    ]


def receive(outlet: Outlet, receiver: socket.socket, sender: str, config: RadarConfig) -> None:
    """A `Source`: frames from packets that `sender` sends to a bound socket, until stopped and nothing more comes."""
    assembler = FrameAssembler(config, max_jump=int(_LONGEST_GAP * config.frame_bytes * config.frame_rate))
    receiver.settimeout(GLANCE)
    buffer = bytearray(HEADER.size + MAX_PAYLOAD + 1)
    view = memoryview(buffer)

    def put(words, valid) -> None:
        time_ = outlet.counts.frames * config.frame_period
        outlet.put(time_, decode(words, config)[0], valid)

    outlet.ready()
    while not outlet.orphaned:
        try:
            for _ in range(_BLOCK):
                size, (address, _) = receiver.recvfrom_into(buffer)
                if address != sender:
                    outlet.counts.foreign += 1
                    continue
                if not outlet.counts.first:
                    outlet.counts.first = time.time()
                for frame in assembler.take(view[:size]):
                    put(*frame)
        except TimeoutError:
            if outlet.stopped:
                break
        outlet.publish(assembler.counts)
    for frame in assembler.finish():
        put(*frame)
    outlet.publish(assembler.counts)
