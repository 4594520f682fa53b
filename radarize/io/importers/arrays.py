"""Arrays in files, read in slices: ``.npy``, ``.npz`` and MATLAB's ``.mat``. Nothing in them is executed."""

import math
import tempfile
import zipfile
from abc import ABC, abstractmethod
from contextlib import ExitStack
from pathlib import Path
from typing import Literal

import h5py
import numpy as np

from radarize.io.errors import InputError, explained
from radarize.io.files import DEFLATE
from radarize.io.hdf5 import dataset, open_hdf5
from radarize.io.npyfile import npy_header, open_npz

#: Bytes of a compressed member unpacked at a time.
_PIECE = 1 << 18
#: Kinds of entries, as in numpy: numbers, and pairs of them.
_KINDS = "iufcV"


class ArrayFile(ABC):
    """Interface of an array in a file.

    Attributes:
        name: name in errors.
        shape: shape of the array.
        dtype: type of its entries, complex for pairs of real and imaginary part.
    """

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype

    def take(self, axis: int, start: int, stop: int) -> np.ndarray:
        """Return entries start to stop - 1 along an axis."""
        return self._take(tuple(slice(start, stop) if k == axis else slice(None) for k in range(len(self.shape))))

    @abstractmethod
    def _take(self, where: tuple[slice, ...]) -> np.ndarray: ...

    def reshaped(self, shape: tuple[int, ...]) -> None:
        """Interpret the entries in their order as an array of another shape.

        Raises:
            InputError: the number of entries differs, or their order is not unique.
        """
        if math.prod(shape) != math.prod(self.shape):
            raise InputError(
                f"{self.name}: has {math.prod(self.shape)} entries (shape {self.shape}), "
                f"expected the {math.prod(shape)} of shape {shape}"
            )
        if shape != self.shape:
            self._reshape(shape)
            self.shape = shape

    def _reshape(self, shape: tuple[int, ...]) -> None:
        raise InputError(f"{self.name}: is stored with its first axis running fastest, expected names for its axes")


class MappedArray(ArrayFile):
    """An array at an offset in a file; mapped again for every slice, so that memory of earlier slices is released."""

    def __init__(self, name: str, path: Path, header: tuple[tuple[int, ...], bool, np.dtype], offset: int):
        self.name, self._path, self._offset = name, path, offset
        self.shape, self._fortran, stored = header
        self._stored, self.dtype = stored, _checked(stored, name)
        size, expected = path.stat().st_size - offset, math.prod(self.shape) * stored.itemsize
        if size < expected:
            raise InputError(f"{name}: holds {size} bytes, expected {expected} for shape {self.shape} of {stored}")

    def _take(self, where: tuple[slice, ...]) -> np.ndarray:
        order: Literal["F", "C"] = "F" if self._fortran else "C"
        mapped = np.memmap(self._path, self._stored, "r", self._offset, self.shape, order)
        return _joined(np.array(mapped[where]), self.dtype)

    def _reshape(self, shape: tuple[int, ...]) -> None:
        if self._fortran and len(self.shape) > 1:
            super()._reshape(shape)
        self._fortran = False


class MemberArray(MappedArray):
    """A compressed array of an ``.npz``, unpacked to a temporary file beside the output."""

    def __init__(self, name: str, archive: zipfile.ZipFile, member: zipfile.ZipInfo, folder: Path):
        self._file = tempfile.NamedTemporaryFile(dir=folder)
        with archive.open(member) as packed:
            header = npy_header(packed, name)
            if member.file_size > DEFLATE * member.compress_size:
                raise InputError(f"{name}: declares {member.file_size} bytes packed in {member.compress_size}")
            while piece := packed.read(_PIECE):
                self._file.write(piece)
        self._file.flush()
        super().__init__(name, Path(self._file.name), header, 0)


class MemoryArray(ArrayFile):
    """An array in a ``.mat`` file up to version 7, which has at most 2 GB and must be read at once."""

    def __init__(self, name: str, values: np.ndarray):
        self.name, self.values, self.shape = name, values, values.shape
        self.dtype = _checked(values.dtype, name)

    def _take(self, where: tuple[slice, ...]) -> np.ndarray:
        return self.values[where]


