"""Data packets as a DCA1000 sends them."""

from collections.abc import Iterator

from radarize.radar.dca1000 import MAX_PAYLOAD, Packet


def packets(stream: bytes, sequence: int = 1, offset: int = 0) -> Iterator[Packet]:
    """Cut captured bytes into packets, regardless of frames."""
    for number, start in enumerate(range(0, len(stream), MAX_PAYLOAD), sequence):
        yield Packet(number, offset + start, bytes(stream[start : start + MAX_PAYLOAD]))
