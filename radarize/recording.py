"""The recording: one HDF5 file of raw I/Q with its configuration, and whatever truth came along.

Layout (design: one chunk per frame, readable while it grows):

    /radar          attributes: configuration as JSON, the .cfg text
    /radar/adc      int16 (frame, loop, tx, rx, sample, iq)   absent where only heat maps were kept
    /radar/time     float64 (frame,)                          s, start of the first chirp
    /radar/valid    bool (frame, loop, tx)                    False where samples of the chirp were lost
    /truth/NAME, /imu/NAME, /points/NAME, /maps/NAME          optional, attributes `unit` and `about`

A recording is written to ``NAME.h5.part`` and renamed when it is closed. Frames are flushed about once a second of
recorded time in HDF5's single-writer-multiple-reader mode, so a reader, or a survivor of a crash, sees every frame
flushed so far. No clock of the writing machine goes into the file or its layout: same content, same bytes.
"""

import errno
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Bool, Float, Int16
from pydantic import ValidationError

from radarize import __version__
from radarize.errors import InputError
from radarize.radar.config import RadarConfig

FORMAT = 1
#: Bytes of disk kept free for HDF5's own structures, so that a recording can be closed when the disk fills up. HDF5
#: writes chunks when it drops them from its cache, where h5py reports no error: running out must be seen before.
_RESERVE = 512 << 10


@dataclass(frozen=True)
class Stream:
    """A data set that grows with the recording, one row per appended item.

    Attributes:
        shape: shape of one row.
        dtype: numpy type.
        unit: SI unit, or what the columns are.
        about: one sentence for the reader.
    """

    shape: tuple[int, ...]
    dtype: str
    unit: str
    about: str


@dataclass(frozen=True)
class Product:
    """A data set written once when the recording is opened (a floor plan, a label axis)."""

    data: np.ndarray
    unit: str
    about: str


