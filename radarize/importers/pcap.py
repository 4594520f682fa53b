"""Network captures (``.pcap``, classic format) of a DCA1000's UDP stream.

Format: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-04.html; link type 1 (Ethernet), IPv4, UDP to port 4098.
"""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from radarize.errors import InputError
from radarize.importers.capture import Batch, Capture, batch_frames
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
_NEXT_GENERATION = b"\x0a\x0d\x0d\x0a"
_ETHERNET = 1
_LONGEST_RECORD = 1 << 18
#: With so many times more bytes lost than the file has, the byte counts are damaged, not the network.
_MOST_LOST = 20


def open_pcap(path: Path, config: RadarConfig, cfg_text: str = "", assumed: tuple[str, ...] = ()) -> Capture:
    """Open a network capture; an incomplete last frame is left out, lost samples are zero and marked.

    Raises:
        InputError: not a classic pcap file of Ethernet packets, or (on reading) without a whole frame.
    """
    expected = path.stat().st_size // config.frame_bytes
    capture = Capture(config, cfg_text, (), expected, assumed)
    capture.batches = _batches(path, capture)
    with path.open("rb") as file:
        _read_header(file, path)
    return capture


def _batches(path: Path, capture: Capture) -> Iterator[Batch]:
    assembler = FrameAssembler(capture.config)
    size = batch_frames(capture.config)
    most_lost = _MOST_LOST * path.stat().st_size
    frames: list[tuple[np.ndarray, np.ndarray]] = []
    yielded = 0
    for frame in _frames(path, capture, assembler):
        if assembler.counts.lost_bytes > most_lost:
            raise InputError(
                f"{path}: lacks more than {most_lost} bytes between its data packets, {_MOST_LOST} times its size; "
                "expected byte counts that grow as packets come"
            )
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


def _frames(path: Path, capture: Capture, assembler: FrameAssembler) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    for time, payload in _payloads(path, capture):
        capture.attributes.setdefault("first_packet_time", time)
        yield from assembler.take(payload)
    yield from assembler.finish()


def _stack(frames: list[tuple[np.ndarray, np.ndarray]], config: RadarConfig) -> Batch:
    words, valid = zip(*frames, strict=True)
    return Batch(decode(np.concatenate(words), config), np.stack(valid))


def _read_header(file, path: Path) -> tuple[str, int]:
    """Byte order and ticks per second."""
    header = file.read(24)
    if header[:4] == _NEXT_GENERATION:
        raise InputError(f"{path}: is in pcapng format, expected classic pcap (convert: editcap -F pcap IN OUT)")
    if header[:4] not in MAGIC or len(header) < 24:
        raise InputError(
            f"{path}: starts with {header[:4].hex() or 'nothing'}, expected the header of a classic pcap file"
        )
    order, ticks = MAGIC[header[:4]]
    link = struct.unpack(order + "I", header[20:])[0] & 0xFFFF
    if link != _ETHERNET:
        raise InputError(f"{path}: has link type {link}, expected {_ETHERNET} (Ethernet)")
    return order, ticks


def _payloads(path: Path, capture: Capture) -> Iterator[tuple[float, bytes]]:
    """Arrival time (s since 1970) and UDP payload of each data packet."""
    with path.open("rb") as file:
        order, ticks = _read_header(file, path)
        record = struct.Struct(order + "IIII")
        while header := file.read(record.size):
            if len(header) < record.size:
                capture.warnings.append(f"{path}: ends within a packet")
                return
            seconds, fraction, length, _ = record.unpack(header)
            data = file.read(length) if length <= _LONGEST_RECORD else b""
            if len(data) < length:
                what = "ends within a packet" if length <= _LONGEST_RECORD else f"has a packet of {length} bytes"
                capture.warnings.append(f"{path}: {what}; what follows is left out")
                return
            if payload := _udp_payload(data):
                yield seconds + fraction / ticks, payload


def _udp_payload(data: bytes) -> bytes | None:
    """Payload of an Ethernet frame that carries IPv4 and UDP to the data port, else None."""
    start = 18 if data[12:14] == b"\x81\x00" else 14  # with or without a VLAN tag
    if len(data) < start + 28 or data[start - 2 : start] != b"\x08\x00":
        return None
    if data[start] >> 4 != 4 or data[start + 9] != 17:
        return None
    udp = start + 4 * (data[start] & 0x0F)
    if len(data) < udp + 8:
        return None
    port, length = struct.unpack_from(">HH", data, udp + 2)
    return data[udp + 8 : udp + length] if port == DATA_PORT else None
