"""NumPy's array format, and zip archives of it: what a file declares is checked before any of it is unpacked."""

import math
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, BinaryIO

import numpy as np
from numpy.lib import format as npy

from radarize.io.errors import InputError, explained
from radarize.io.files import regular

#: Bytes of numbers that one of an archive may unpack to, and bytes that any may.
_PACKED, _ALWAYS = 100, 16 << 20
#: Ways of packing that are unpacked piece by piece: a piece of the others is as large as they say.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def npy_header(file: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, whether the first axis runs fastest, and type; the file then stands at the first entry.

    Raises:
        InputError: no such file; `name` is what it is called there.
    """
    with explained(f"{name}: is no array in NumPy's format"):  # Python's own tokenizer and parser are at work there
        version = npy.read_magic(file)
        reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, stored = reader(file)
    if min(shape, default=0) < 0:
        raise InputError(f"{name}: has shape {shape}, expected no negative length")
    return shape, fortran, stored


@contextmanager
def open_npz(source: Path | BinaryIO, name: str) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """An archive of arrays, with its members by the names of the arrays.

    Args:
        source: a file, or its content; `name` is what errors call it.

    Raises:
        InputError: it is none, or packed in a way that does not tell how much it makes.
    """
    if isinstance(source, Path):
        regular(source, "arrays (.npz)")
    with explained(f"{name}: is no readable .npz"), zipfile.ZipFile(source) as archive:
        members = {info.filename[:-4]: info for info in archive.infolist() if info.filename.endswith(".npy")}
        for key, info in members.items():
            if info.compress_type not in _METHODS:
                raise InputError(f"{name}: {key} is packed by method {info.compress_type}, expected stored or deflated")
        yield archive, members


def read_npz(source: Path | BinaryIO, name: str, fields: Sequence[str], size: int) -> dict[str, np.ndarray]:
    """Arrays of numbers in an archive; those of `fields` that it has.

    Args:
        source: a file, or its content; `name` is what errors call it.
        size: of the archive, bytes.

    Raises:
        InputError: it is none, holds something else than numbers, or declares far more than it can hold.
    """
    with open_npz(source, name) as (archive, members):
        there, declared = [field for field in fields if field in members], 0
        for field in there:
            with archive.open(members[field]) as packed:
                shape, _, stored = npy_header(packed, f"{name}: {field}")
            if stored.kind not in "biuf":
                raise InputError(f"{name}: {field} holds {str(stored)[:40]}, expected numbers")
            declared += math.prod(shape) * max(stored.itemsize, 8)  # they are read as floats
        if declared > _PACKED * size + _ALWAYS:
            raise InputError(f"{name}: declares {declared} bytes of numbers, but has {size} bytes")
        with explained(f"{name}: is damaged"):
            found = {}
            for field in there:
                with archive.open(members[field]) as packed:
                    found[field] = npy.read_array(packed, allow_pickle=False)
            return found
