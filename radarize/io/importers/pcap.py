"""Import of network captures of a DCA1000's UDP stream: ``.pcap``, and Wireshark's ``.pcapng``.

Formats: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html, and -pcapng-03.html beside it, by dpkt; link
type 1 (Ethernet), IPv4, UDP to port 4098. In a ``.pcapng``, the first interface determines link type and clock.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import dpkt
import numpy as np

from radarize.io.errors import InputError, explained
from radarize.io.importers.bin import configured, other_period
from radarize.io.importers.capture import Capture, CapturedFrames, batch_frames
from radarize.io.importers.datagrams import Datagram, Start, by_start, datagram, starts
from radarize.io.importers.format import Format
from radarize.io.importers.parameters import Given
from radarize.radar.assembler import FrameAssembler
from radarize.radar.config import RadarConfig
from radarize.radar.dca1000 import DATA_PORT, decode

#: Magic number -> byte order and ticks per second of the time stamps.
MAGIC = {
    b"\xd4\xc3\xb2\xa1": ("<", 10**6),
    b"\xa1\xb2\xc3\xd4": (">", 10**6),
    b"\x4d\x3c\xb2\xa1": ("<", 10**9),
    b"\xa1\xb2\x3c\x4d": (">", 10**9),
}
NEXT_GENERATION = b"\x0a\x0d\x0d\x0a"
_ETHERNET = 1
_LONGEST_RECORD = 1 << 18
#: Maximum ratio of lost bytes to the size of the file; above it the byte counts are damaged, not the network.
_MOST_LOST = 20


def open_pcap(path: Path, given: Given) -> Capture:
    """Open a network capture; an incomplete last frame is left out, lost samples are zero and marked.

    Args:
        path: the file.
        given: settings of the radar, and the number of the capture if there are several.

    Raises:
        InputError: not a pcap or pcapng file of Ethernet packets; no complete packet; or (on reading) no complete
            frame.
    """
    config, assumed = given.configure(str(path))
    expected = path.stat().st_size // config.frame_bytes
    capture = Capture(config, given.cfg_text, (), expected, assumed)
    found = _starts(path)
    number = given.capture or 1
    if not 1 <= number <= max(len(found), 1):
        raise InputError(f"{path}: holds {len(found)} captures, but capture is {number}, expected 1 to {len(found)}")
    start = found[number - 1] if found else None
    if start is not None:
        capture.warnings += start.why_lost()
        if start.packets in (start.cut, start.fragments):
            raise InputError(f"{path}: {'; '.join(start.why_lost())}; expected whole packets")
    if len(found) > 1:
        listed = "; ".join(f"{k}: {each}" for k, each in enumerate(found, 1))
        capture.warnings.append(f"{path.name} holds {len(found)} captures ({listed}), and this is capture {number}")
    capture.batches = _batches(path, capture, start)
    return capture


def _starts(path: Path) -> list[Start]:
    return starts(_datagrams(path, []))


def captures(path: Path) -> list[str]:
    """Return descriptions of the captures in a file: one per board, port, and start of the radar."""
    return [str(each) for each in _starts(path)]


def _batches(path: Path, capture: Capture, start: Start | None) -> Iterator[CapturedFrames]:
    assembler = FrameAssembler(capture.config)
    size = batch_frames(capture.config)
    most_lost = _MOST_LOST * path.stat().st_size
    frames: list[tuple[np.ndarray, np.ndarray]] = []
    yielded = 0
    for frame in _frames(path, capture, assembler, start):
        if assembler.counts.lost_bytes > most_lost:
            raise InputError(
                f"{path}: lacks more than {most_lost} bytes between its data packets, {_MOST_LOST} times its size; "
                "expected byte counts that increase with the packets"
            )
        if not yielded and not frames:
            capture.warnings += _misfit(frame[0], capture.config)
        frames.append(frame)
        if len(frames) >= size:
            yielded += len(frames)
            yield _stack(frames, capture.config)
            frames.clear()
    if not yielded and not frames:
        raise InputError(
            f"{path}: holds {assembler.counts.incomplete_bytes} bytes of samples in {assembler.counts.received} data "
            f"packets to UDP port {DATA_PORT}, expected at least one frame of {capture.config.frame_bytes} bytes"
        )
    capture.warnings += assembler.counts.warnings()
    if frames:
        yield _stack(frames, capture.config)


def _misfit(words: np.ndarray, config: RadarConfig) -> list[str]:
    """Return a warning if a frame's samples clearly have another period than configured, as with missing
    transmitters."""
    if (period := other_period(words.tobytes(), config)) is None:
        return []
    loop = config.frame_bytes // 4 // config.loops
    return [
        f"samples repeat every {period} and not every {loop} (TX x RX x samples), expected the configuration of this "
        "capture: give the number of transmitters with --tx"
    ]


def _frames(
    path: Path, capture: Capture, assembler: FrameAssembler, start: Start | None
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for flow, number, packet in by_start(_datagrams(path, capture.warnings)):
        if start is not None and (flow, number) == (start.flow, start.number):
            capture.attributes.setdefault("first_packet_time", packet.time)
            yield from assembler.take(packet.payload)
    yield from assembler.finish()


def _stack(frames: list[tuple[np.ndarray, np.ndarray]], config: RadarConfig) -> CapturedFrames:
    words, valid = zip(*frames, strict=True)
    return CapturedFrames(decode(np.concatenate(words), config), np.stack(valid))


def _datagrams(path: Path, warnings: list[str]) -> Iterator[Datagram]:
    """Yield UDP packets; add a warning if the file ends too early."""
    with path.open("rb") as file:
        packets = _packets(file, path)
        while True:
            try:
                time, data = next(packets)
            except StopIteration:
                return
            except _Broken as error:
                warnings.append(f"{path}: {error}; what follows is left out")
                return
            if (packet := datagram(time, data)) is not None:
                yield packet


class _Broken(Exception):
    """No packet can be read from here on; the message is the reason."""


def _packets(file: BinaryIO, path: Path) -> Iterator[tuple[float, bytes]]:
    """Return arrival time and Ethernet frame of each packet.

    Raises:
        InputError: not a network capture, or not of Ethernet; raised before the first packet is requested.
        _Broken: (on reading) the rest cannot be read.
    """
    magic = file.read(4)
    file.seek(0)
    if magic == NEXT_GENERATION:
        with explained(f"{path}: starts with a broken pcapng section", ValueError, dpkt.Error, struct.error):
            reader = dpkt.pcapng.Reader(_Bounded(file))
        link, packets = reader.datalink(), _next_generation(reader)
    elif magic in MAGIC and len(header := file.read(24)) == 24:
        order, ticks = MAGIC[magic]
        link = struct.unpack(order + "I", header[20:])[0] & 0xFFFF
        packets = _classic(file, struct.Struct(order + "IIII"), ticks)
    else:
        raise InputError(f"{path}: starts with {magic.hex() or 'nothing'}, expected a pcap or pcapng header")
    if link != _ETHERNET:
        raise InputError(f"{path}: has link type {link}, expected {_ETHERNET} (Ethernet)")
    return packets


def _classic(file: BinaryIO, record: struct.Struct, ticks: int) -> Iterator[tuple[float, bytes]]:
    while header := file.read(record.size):
        if len(header) < record.size:
            raise _Broken("ends within a packet")
        seconds, fraction, length, _ = record.unpack(header)
        if length > _LONGEST_RECORD:
            raise _Broken(f"has a packet of {length} bytes")
        data = file.read(length)
        if len(data) < length:
            raise _Broken("ends within a packet")
        yield seconds + fraction / ticks, data


def _next_generation(reader: dpkt.pcapng.Reader) -> Iterator[tuple[float, bytes]]:
    try:
        yield from reader
    except ValueError as error:
        raise _Broken(str(error)) from error
    except (dpkt.Error, struct.error) as error:
        raise _Broken("ends within a packet") from error


class _Bounded:
    """File object that limits each read to the size of a packet, since lengths come from the file itself."""

    def __init__(self, file: BinaryIO):
        self._file = file

    def read(self, size: int) -> bytes:
        if not 0 <= size <= _LONGEST_RECORD:
            raise ValueError(f"has a block of {size + 8} bytes")
        return self._file.read(size)


def _fits(source: Path) -> bool:
    if source.is_dir():
        return False
    with explained(f"{source}: cannot be read", OSError), source.open("rb") as file:
        return file.read(4) in (*MAGIC, NEXT_GENERATION) or source.suffix.lower() in (".pcap", ".pcapng")


FORMAT = Format(
    "network capture",
    "a .pcap or .pcapng of its packets",
    _fits,
    lambda source, given, _: open_pcap(source, configured(source, given)),
    options=("capture",),
    captures=captures,
)
