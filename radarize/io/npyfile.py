"""Safe reader of NumPy arrays and zip archives of them: declared sizes are checked before unpacking."""

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

#: Maximum compression ratio of numbers in an archive, and bytes that are always allowed.
_PACKED, _ALWAYS = 100, 16 << 20
#: Compression methods that are unpacked piece by piece; pieces of the others have any size.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


def npy_header(file: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Return shape, whether the first axis varies fastest, and type; the file is then at the first entry.

    Raises:
        InputError: not in NumPy's format; `name` is its name in the message.
    """
    with explained(f"{name}: is no array in NumPy's format"):  # it uses Python's tokenizer and parser
        version = npy.read_magic(file)
        reader = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, stored = reader(file)
    if min(shape, default=0) < 0:
        raise InputError(f"{name}: has shape {shape}, expected no negative length")
    return shape, fortran, stored


@contextmanager
def open_npz(source: Path | BinaryIO, name: str) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """Open an archive of arrays; yields it with its members by the names of the arrays.

    Args:
        source: a file, or its content; `name` is its name in errors.

    Raises:
        InputError: not an archive, or compressed by a method without known size.
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
    """Read arrays of numbers in an archive: those of `fields` that it has.

    Args:
        source: a file, or its content; `name` is its name in errors.
        size: size of the archive, bytes.

    Raises:
        InputError: not an archive, entries are not numbers, or it declares far more bytes than it can have.
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
