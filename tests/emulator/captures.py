"""Real packets, from network captures."""

import struct
from pathlib import Path


def captured(path: Path) -> list[tuple[float, int, bytes]]:
    """Time, port and payload of the UDP packets in a capture."""
    data, at, found = path.read_bytes(), 24, []
    while at < len(data):
        seconds, microseconds, size, _ = struct.unpack_from("<IIII", data, at)
        frame = data[at + 16 : at + 16 + size]
        port, length = struct.unpack_from(">HH", frame, 36)
        found.append((seconds + microseconds * 1e-6, port, frame[42 : 34 + length]))
        at += 16 + size
    return found