class RecordingWriter:
    """Writes a recording frame by frame; use as a context manager.

    Args:
        path: file to write; its ``.part`` neighbour holds the frames until the writer is closed.
        config: radar configuration.
        cfg_text: original configuration text, kept as it is.
        attributes: scene, seed, command and the like, stored as attributes of the file.
        streams: growing data sets by path, e.g. ``"truth/pose"``.
        products: fixed data sets by path.
        raw: False for a recording without samples (heat maps for training): `append` then takes None for them.

    Raises:
        InputError: the file cannot be created or a write failed (for instance, no space left).
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
    ):
        self.path = Path(path)
        self.part = self.path.with_name(self.path.name + ".part")
        self.config = config
        self.frames, self.raw = 0, raw
        self._file: h5py.File | None = None
        self._notes: dict[str, object] = {}
        self._pending: list[tuple] = []
        self._unflushed = 0
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._require_space(sum(product.data.nbytes for product in (products or {}).values()))
            self._file = h5py.File(self.part, "w", libver="latest")
            self._create(cfg_text, attributes or {}, streams or {}, products or {})
        except OSError as error:
            raise InputError(f"cannot write {self.part}: {_reason(error)}") from error

    def _create(self, cfg_text, attributes, streams, products) -> None:
        file = self._file
        file.attrs.update({"format": FORMAT, "radarize_version": __version__, **attributes})
        radar = file.create_group("radar")
        radar.attrs["config"] = self.config.model_dump_json()
        radar.attrs["cfg"] = cfg_text
        loops, tx, rx, samples, _ = self.config.frame_shape
        if self.raw:
            self._grow("radar/adc", Stream((loops, tx, rx, samples, 2), "i2", "ADC counts", "I/Q, TX1..3 x RX1..4"))
        self._grow("radar/valid", Stream((loops, tx), "?", "", "False where samples of the chirp were lost"))
        self._grow("radar/time", Stream((), "f8", "s", "start of the frame's first chirp"))
        for name, product in products.items():
            data = file.create_dataset(name, data=product.data)
            data.attrs.update({"unit": product.unit, "about": product.about})
        for name, stream in streams.items():
            self._grow(name, stream)
        file.swmr_mode = True

    def _grow(self, name: str, stream: Stream) -> None:
        per_row = int(np.prod(stream.shape, dtype=int)) * np.dtype(stream.dtype).itemsize
        rows = int(np.clip(16384 // max(per_row, 1), 1, 1024))
        packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if per_row >= 1024 else {}
        data = self._file.create_dataset(
            name,
            shape=(0, *stream.shape),
            maxshape=(None, *stream.shape),
            dtype=stream.dtype,
            chunks=(rows, *stream.shape),
            fillvalue=np.nan if np.dtype(stream.dtype).kind == "f" else None,
            **packed,
        )
        data.attrs.update({"unit": stream.unit, "about": stream.about})

    def append(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"] | None,
        time: Float[np.ndarray, "frame"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        **rows: np.ndarray,
    ) -> None:
        """Append frames, and rows of other streams by path with ``__`` for ``/`` (``truth__pose=...``).

        Raises:
            InputError: the shapes do not fit the configuration, or the disk is full; frames flushed before stay.
        """
        if self.raw and adc.shape[1:] != self.config.frame_shape:
            raise InputError(
                f"{self.path}: frames have shape {adc.shape[1:]}, expected {self.config.frame_shape} "
                "(loop, tx, rx, sample, iq) from the configuration"
            )
        if valid is None:
            valid = np.ones((len(time), *self.config.frame_shape[:2]), bool)
        if self.raw:
            rows["radar__adc"] = adc
        try:
            self._require_space(sum(np.asarray(data).nbytes for data in rows.values()))
            for name, data in rows.items():
                self._extend(name.replace("__", "/"), data)
            self._extend("radar/valid", valid)
            self._pending.append(np.asarray(time, float))
            self._unflushed += len(time)
            if self._unflushed >= self.config.frame_rate:
                self.flush()
        except (OSError, RuntimeError) as error:
            raise InputError(f"cannot write {self.part}: {_reason(error)}; {self._survivors()}") from error

    def extend(self, name: str, data: np.ndarray) -> None:
        """Append rows to a stream that runs at its own rate (an IMU)."""
        try:
            self._require_space(data.nbytes)
            self._extend(name, data)
        except (OSError, RuntimeError) as error:
            raise InputError(f"cannot write {self.part}: {_reason(error)}; {self._survivors()}") from error

    def _require_space(self, size: int) -> None:
        free = shutil.disk_usage(self.path.parent).free
        if free < size + _RESERVE:
            if self._file:
                self.flush()
            raise OSError(errno.ENOSPC, "no space left on the device")

    def _extend(self, name: str, data: np.ndarray) -> None:
        if not len(data):
            return
        target = self._file[name]
        start = len(target)
        target.resize(start + len(data), axis=0)
        target[start:] = data

    def annotate(self, **attributes: object) -> None:
        """Attributes of the file that are known only at the end; stored when the writer is closed."""
        self._notes.update(attributes)

    def flush(self) -> None:
        """Make every appended frame visible to readers. Times go last: a frame counts once its time is there."""
        self._file.flush()
        for times in self._pending:
            self._extend("radar/time", times)
            self.frames += len(times)
        self._pending.clear()
        self._file["radar/time"].flush()
        if shutil.disk_usage(self.path.parent).free == 0:  # somebody else filled the disk; HDF5 would not say so
            raise OSError(errno.ENOSPC, "no space left on the device")
        self._unflushed = 0

    def _survivors(self) -> str:
        return f"{self.frames} whole frames are kept there"

    def close(self, keep_part: bool = False) -> None:
        """Flush, close and give the file its final name, unless `keep_part`."""
        if self._file:
            try:
                self.flush()
                self._file.close()
                if self._notes:  # HDF5 takes no new attributes while readers may follow
                    with h5py.File(self.part, "r+", libver="latest") as file:
                        file.attrs.update(self._notes)
            except (OSError, RuntimeError) as error:
                raise InputError(f"cannot finish {self.part}: {_reason(error)}; {self._survivors()}") from error
            if not keep_part:
                os.replace(self.part, self.path)

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(self, kind, error, trace) -> None:
        # An interrupt ends a recording, it does not spoil it: everything appended so far is kept under its name.
        if kind is None or issubclass(kind, KeyboardInterrupt):
            self.close()
        else:
            try:
                self.close(keep_part=True)
            except InputError:
                pass  # the first error is the one to report


def _reason(error: Exception) -> str:
    text = str(error)
    if "No space left" in text or "errno = 28" in text:
        return "no space left on the device"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return text.splitlines()[0] if text else type(error).__name__


def _is_growing(path: Path) -> bool:
    """Whether a writer has the file open, or died with it open: then HDF5 must read in its multiple-reader mode.

    That mode retries without end where a file is cut short, so this is looked at first (superblock version 3: byte 11
    holds the flags, bytes 28-35 the end of the file).

    Raises:
        OSError: the file is shorter than its writer left it.
    """
    with path.open("rb") as file:
        head = file.read(48)
    if len(head) < 48 or head[:8] != b"\x89HDF\r\n\x1a\n" or head[8] != 3 or not head[11] & 0b101:
        return False
    size, end = path.stat().st_size, int.from_bytes(head[28:36], "little")
    if size < end:
        raise OSError(f"truncated: has {size} bytes of at least {end}")
    return True


@dataclass
class Recording:
    """A recording opened for reading; use as a context manager.

    Args:
        path: an ``.h5`` file, finished, growing, or left behind by a crash.

    Raises:
        InputError: missing file, not a recording, or a broken configuration.
    """

    path: Path
    config: RadarConfig = field(init=False)
    times: Float[np.ndarray, "frame"] = field(init=False)

    def __post_init__(self):
        self.path = Path(self.path)
        if not self.path.is_file():
            raise InputError(f"{self.path}: no such file, expected a recording (.h5)")
        try:
            self.file = h5py.File(self.path, "r", libver="latest", swmr=_is_growing(self.path))
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self.path}: not a readable HDF5 recording ({_reason(error)})") from error
        try:
            radar = self.file["radar"]
            self.config = RadarConfig.model_validate_json(radar.attrs["config"])
            self._adc, self._valid, times = radar.get("adc"), radar["valid"], radar["time"][:]
        except (KeyError, OSError, TypeError, ValidationError) as error:
            self.file.close()
            raise InputError(f"{self.path}: not a recording of this project ({_reason(error)})") from error
        if self._adc is None and "maps" not in self.file:
            self.file.close()
            raise InputError(f"{self.path}: not a recording of this project (neither /radar/adc nor /maps)")
        if self._adc is not None and (self._adc.dtype != np.int16 or self._adc.shape[1:] != self.config.frame_shape):
            shape, kind = self._adc.shape[1:], self._adc.dtype
            self.file.close()
            raise InputError(
                f"{self.path}: /radar/adc holds {kind} of shape {shape}, "
                f"expected int16 of {self.config.frame_shape} from its configuration"
            )
        # A frame counts once its time is written, which happens after its samples are on disk.
        whole = min(len(data) for data in (times, self._adc, self._valid) if data is not None)
        unwritten = np.flatnonzero(~np.isfinite(times[:whole]))
        self.times = times[: unwritten[0] if len(unwritten) else whole]

    def __len__(self) -> int:
        return len(self.times)

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_) -> None:
        self.file.close()

    @property
    def cfg_text(self) -> str:
        """The configuration text the recording was made with, or an empty string."""
        return str(self.file["radar"].attrs.get("cfg", ""))

    @property
    def attributes(self) -> dict[str, object]:
        """Scene, seed, versions and the like."""
        return {k: v.item() if hasattr(v, "item") else v for k, v in self.file.attrs.items()}

    def adc(self, start: int, stop: int) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """Raw samples of frames start...stop-1.

        Raises:
            InputError: a chunk on disk is damaged, or only heat maps were kept.
        """
        if self._adc is None:
            raise InputError(f"{self.path}: has no raw samples, only heat maps, expected a recording with /radar/adc")
        return self._read(self._adc, start, stop)

    def valid(self, start: int, stop: int) -> Bool[np.ndarray, "frame loop tx"]:
        """Per chirp: False where samples were lost."""
        return self._read(self._valid, start, stop)

    def _read(self, data: h5py.Dataset, start: int, stop: int) -> np.ndarray:
        try:
            return data[start : min(stop, len(self))]
        except OSError as error:
            raise InputError(f"{self.path}: frames {start}...{stop - 1} of {data.name} are damaged") from error

    def batches(self, size: int = 32) -> Iterator[tuple[slice, np.ndarray]]:
        """Frames in batches, as (slice of frames, raw samples)."""
        for start in range(0, len(self), size):
            stop = min(start + size, len(self))
            yield slice(start, stop), self.adc(start, stop)

    def has(self, name: str) -> bool:
        """Whether a data set such as ``truth/pose`` is there."""
        return name in self.file

    def read(self, name: str) -> np.ndarray:
        """A whole data set by path; per-frame streams are cut to the whole frames.

        Raises:
            InputError: there is none of that name, or it is damaged.
        """
        if name not in self.file:
            raise InputError(f"{self.path}: has no /{name}; there are {', '.join(self.names())}")
        try:
            return self.file[name][:]
        except OSError as error:
            raise InputError(f"{self.path}: /{name} is damaged") from error

    def names(self) -> list[str]:
        """Paths of all data sets."""
        found: list[str] = []
        self.file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return found

    def describe(self, name: str) -> dict[str, object]:
        """Shape, type, unit and meaning of a data set."""
        data = self.file[name]
        return {"shape": data.shape, "dtype": str(data.dtype), **{k: data.attrs.get(k, "") for k in ("unit", "about")}}

    def config_json(self) -> dict[str, object]:
        """The radar configuration as plain data."""
        return json.loads(self.config.model_dump_json())
