"""NumPy's array format."""

from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy

from radarize.errors import InputError, explained


def npy_header(file: BinaryIO, name: str) -> tuple[tuple[int, ...], bool, np.dtype]:
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
