"""UDP packets of a network capture, and the captures of a radar that they make.

There is one for each board and port, and for each start of the radar, from which on the board counts from 1 again.
"""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import NamedTuple

from radarize.radar.dca1000 import DATA_PORT, HEADER, MAX_PAYLOAD

#: Packets by which sequence numbers step back or on within a stream, where networks reorder and lose them; and packets
#: in a row that make a new start believed.
_BACK, _ON, _AGREEING = 64, 4096, 4
_MORE_OR_OFFSET = 0x3FFF  # of the field of an IPv4 header that says that a packet is a fragment


class Flow(NamedTuple):
    """Where packets come from and go to: IPv4 addresses and UDP ports."""

    source: bytes
    source_port: int
    target: bytes
    target_port: int

    def __str__(self) -> str:
        return f"from {'.'.join(map(str, self.source))}:{self.source_port} to port {self.target_port}"


class Datagram(NamedTuple):
    """A UDP packet.

    Attributes:
        time: of arrival, s since 1970.
        payload: what was captured of it.
        cut, fragment: why that is not all: by the capture program's snap length; by IP, on the way.
    """

    time: float
    flow: Flow
    payload: bytes
    cut: bool
    fragment: bool

    @property
    def sound(self) -> bool:
        """Whether it is as long as a DCA1000's data packet may be."""
        return HEADER.size < len(self.payload) <= HEADER.size + MAX_PAYLOAD

    @property
    def sequence(self) -> int:
        """Of a DCA1000's data packet."""
        return HEADER.unpack_from(self.payload)[0]


def datagram(time: float, data: bytes) -> Datagram | None:
    """The UDP packet that an Ethernet frame of IPv4 carries; None if there is none, or nothing in it."""
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
    """A capture of a radar among the packets.

    Attributes:
        flow, number: of packets, and which start of it, from 0.
        time: of the first packet, s since 1970.
        packets, cut, fragments: in all; of these, not captured whole, see `Datagram`.
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
        """Why samples of packets that came are lost, and what helps."""
        found = (
            (self.cut, "cut by the snap length of the program that captured them (tcpdump -s 0 keeps them whole)"),
            (
                self.fragments,
                "split into IP fragments, which are not put together (an MTU of 1500 bytes prevents that)",
            ),
        )
        return [f"{count} of {self.packets} data packets were {words}" for count, words in found if count]


class _Starts:
    """Tells the starts of one flow apart. A packet far from the stream waits until some in a row agree with it, or the
    stream goes on."""

    def __init__(self):
        self.number = 0
        self._newest: int | None = None
        self._waiting: list[Datagram] = []

    def take(self, packet: Datagram) -> Iterator[tuple[int, Datagram]]:
        """Packets that are now known to belong to a start, with its number."""
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
        """Those that still wait."""
        waiting, self._waiting = self._waiting, []
        yield from ((self.number, packet) for packet in waiting)


def by_start(packets: Iterable[Datagram]) -> Iterator[tuple[Flow, int, Datagram]]:
    """Packets with the start that they belong to, in the order of each flow."""
    flows: dict[Flow, _Starts] = {}
    for packet in packets:
        of_flow = flows.setdefault(packet.flow, _Starts())
        taken = of_flow.take(packet) if packet.sound else [(of_flow.number, packet)]
        yield from ((packet.flow, *each) for each in taken)
    for flow, of_flow in flows.items():
        yield from ((flow, *each) for each in of_flow.rest())


def starts(packets: Iterable[Datagram]) -> list[Start]:
    """All captures, by time: those to the DCA1000's port, and to others where bytes are counted as it does."""
    found: dict[tuple[Flow, int], Start] = {}
    counted: dict[Flow, int] = {}  # by how much the bytes of a flow's packets are counted rightly
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
