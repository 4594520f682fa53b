"""Safe access to foreign HDF5 files: no links to other files, and no data set larger than the file can hold.

HDF5 follows external links, external storage and sources of virtual data sets into any file that the user may read.
Every file is opened here, and one with any of these is refused before anything is read.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import h5py

from radarize.io.errors import InputError
from radarize.io.files import DEFLATE

#: Version of the file format that is written: the oldest that can be read while it grows, hence the most readable.
FORMAT = "v110"
#: Minimum bytes of a compressed chunk.
_PACKED_CHUNK = 16
#: Bytes and chunks that a data set may declare before they are on disk: unflushed frames of a growing file. HDF5 needs
#: about 3 kB of memory per chunk that it reads at once.
_BYTES_AHEAD, _CHUNKS_AHEAD = 64 << 20, 8192


@contextmanager
def open_hdf5(path: Path, content: BinaryIO | None = None, mode: str = "r") -> Iterator[h5py.File]:
    """Open an HDF5 file.

    Args:
        content: file object to read instead of the file.
        mode: ``r``, or ``r+`` to change the file.

    Raises:
        InputError: a part of it is in other files.
        OSError: it cannot be opened.
    """
    with h5py.File(content or path, mode, **({"libver": FORMAT} if mode == "r+" else {})) as file:
        foreign = file.id.links.visit(lambda name: _elsewhere(file, name), info=False)
        if foreign:
            raise InputError(f"{path}: /{foreign} in other files, expected all of it in this one")
        yield file


def _elsewhere(file: h5py.File, name: bytes) -> str | None:
    """Return a description of a link or data set whose content is in other files; None if there is none."""
    kind, shown = file.id.links.get_info(name).type, name.decode(errors="replace")
    if kind == h5py.h5l.TYPE_SOFT:
        return None  # a path within this file, all links of which are checked
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
    """Return a numeric data set that is stored in the file and not larger than its stored bytes allow.

    Args:
        group, name: location of the data set; path: of the file.
        packed: maximum compression ratio.
        ahead: bytes that may be declared before they are on disk.
        kinds: allowed kinds of entries, as in numpy.

    Raises:
        InputError: the data set is not of this kind.
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
