"""Reading recordings that a writer has open, or that were interrupted, without HDF5's multiple-reader mode.

HDF5 opens such files in that mode only, in which it retries forever, with doubling pauses, if anything is damaged. So
HDF5 gets a superblock that is marked as closed, as `h5clear` would write it.
"""

import io
import os
import struct
from pathlib import Path

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Superblock of version 3 (HDF5 file format specification, II.A): after signature, version and two sizes, flags at byte
#: 11; the base address, the extension's, the end of the file, the root's from byte 12 on; a checksum of all that.
_FLAGS, _END, _CHECKED, _SIZE = 11, slice(28, 36), slice(0, 44), 48
#: Flags: open by a writer, and by one that permits readers.
_OPEN = 0b101
#: Bytes; end of the file given to HDF5, since the file may grow while it is read. HDF5 reads this many bytes before it
#: has the length of its smaller structures, and so may read past the real end.
_FAR, _GLIMPSE = 1 << 50, 4096


class GrowingFile(io.FileIO):
    """File object for `h5py.File` of a recording that may grow.

    Raises:
        OSError: it is shorter than its superblock states, or the superblock is damaged.
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

    def seek(self, offset: int, origin: int = io.SEEK_SET, /) -> int:
        """Set the position; the end of the file is beyond any file system's limit."""
        self._at = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: _FAR}[origin]
        return self._at

    def tell(self) -> int:
        """Return the position of the next bytes."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]  # h5py hands in nothing else
        """Read bytes at the position; zeros past the end.

        Raises:
            OSError: more than `_GLIMPSE` bytes past the end.
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
    """Return whether a writer has the file open, or died with it open."""
    with path.open("rb") as file:
        head = file.read(_SIZE)
    return len(head) == _SIZE and head[:8] == _SIGNATURE and head[8] == 3 and bool(head[_FLAGS] & _OPEN)


def lookup3(data: bytes | bytearray) -> int:
    """Return HDF5's checksum of metadata: Bob Jenkins's lookup3 (burtleburtle.net/bob/c/lookup3.c), 32 bits."""

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
