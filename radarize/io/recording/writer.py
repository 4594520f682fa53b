"""Writer of recordings, frame by frame, and adding data to complete ones.

A recording is written to ``NAME.h5.part`` and renamed when it is closed. Frames are flushed about once per second of
recorded time in HDF5's single-writer-multiple-reader mode, so that a reader, also after a crash, sees every flushed
frame. Flushed data is also written to the disk (fsync), at most twice per second of wall-clock time, so that a power
cut loses at most the last second of a capture. The clock of the writing machine affects neither the file nor its
layout: same content, same bytes.
"""

import errno
import os
import shutil
import time as clock
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from isal import isal_zlib
from jaxtyping import Bool, Float, Int16

from radarize import __version__
from radarize.io.errors import FULL, DiskFull, InputError, disk_full, explained, reason
from radarize.io.hdf5 import FORMAT, open_hdf5
from radarize.io.locks import hold
from radarize.io.recording.captured import spare
from radarize.io.recording.losses import Losses
from radarize.io.replacing import replacing
from radarize.radar.config import RadarConfig

#: Bytes reserved on the disk beyond the written ones, for HDF5's own structures. HDF5 writes chunks when it evicts them
#: from its cache, where h5py reports no errors, so their place on the disk is reserved before.
_RESERVE = 512 << 10
#: s, minimum time between two fsync: flushes of a capture come once per second, of an import far more often.
_PACE = 0.5
#: Version of the file layout.
_FORMAT = 1


@dataclass(frozen=True)
class Stream:
    """Description of a data set that grows with the recording, one row per appended item.

    Attributes:
        shape: shape of one row.
        dtype: numpy type.
        unit: SI unit, or what the columns are.
        about: one sentence for the reader.
        clock: data set with the time (float, s) or frame (integer) of each row; ``radar/time``: one row per frame.
        labels: meaning of the values 0, 1, ..., if they are not numbers.
    """

    shape: tuple[int, ...]
    dtype: str
    unit: str
    about: str
    clock: str = "radar/time"
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Product:
    """A data set written once when the recording is opened (a floor plan, a label axis)."""

    data: np.ndarray
    unit: str
    about: str


