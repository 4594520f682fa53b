"""UDP packets of a network capture, split into captures of a radar.

There is one capture per board and port, and per start of the radar, at which the board counts packets from 1 again.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

from radarize.radar.dca1000 import DATA_PORT, HEADER, MAX_PAYLOAD

#: Sequence numbers by which packets may step back or forward within a stream, since networks reorder and lose packets;
#: number of consecutive packets that confirm a new start.
_BACK, _ON, _AGREEING = 64, 4096, 4
_MORE_OR_OFFSET = 0x3FFF  # field of an IPv4 header that marks fragments


class Flow(NamedTuple):
    """Source and destination of packets: IPv4 addresses and UDP ports."""

    source: bytes
    source_port: int
    target: bytes
    target_port: int

    def __str__(self) -> str:
        return f"from {'.'.join(map(str, self.source))}:{self.source_port} to port {self.target_port}"


class Datagram(NamedTuple):
    """A UDP packet.

    Attributes:
        time: time of arrival, s since 1970.
        payload: captured payload.
        cut, fragment: why it is incomplete: cut by the snap length of the capture program; split by IP in transmission.
    """

    time: float
    flow: Flow
    payload: bytes
    cut: bool
    fragment: bool

    @property
    def sound(self) -> bool:
        """Whether the packet has a valid length for data of a DCA1000."""
        return HEADER.size < len(self.payload) <= HEADER.size + MAX_PAYLOAD

    @property
    def sequence(self) -> int:
        """Sequence number of a DCA1000 data packet."""
        return HEADER.unpack_from(self.payload)[0]


def datagram(time: float, data: bytes) -> Datagram | None:
    """Return the UDP packet in an Ethernet frame of IPv4; None if there is none, or if it is empty."""
    start = 18 if data[12:14] == b"\x81\x00" else 14  # with or without a VLAN tag
    if len(data) < start + 28 or data[start - 2 : start] != b"\x08\x00":
        return None
    if data[start] >> 4 != 4 or data[start + 9] != 17:
        return None
    total, _, fragment = struct.unpack_from(">HHH", data, start + 2)
    udp = start + 4 * (data[start] & 0x0F)
    if len(data) < udp + 8 or fragment & 0x1FFF:  # a later fragment has no ports
        return None
    source_port, port, length = struct.unpack_from(">HHH", data, udp)
    if not (payload := data[udp + 8 : udp + length]):
        return None
    flow = Flow(data[start + 12 : start + 16], source_port, data[start + 16 : start + 20], port)
    is_fragment = bool(fragment & _MORE_OR_OFFSET)
    return Datagram(time, flow, payload, start + total > len(data) and not is_fragment, is_fragment)


@dataclass
class Start:
    """A capture of a radar in a packet stream.

    Attributes:
        flow, number: addresses of its packets, and the number of the start, from 0.
        time: time of the first packet, s since 1970.
        packets, cut, fragments: number of packets, and of incomplete ones, see `Datagram`.
    """

    flow: Flow
    number: int
    time: float
    packets: int = 0
    cut: int = 0
    fragments: int = 0

    def __str__(self) -> str:
        begun = datetime.fromtimestamp(self.time, UTC).strftime("%H:%M:%S")
        again = f", start {self.number + 1} of the radar" if self.number else ""
        return f"{self.flow}{again}, {self.packets} packets from {begun} UTC"

    def why_lost(self) -> list[str]:
        """Return why samples of received packets are lost, and the remedy."""
        found = (
            (self.cut, "cut by the snap length of the capture program (tcpdump -s 0 keeps them whole)"),
            (
                self.fragments,
                "split into IP fragments, which are not reassembled (an MTU of 1500 bytes prevents that)",
            ),
        )
        return [f"{count} of {self.packets} data packets were {reason}" for count, reason in found if count]


class _Starts:
    """Separates the starts of one flow. A packet far from the stream waits until consecutive packets confirm a start,
    or the stream continues."""

    def __init__(self):
        self.number = 0
        self._newest: int | None = None
        self._waiting: list[Datagram] = []

    def take(self, packet: Datagram) -> Iterator[tuple[int, Datagram]]:
        """Yield packets whose start is known, with its number."""
        sequence, newest = packet.sequence, self._newest
        last = self._waiting[-1].sequence if self._waiting else None
        if newest is None or (
            -_BACK <= sequence - newest <= _ON
            and (sequence != 1 or newest == 1)
            and (sequence == newest + 1 or last is None or sequence != last + 1)
        ):
            yield from self.rest()
            self._newest = max(sequence, newest or 0)
            yield self.number, packet
            return
        if last is not None and not 0 < sequence - last <= _BACK:
            yield from self.rest()
        self._waiting.append(packet)
        if len(self._waiting) == _AGREEING:
            self.number += self._waiting[0].sequence < newest  # else packets were lost
            self._newest = sequence
            yield from self.rest()

    def rest(self) -> Iterator[tuple[int, Datagram]]:
        """Yield the waiting packets."""
        waiting, self._waiting = self._waiting, []
        yield from ((self.number, packet) for packet in waiting)


def by_start(packets: Iterable[Datagram]) -> Iterator[tuple[Flow, int, Datagram]]:
    """Yield packets with flow and number of the start that they belong to, in the order of each flow."""
    flows: dict[Flow, _Starts] = {}
    for packet in packets:
        of_flow = flows.setdefault(packet.flow, _Starts())
        taken = of_flow.take(packet) if packet.sound else [(of_flow.number, packet)]
        yield from ((packet.flow, *each) for each in taken)
    for flow, of_flow in flows.items():
        yield from ((flow, *each) for each in of_flow.rest())


def starts(packets: Iterable[Datagram]) -> list[Start]:
    """Return all captures by time: those to the DCA1000's port, and those to other ports with the DCA1000's byte
    count."""
    found: dict[tuple[Flow, int], Start] = {}
    counted: dict[Flow, int] = {}  # number of packets of a flow with a correct byte count, minus others
    last: dict[Flow, tuple[int, int]] = {}
    for flow, number, packet in by_start(packets):
        start = found.setdefault((flow, number), Start(flow, number, packet.time))
        start.packets, start.cut = start.packets + 1, start.cut + packet.cut
        start.fragments += packet.fragment
        if not packet.sound:
            continue
        sequence, low, high = HEADER.unpack_from(packet.payload)
        offset = low | high << 32
        fits = last.get(flow) == (sequence, offset)
        counted[flow] = counted.get(flow, 0) + (1 if fits else -1)
        last[flow] = sequence + 1, offset + len(packet.payload) - HEADER.size
    radar = [
        each for each in found.values() if each.flow.target_port == DATA_PORT or counted.get(each.flow, 0) >= _AGREEING
    ]
    return sorted(radar, key=lambda each: each.time)