class MatlabArray(ArrayFile):
    """An array in a ``.mat`` file of version 7.3, which is HDF5 with reversed axes."""

    def __init__(self, path: Path, variable: str | None):
        with ExitStack() as stack:
            file = stack.enter_context(open_hdf5(path))
            data = {name: item for name, item in file.items() if isinstance(item, h5py.Dataset) and item.shape}
            shapes = {name: item.shape[::-1] for name, item in data.items() if item.dtype.kind in _KINDS}
            chosen = _choose(path, variable, shapes)
            self.name, self._data = f"{path}: {chosen}", dataset(file, chosen, path, kinds=_KINDS)
            self.shape, self.dtype = self._data.shape[::-1], _checked(self._data.dtype, self.name)
            self._open = stack.pop_all()  # as long as the array is in use

    def _take(self, where: tuple[slice, ...]) -> np.ndarray:
        with explained(f"{self.name}: is damaged"):
            return _joined(self._data[where[::-1]], self.dtype).T


def open_array(path: Path, variable: str | None, folder: Path) -> ArrayFile:
    """Open an array in a file.

    Args:
        path: ``.npy``, ``.npz`` or ``.mat``.
        variable: name of the array; by default the only numeric one with more than one axis.
        folder: folder for unpacking a compressed array.

    Raises:
        InputError: not such a file, no such array, or an array without numbers.
    """
    with explained(f"{path}: cannot be read"):
        if path.suffix.lower() == ".npz":
            return _open_npz(path, variable, folder)
        if path.suffix.lower() == ".mat":
            return _open_mat(path, variable)
        with path.open("rb") as file:
            header = npy_header(file, str(path))
            return MappedArray(str(path), path, header, file.tell())


def _open_npz(path: Path, variable: str | None, folder: Path) -> ArrayFile:
    with open_npz(path, str(path)) as (archive, members):
        headers = {}
        for name, info in members.items():
            with archive.open(info) as packed:
                headers[name] = npy_header(packed, f"{path}: {name}"), packed.tell()
        shapes = {name: header[0] for name, (header, _) in headers.items() if header[2].kind in _KINDS}
        chosen = _choose(path, variable, shapes)
        member, (header, length) = members[chosen], headers[chosen]
        if member.compress_type != zipfile.ZIP_STORED:
            return MemberArray(f"{path}: {chosen}", archive, member, folder)
    with path.open("rb") as file:  # its bytes lie in the archive as they are, behind a local header
        file.seek(member.header_offset + 26)
        lengths = file.read(4)
    start = member.header_offset + 30 + sum(int.from_bytes(lengths[k : k + 2], "little") for k in (0, 2))
    return MappedArray(f"{path}: {chosen}", path, header, start + length)


def _open_mat(path: Path, variable: str | None) -> ArrayFile:
    if h5py.is_hdf5(path):
        return MatlabArray(path, variable)
    from scipy.io import loadmat, whosmat

    shapes = {name: shape for name, shape, kind in whosmat(path) if kind not in ("cell", "struct", "object")}
    chosen = _choose(path, variable, shapes)
    return MemoryArray(f"{path}: {chosen}", loadmat(path, variable_names=[chosen])[chosen])


def _choose(path: Path, variable: str | None, shapes: dict[str, tuple[int, ...]]) -> str:
    large = [name for name, shape in shapes.items() if sum(length > 1 for length in shape) > 1]
    wanted = variable if variable is not None else large[0] if len(large) == 1 else None
    if wanted in shapes:
        return wanted
    named = [f"{ascii(name[:40])[1:-1]} {'x'.join(map(str, shape))}" for name, shape in shapes.items()]
    found = ", ".join([*named[:12], *(["..."] if len(named) > 12 else [])])
    expected = f"one called {variable}" if variable is not None else "one of samples, or its name as variable"
    raise InputError(f"{path}: has arrays {found or '(none)'}, expected {expected}")


def _checked(stored: np.dtype, name: str) -> np.dtype:
    """Return the type of the entries as numbers."""
    if stored.fields and len(stored.fields) == 2 and all(kind.kind in "iuf" for kind, *_ in stored.fields.values()):
        return np.dtype(np.complex64 if stored.itemsize <= 8 else np.complex128)
    if stored.kind not in "iufc":
        raise InputError(f"{name}: holds {str(stored)[:60]}, expected numbers")
    return stored


def _joined(values: np.ndarray, dtype: np.dtype) -> np.ndarray:
    if not values.dtype.fields:
        return values
    real, imaginary = (values[field] for field in values.dtype.fields)
    return (real + 1j * imaginary.astype(dtype)).astype(dtype, copy=False)
