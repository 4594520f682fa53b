"""What damaged and hostile files come to: data sets that declare more than is there."""

import math
from pathlib import Path

import h5py

from radarize.errors import InputError

#: Packed best, deflate makes 1032 bytes of one (zlib's technical details); a chunk takes that many bytes at least.
_DEFLATE, _PACKED_CHUNK = 1032, 16
#: Bytes and chunks that a data set may declare before they are on disk: frames of a growing file that are not flushed
#: yet. HDF5 itself takes some 3 kB for each chunk that it reads at once.
_BYTES_AHEAD, _CHUNKS_AHEAD = 64 << 20, 8192


def dataset(
    group: h5py.Group, name: str, path: Path, packed: float = _DEFLATE, ahead: int = _BYTES_AHEAD
) -> h5py.Dataset:
    """A data set of numbers that lies in the file, and is no larger than what lies there can be.

    Args:
        group, name: where it is; path: of the file.
        packed: bytes that one on disk may stand for.
        ahead: bytes that may be declared before they are on disk.

    Raises:
        InputError: it is not.
        KeyError: there is none of that name.
    """
    data = group[name]
    where = f"{path}: {group.name.rstrip('/')}/{name}"
    if not isinstance(data, h5py.Dataset) or data.shape is None:
        raise InputError(f"{where} is no data set, expected one")
    if data.dtype.kind not in "biufc":
        raise InputError(f"{where} holds {str(data.dtype)[:40]}, expected numbers")
    if data.external or data.is_virtual:
        raise InputError(f"{where} lies in other files, expected all of it in this one")
    chunks = data.chunks or data.shape
    declared = data.dtype.itemsize * max(math.prod(data.shape), math.prod(chunks))
    count = math.prod(-(-rows // length) for rows, length in zip(data.shape, chunks, strict=True) if length)
    stored = data.id.get_storage_size()
    if declared > packed * stored + ahead or count > stored // _PACKED_CHUNK + _CHUNKS_AHEAD:
        raise InputError(
            f"{where} declares {declared} bytes in {count} chunks (shape {data.shape}), but {stored} are in the file"
        )
    return data
