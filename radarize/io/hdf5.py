"""HDF5 files from elsewhere: all of them lies within them, and no data set declares more than is there.

HDF5 follows what a file says into any other one that its reader may read: external links, external storage, and the
sources of virtual data sets. Every file is opened here, and one with any of these is refused before anything is read.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import h5py

from radarize.io.errors import InputError
from radarize.io.files import DEFLATE

#: Version of the format that is written: the oldest that can be read while it grows, and so read by most.
FORMAT = "v110"
#: Bytes that a packed chunk takes at least.
_PACKED_CHUNK = 16
#: Bytes and chunks that a data set may declare before they are on disk: frames of a growing file that are not flushed
#: yet. HDF5 itself takes some 3 kB for each chunk that it reads at once.
_BYTES_AHEAD, _CHUNKS_AHEAD = 64 << 20, 8192


@contextmanager
def open_hdf5(path: Path, content: BinaryIO | None = None, mode: str = "r") -> Iterator[h5py.File]:
    """A file, opened.

    Args:
        content: to read instead of the file itself.
        mode: ``r``, or ``r+`` to change it.

    Raises:
        InputError: some of it lies in other files.
        OSError: it cannot be opened.
    """
    with h5py.File(content or path, mode, **({"libver": FORMAT} if mode == "r+" else {})) as file:
        foreign = file.id.links.visit(lambda name: _elsewhere(file, name), info=False)
        if foreign:
            raise InputError(f"{path}: /{foreign} in other files, expected all of it in this one")
        yield file


def _elsewhere(file: h5py.File, name: bytes) -> str | None:
    """What of a link lies in other files, if anything: its target, or the target's entries."""
    kind, shown = file.id.links.get_info(name).type, name.decode(errors="replace")
    if kind == h5py.h5l.TYPE_SOFT:
        return None  # a path through this file, of which every link is looked at
    if kind != h5py.h5l.TYPE_HARD:
        return f"{shown} is a link to something"
    item = h5py.h5o.open(file.id, name)
    if not isinstance(item, h5py.h5d.DatasetID):
        return None
    made = item.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL or made.get_external_count():
        return f"{shown} is a data set that lies"
    return None


def dataset(
    group: h5py.Group, name: str, path: Path, packed: float = DEFLATE, ahead: int = _BYTES_AHEAD, kinds: str = "biufc"
) -> h5py.Dataset:
    """A data set of numbers that lies in the file, and is no larger than what lies there can be.

    Args:
        group, name: where it is; path: of the file.
        packed: bytes that one on disk may stand for.
        ahead: bytes that may be declared before they are on disk.
        kinds: of its entries, as numpy calls them.

    Raises:
        InputError: it is not.
        KeyError: there is none of that name.
    """
    data = group[name]
    where = f"{path}: {group.name.rstrip('/')}/{name}"
    if not isinstance(data, h5py.Dataset) or data.shape is None:
        raise InputError(f"{where} is no data set, expected one")
    if data.dtype.kind not in kinds:
        raise InputError(f"{where} holds {str(data.dtype)[:40]}, expected numbers")
    chunks = data.chunks or data.shape
    declared = data.dtype.itemsize * max(math.prod(data.shape), math.prod(chunks))
    count = math.prod(-(-rows // length) for rows, length in zip(data.shape, chunks, strict=True) if length)
    stored = data.id.get_storage_size()
    if declared > packed * stored + ahead or count > stored // _PACKED_CHUNK + _CHUNKS_AHEAD:
        raise InputError(
            f"{where} declares {declared} bytes in {count} chunks (shape {data.shape}), but {stored} are in the file"
        )
    return data
