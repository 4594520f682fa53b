"""Assembly of frames from the data packets of a DCA1000, with packet loss, duplication and reordering."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int16

from radarize.io.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import MAX_PAYLOAD, Packet, check_layout

_ONES = bytes([1]) * MAX_PAYLOAD
#: Number of agreeing packets away from the stream needed to accept that it continues there, and number that may wait.
_AGREEING, _WAITING = 4, 64


@dataclass
class PacketCounts:
    """Statistics of a capture's packets.

    Attributes:
        received, duplicates, late, damaged: packets that were used, had no new data, arrived after their frame was
            completed, or had an impossible header or length.
        stray: packets with byte counts far from all others, or beyond what the radar can have sent.
        lost_bytes: bytes of completed frames that never arrived.
        incomplete_bytes: bytes received of a last frame that is not whole.
    """

    received: int = 0
    duplicates: int = 0
    late: int = 0
    damaged: int = 0
    stray: int = 0
    lost_bytes: int = 0
    incomplete_bytes: int = 0

    @property
    def packets(self) -> int:
        """Total number of packets."""
        return self.received + self.duplicates + self.late + self.damaged + self.stray

    def warnings(self) -> list[str]:
        """Warnings for the user."""
        found = (
            (self.incomplete_bytes, "bytes of an incomplete last frame are left out"),
            (self.lost_bytes, "bytes were lost, their chirps are marked"),
            (self.late, "data packets came too late or again and are ignored"),
            (self.damaged, "data packets have an impossible header or length and are ignored"),
            (self.stray, "data packets have byte counts far from all others and are ignored: damaged, or forged"),
        )
        return [f"{count} {words}" for count, words in found if count]


class _PartialFrame:
    """Bytes of a frame that have arrived so far.

    Bytearrays, since at 60,000 packets a second numpy's cost per call would be too much.
    """

    def __init__(self, size: int):
        self.data = bytearray(size)
        self.arrived = bytearray(size)  # 1 where data arrived
        self.missing = size

    def place(self, start: int, part: memoryview) -> int:
        """Store bytes at their position; return the number of new ones."""
        end = start + len(part)
        fresh = len(part) - self.arrived.count(1, start, end)
        self.data[start:end] = part
        self.arrived[start:end] = _ONES[: len(part)]
        self.missing -= fresh
        return fresh


class _Doubtful:
    """Packets far from the stream: with damaged or forged headers, or the first ones after a gap.

    Args:
        near: distance in bytes within which packets agree with each other.
    """

    def __init__(self, near: int):
        self._near = near
        self._groups: list[list[Packet]] = []

    def __len__(self) -> int:
        return sum(map(len, self._groups))

    def add(self, packet: Packet) -> list[Packet]:
        """Add a packet; return the packets accepted together with it, none if there are not enough."""
        group = next((g for g in self._groups if abs(packet.offset - g[-1].offset) <= self._near), None)
        if group is None:
            self._groups.append(group := [])
        group.append(packet)
        if len({each.offset for each in group}) < _AGREEING:
            return []
        self._groups.remove(group)
        return group

    def drop(self, all_of_them: bool = False) -> int:
        """Discard packets that have waited too long, or all; return their number."""
        before = len(self)
        while self._groups and (all_of_them or len(self) > _WAITING):
            del self._groups[0]
        return before - len(self)

    def last(self) -> list[Packet]:
        """Return the largest group at the end of the stream."""
        return self._groups.pop(int(np.argmax(list(map(len, self._groups))))) if self._groups else []


class FrameAssembler:
    """Assemble frames from packets that arrive late, twice, out of order, or never.

    A payload is stored at its byte count, so a lost packet never shifts later data. A frame is completed, in
    order, when it is whole or when the newest byte is `window` bytes past its end; missing samples are then zero, and
    their chirps are marked.

    A single packet moves the stream by at most `window`. It moves further, or starts, only if several packets agree,
    with no packet between them that continues at the old position.

    Args:
        window: distance in bytes behind the newest byte up to which a late packet is accepted.

    Attributes:
        begun: byte count at the start of the stream; None before.
        furthest: upper limit of byte counts, which the caller may set from the elapsed time.
    """

    def __init__(self, config: RadarConfig, window: int = 1 << 20):
        check_layout(config)
        self.config = config
        self._size = config.frame_bytes
        self.window = window
        self.counts = PacketCounts()
        self.begun: int | None = None
        self.furthest = float("inf")
        self._first = self._next = 0  # numbers of the first frame, even if its start was not received, and of the next
        self._newest = 0  # largest end of a payload
        self._partial: dict[int, _PartialFrame] = {}
        self._doubtful = _Doubtful(window)

    def take(self, data: bytes | memoryview) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Accept a UDP payload like `add`; one that is no data packet is counted as damaged."""
        try:
            packet = Packet.decode(data)
        except InputError:
            self.counts.damaged += 1
            return
        yield from self.add(packet)

    def add(self, packet: Packet) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Accept a packet and yield the frames it completes, see `_settle`."""
        end = packet.offset + len(packet.payload)
        if end > self.furthest:
            self.counts.stray += 1
        elif self._follows(packet.offset, end):
            if end > self._newest:
                self._newest = end
                if self._doubtful:
                    self.counts.stray += self._doubtful.drop(all_of_them=True)
            self._place(packet)
            yield from self._settled()
        elif accepted := self._doubtful.add(packet):
            yield from self._go_on(accepted)
        else:
            self.counts.stray += self._doubtful.drop()

    @property
    def waiting(self) -> int:
        """Number of packets not accepted yet."""
        return len(self._doubtful)

    def _follows(self, start: int, end: int) -> bool:
        """Whether a payload is near the stream. Until the first frame is complete, the start may still be revised."""
        if self.begun is None or end > self._newest + self.window:
            return False
        return self._next > self._first or start >= self.begun - self.window

    def _go_on(self, packets: list[Packet]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Start the stream, or continue it after a gap, at packets that agree."""
        lowest = min(packet.offset for packet in packets)
        if self._next == self._first and not (self.begun is not None and lowest > self._newest):
            self.counts.stray += self._forget()
            self.begun = lowest
            # A receiver may start in the middle of a capture.
            self._first = self._next = -(-lowest // self._size) if lowest > self.window else 0
            self._newest = lowest
        for packet in packets:
            self._newest = max(self._newest, packet.offset + len(packet.payload))
            self._place(packet)
        yield from self._settled()

    def _forget(self) -> int:
        """Revise the start of the stream; return the number of packets discarded."""
        taken = self.counts.received + self.counts.duplicates + self.counts.late
        self.counts.received = self.counts.duplicates = self.counts.late = 0
        self._partial.clear()
        return taken

    def finish(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """At the end of the stream, yield the remaining frames whose last byte, or a later one, was received."""
        if self.begun is None:
            if packets := self._doubtful.last():
                yield from self._go_on(packets)
        self.counts.stray += self._doubtful.drop(all_of_them=True)
        while self._newest >= (self._next + 1) * self._size:
            yield self._settle()
        self.counts.incomplete_bytes = sum(len(p.data) - p.missing for p in self._partial.values())
        self._partial.clear()

    def _settled(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        while self._newest >= (self._next + 1) * self._size + self.window or self._whole(self._next):
            yield self._settle()

    def _place(self, packet: Packet) -> None:
        size = self._size
        payload = memoryview(packet.payload)
        taken = fresh = 0
        while taken < len(payload):
            number, start = divmod(packet.offset + taken, size)
            part = payload[taken : taken + size - start]
            taken += len(part)
            if number < self._next:
                continue
            if (partial := self._partial.get(number)) is None:
                partial = self._partial[number] = _PartialFrame(size)
            fresh += partial.place(start, part)
        if fresh:
            self.counts.received += 1
        elif packet.offset + len(payload) <= self._next * size:
            self.counts.late += 1
        else:
            self.counts.duplicates += 1

    def _whole(self, number: int) -> bool:
        return number in self._partial and not self._partial[number].missing

    def _settle(self) -> tuple[Int16[np.ndarray, "word"], Bool[np.ndarray, "loop tx"]]:
        """Complete the next frame: its words as captured, for `decode`, and which chirps (physical order) are whole."""
        partial = self._partial.pop(self._next, None) or _PartialFrame(self._size)
        self._next += 1
        self.counts.lost_bytes += partial.missing
        loops, tx = self.config.frame_shape[:2]
        fired = np.asarray(np.frombuffer(partial.arrived, bool).reshape(loops, tx, -1).all(axis=2))
        words = np.frombuffer(partial.data, "<i2").astype(np.int16, copy=False)
        return words, fired[:, list(self.config.slot)]