class RecordingWriter:
    """Context manager that writes a recording frame by frame.

    Args:
        path: file to write; frames are in its ``.part`` until the writer is closed.
        cfg_text: original configuration text, stored unchanged.
        attributes: scene, seed, command and the like, stored as attributes of the file.
        streams: growing data sets by path, e.g. ``"truth/pose"``.
        products: fixed data sets by path.
        raw: False for a recording without samples (heat maps for training); `append` then takes None for them.
        overwrite: replace an existing recording of a radar.

    Attributes:
        frames: number of frames flushed so far.
        losses: statistics of the frames appended so far.

    Raises:
        InputError: the file cannot be created, another program writes it, or it is an existing recording of a radar.
        DiskFull: raised by any call. The file stays consistent: the data may be left out, and writing continue.
    """

    def __init__(
        self,
        path: str | Path,
        config: RadarConfig,
        *,
        cfg_text: str = "",
        attributes: Mapping[str, object] | None = None,
        streams: Mapping[str, Stream] | None = None,
        products: Mapping[str, Product] | None = None,
        raw: bool = True,
        overwrite: bool = False,
    ):
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        self.config = config
        self.frames, self.raw, self.losses = 0, raw, Losses(config.frame_period)
        self._file: h5py.File | None = None
        self._notes: dict[str, object] = {}
        self._pending: list[np.ndarray] = []
        self._unflushed = self._waiting = 0  # frames, bytes
        self._synced = clock.monotonic()
        if not overwrite:
            spare(self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            if self.part.exists():
                os.close(hold(self.part))  # of a process that died; else refused
            self._room = os.open(self.part, os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o666)
            try:
                self._reserve(sum(product.data.nbytes for product in (products or {}).values()))
            except OSError:
                os.close(self._room)
                self.part.unlink()
                raise
            self._file = h5py.File(self.part, "w", libver=FORMAT)
            self._create(self._file, cfg_text, attributes or {}, streams or {}, products or {})
            self._held = hold(self.part)  # HDF5 itself does so until readers may follow
        except OSError as error:
            raise _failed("write", self.part, error) from error

    def _create(
        self,
        file: h5py.File,
        cfg_text: str,
        attributes: Mapping[str, object],
        streams: Mapping[str, Stream],
        products: Mapping[str, Product],
    ) -> None:
        file.attrs.update({"format": _FORMAT, "radarize_version": __version__, **_storable(attributes)})
        radar = file.create_group("radar")
        radar.attrs["config"] = self.config.model_dump_json()
        radar.attrs["cfg"] = cfg_text
        loops, tx, rx, samples, _ = self.config.frame_shape
        if self.raw:
            grow(file, "radar/adc", Stream((loops, tx, rx, samples, 2), "i2", "ADC counts", "I/Q, TX1..3 x RX1..4"))
        grow(file, "radar/valid", Stream((loops, tx), "?", "", "False where samples of the chirp were lost"))
        grow(file, "radar/time", Stream((), "f8", "s", "start of the frame's first chirp"))
        for name, product in products.items():
            fix(file, name, product)
        for name, stream in streams.items():
            grow(file, name, stream)
        file.swmr_mode = True

    def append(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"] | None,
        time: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        *,
        rows: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        """Append frames, and rows of other streams by path, which become visible together with the frames.

        Raises:
            InputError: the shapes do not fit the configuration.
            DiskFull: the frames may be left out, and later ones appended.
        """
        rows = dict(rows or {})
        if self.raw:
            assert adc is not None  # None is for recordings without samples
            if adc.shape[1:] != self.config.frame_shape:
                raise InputError(
                    f"{self.path}: frames have shape {adc.shape[1:]}, expected {self.config.frame_shape} "
                    "(loop, tx, rx, sample, iq) from the configuration"
                )
            rows["radar/adc"] = adc
        if valid is None:
            valid = np.ones((len(time), *self.config.frame_shape[:2]), bool)
        with self._reporting("write"):
            self._reserve(sum(np.asarray(data).nbytes for data in rows.values()))
            for name, data in rows.items():
                self._extend(name, data)
            self._extend("radar/valid", valid)
            stamps = np.asarray(time, float)
            self.losses.add(np.asarray(valid), stamps)
            self._pending.append(stamps)
            self._unflushed += len(time)
            if self._unflushed >= self.config.frame_rate:
                self.flush()

    def extend(self, name: str, data: np.ndarray) -> None:
        """Append rows to a stream that runs at its own rate (an IMU)."""
        with self._reporting("write"):
            self._reserve(data.nbytes)
            self._extend(name, data)

    def _reserve(self, size: int) -> None:
        """Reserve bytes on the disk behind the written ones, so that other programs cannot take them.

        Raises:
            OSError: there is not enough space; data appended earlier has its place.
        """
        waiting, end = self._waiting + size, self._file.id.get_filesize() if self._file else 0
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(self._room, end, waiting + _RESERVE)
        elif shutil.disk_usage(self.part).free < waiting + _RESERVE:  # macOS: other programs may use it first
            raise OSError(errno.ENOSPC, FULL)
        self._waiting = waiting

    @property
    def _opened(self) -> h5py.File:
        assert self._file is not None  # set in the constructor
        return self._file

    def _extend(self, name: str, data: np.ndarray) -> None:
        if len(data):
            _lengthen(self._opened[name], data)

    def annotate(self, **attributes: object) -> None:
        """Set attributes of the file that are known at the end only; stored when the writer is closed."""
        self._notes.update(attributes)

    def flush(self) -> None:
        """Make all appended frames visible to readers. Times are written last: a frame counts once its time is written.

        The same order holds on the disk, by fsync; without it, the system may write in any order.
        """
        self._opened.flush()
        if due := clock.monotonic() - self._synced >= _PACE:
            os.fsync(self._room)
        self._waiting = 0
        self._reserve(0)  # HDF5 truncates the file to its content
        for times in self._pending:
            self._extend("radar/time", times)
            self.frames += len(times)
        self._pending.clear()
        self._opened["radar/time"].flush()
        if due:
            os.fsync(self._room)
            self._synced = clock.monotonic()
        self._unflushed = 0

    @contextmanager
    def _reporting(self, what: str) -> Iterator[None]:
        """Turn write errors into an InputError that names the failed step."""
        try:
            yield
        except (OSError, RuntimeError) as error:
            raise _failed(what, self.part, error) from error

    def close(self, keep_part: bool = False) -> None:
        """Flush, close and rename the file to its final name, unless `keep_part`."""
        if self._file:
            with self._reporting("finish"):
                self.flush()
                os.ftruncate(self._room, self._file.id.get_filesize())  # release unused reserved bytes
                self._file.close()
                os.close(self._held)
                if self._notes:  # HDF5 accepts no new attributes in this mode
                    with open_hdf5(self.part, mode="r+") as file:
                        file.attrs.update(_storable(self._notes))
                os.fsync(self._room)
                os.close(self._room)
                if not keep_part:
                    os.replace(self.part, self.path)
                    _sync_folder(self.path.parent)

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        # An interrupt completes a recording: all appended frames are kept under its name.
        if kind is None or issubclass(kind, KeyboardInterrupt):
            self.close()
        else:
            with suppress(InputError):  # the first error is the one to report
                self.close(keep_part=True)


def _sync_folder(folder: Path) -> None:
    """Write a folder's entries to the disk, if the system supports it."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _failed(what: str, part: Path, error: Exception) -> InputError:
    kind = DiskFull if disk_full(error) else InputError
    return kind(f"cannot {what} {part}: {reason(error)}")


def add(
    path: Path,
    streams: Mapping[str, Stream],
    rows: Mapping[str, np.ndarray],
    products: Mapping[str, Product] | None = None,
    attributes: Mapping[str, object] | None = None,
) -> Path:
    """Add streams and products to a recording, which is replaced as a whole.

    Args:
        path: recording that is not being written.
        streams: streams by path.
        rows: all rows of each stream.
        products: data sets written once, by path.
        attributes: attributes of the file to replace or add.

    Raises:
        InputError: a data set exists, or the file cannot be written.
    """
    with replacing(path) as part:
        shutil.copyfile(path, part)
        with (
            explained(f"{path}: cannot be added to", OSError, RuntimeError),
            open_hdf5(part, mode="r+") as file,
        ):
            for name in (*streams, *(products or {})):
                if name in file:
                    raise InputError(f"{path}: has /{name} already, expected a recording without")
            for name, stream in streams.items():
                _lengthen(grow(file, name, stream), rows[name])
            for name, product in (products or {}).items():
                fix(file, name, product)
            file.attrs.update(attributes or {})
    return path


def _lengthen(target: h5py.Dataset, data: np.ndarray) -> None:
    """Append rows to a stream's data set."""
    start = len(target)
    target.resize(start + len(data), axis=0)
    if target.compression is None or target.chunks[0] > 1:
        target[start:] = data
        return
    for k, row in enumerate(np.broadcast_to(data, (len(data), *target.shape[1:])).astype(target.dtype, copy=False)):
        target.id.write_direct_chunk((start + k, *(0 for _ in row.shape)), _packed(row))


def _packed(row: np.ndarray) -> bytes:
    """Return a chunk of one row as HDF5's filters would store it, bytes shuffled and deflated, in 1/8 of their time."""
    by_byte = np.ascontiguousarray(row).view(np.uint8).reshape(-1, row.itemsize).T
    return isal_zlib.compress(np.ascontiguousarray(by_byte), 1)


def fix(file: h5py.File, name: str, product: Product) -> None:
    """Create a data set that is written once."""
    file.create_dataset(name, data=product.data).attrs.update({"unit": product.unit, "about": product.about})


def grow(file: h5py.File, name: str, stream: Stream) -> h5py.Dataset:
    """Create the data set of a stream, without rows yet."""
    per_row = int(np.prod(stream.shape, dtype=int)) * np.dtype(stream.dtype).itemsize
    rows = int(np.clip(16384 // max(per_row, 1), 1, 1024))
    packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if per_row >= 1024 else {}
    data = file.create_dataset(
        name,
        shape=(0, *stream.shape),
        maxshape=(None, *stream.shape),
        dtype=stream.dtype,
        chunks=(rows, *stream.shape),
        fillvalue=_unwritten(name, stream),
        **packed,
    )
    data.attrs.update({"unit": stream.unit, "about": stream.about, "clock": stream.clock})
    if stream.labels:
        data.attrs["labels"] = stream.labels
    return data


def _storable(attributes: Mapping[str, object]) -> dict[str, object]:
    """Return attributes with text that HDF5 accepts: without NUL, and valid as UTF-8."""
    return {
        name: value.encode("utf-8", "backslashreplace").decode().replace("\0", "\\x00")
        if isinstance(value, str)
        else value
        for name, value in attributes.items()
    }


def _unwritten(name: str, stream: Stream) -> float | int | None:
    """Return the fill value of rows that were not written; a clock stays ascending even if its end is lost."""
    kind = np.dtype(stream.dtype)
    if kind.kind == "f":
        return np.nan
    return np.iinfo(kind).max if name == stream.clock else None
