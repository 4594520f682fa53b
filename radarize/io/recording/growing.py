"""Recordings that a writer has open, or died with open: seen as they are now, without HDF5's multiple-reader mode.

HDF5 refuses such files in any other mode; in that one it tries again without end, with pauses that double, whatever is
damaged. So they are read past its back: with a superblock that says closed, as `h5clear` would leave it.
"""

import io
import os
import struct
from pathlib import Path

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Superblock of version 3 (HDF5 file format specification, II.A): after signature, version and two sizes, flags at byte
#: 11; the base address, the extension's, the end of the file, the root's from byte 12 on; a checksum of all that.
_FLAGS, _END, _CHECKED, _SIZE = 11, slice(28, 36), slice(0, 44), 48
#: In use by a writer, and by one that permits readers.
_OPEN = 0b101
#: Where the file is said to end, bytes: it may grow while it is read. HDF5 looks at so many bytes before it knows how
#: long its smaller structures are, and so may look past the real end.
_FAR, _GLIMPSE = 1 << 50, 4096


class GrowingFile(io.FileIO):
    """A recording with frames still to come, for `h5py.File`.

    Raises:
        OSError: it is shorter than its writer left it, or its superblock is damaged.
    """

    def __init__(self, path: Path):
        super().__init__(path, "rb")
        self._at = 0
        head, size = bytearray(os.pread(self.fileno(), _SIZE, 0)), path.stat().st_size
        end = int.from_bytes(head[_END], "little")
        if size < end:
            raise OSError(f"truncated: has {size} bytes of at least {end}")
        if head[_CHECKED.stop :] != struct.pack("<I", lookup3(head[_CHECKED])):
            raise OSError("its superblock is damaged")
        head[_FLAGS] &= ~_OPEN & 0xFF
        head[_END] = _FAR.to_bytes(8, "little")
        self._head = bytes(head[_CHECKED]) + struct.pack("<I", lookup3(head[_CHECKED]))

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place; the end is far, further than the file system goes."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: _FAR}[whence]
        return self._at

    def tell(self) -> int:
        """Where the next bytes come from."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # h5py hands in nothing else
        """Bytes from where the file stands; zeros past its end.

        Raises:
            OSError: more than a glimpse past the end.
        """
        start, wanted = self._at, len(buffer)
        count = os.preadv(self.fileno(), [buffer], start)
        if count < wanted:
            if wanted > _GLIMPSE or not count:
                raise OSError(f"truncated: has no {wanted} bytes at {start}")
            buffer[count:] = bytes(wanted - count)
        if start < _SIZE:
            buffer[: min(wanted, _SIZE - start)] = self._head[start : start + wanted]
        self._at += wanted
        return wanted


def is_growing(path: Path) -> bool:
    """Whether a writer has the file open, or died with it open."""
    with path.open("rb") as file:
        head = file.read(_SIZE)
    return len(head) == _SIZE and head[:8] == _SIGNATURE and head[8] == 3 and bool(head[_FLAGS] & _OPEN)


def lookup3(data: bytes | bytearray) -> int:
    """HDF5's checksum of metadata: Bob Jenkins's lookup3 (burtleburtle.net/bob/c/lookup3.c), 32 bits."""

    def turned(value: int, bits: int) -> int:
        return (value << bits | value >> 32 - bits) & 0xFFFFFFFF

    state = [(0xDEADBEEF + len(data)) & 0xFFFFFFFF] * 3
    blocks = max(-(-len(data) // 12), 1)
    words = struct.unpack(f"<{3 * blocks}I", bytes(data).ljust(12 * blocks, b"\0"))
    for block in range(blocks):
        state = [(s + w) & 0xFFFFFFFF for s, w in zip(state, words[3 * block : 3 * block + 3], strict=True)]
        a, b, c = 0, 1, 2
        if block < blocks - 1:
            for bits in (4, 6, 8, 16, 19, 4):
                state[a] = (state[a] - state[c]) & 0xFFFFFFFF ^ turned(state[c], bits)
                state[c] = (state[c] + state[b]) & 0xFFFFFFFF
                a, b, c = b, c, a
        else:
            for bits in (14, 11, 25, 16, 4, 14, 24):
                state[c] = ((state[c] ^ state[b]) - turned(state[b], bits)) & 0xFFFFFFFF
                a, b, c = b, c, a
    return state[2]
