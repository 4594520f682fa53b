"""Reading a recording, finished, growing, or left behind by a crash."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Bool, Float, Int16
from pydantic import ValidationError

from radarize.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.recording.streams import reason


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
            raise InputError(f"{self.path}: not a readable HDF5 recording ({reason(error)})") from error
        try:
            self._clocks: dict[str, np.ndarray] = {}
            radar = self.file["radar"]
            self.config = RadarConfig.model_validate_json(radar.attrs["config"])
            self._adc, self._valid, times = radar.get("adc"), radar["valid"], radar["time"][:]
        except (KeyError, OSError, TypeError, ValidationError) as error:
            self.file.close()
            raise InputError(f"{self.path}: not a recording of this project ({reason(error)})") from error
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
        """A whole data set by path; of a stream, nothing past the last whole frame.

        Raises:
            InputError: there is none of that name, or it is damaged.
        """
        data = self._dataset(name)
        if "clock" not in data.attrs:
            return self._slice(data, slice(None))
        return self._slice(data, slice(0, self._row(data, len(self))))

    def rows(self, name: str, start: int, stop: int) -> np.ndarray:
        """Rows of a stream that belong to frames start...stop-1.

        Of a stream at its own rate: from the first frame's start until the frame after the last starts.

        Raises:
            InputError: there is none of that name, it is no stream, or it is damaged.
        """
        data = self._dataset(name)
        if "clock" not in data.attrs:
            raise InputError(f"{self.path}: /{name} was written once, expected a stream with rows for every frame")
        return self._slice(data, slice(self._row(data, start), self._row(data, stop)))

    def _row(self, data: h5py.Dataset, frame: int) -> int:
        """First row of a stream that belongs to `frame` or a later one."""
        frame = int(np.clip(frame, 0, len(self)))
        clock = str(data.attrs["clock"])
        if clock == "radar/time" or not len(self):
            return min(frame, len(data))
        if clock not in self._clocks:
            self._clocks[clock] = self._slice(self._dataset(clock), slice(None))
        ticks = self._clocks[clock]
        if ticks.dtype.kind == "f":
            after = self.times[-1] + self.config.frame_period
            # Sums and products of the same period differ in the last bit; no sample falls between the two.
            frame = (self.times[frame] if frame < len(self) else after) - 1e-9
        return min(int(np.searchsorted(ticks, frame)), len(data))

    def _dataset(self, name: str) -> h5py.Dataset:
        if name not in self.file:
            raise InputError(f"{self.path}: has no /{name}; there are {', '.join(self.names())}")
        return self.file[name]

    def _slice(self, data: h5py.Dataset, rows: slice) -> np.ndarray:
        try:
            return data[rows]
        except OSError as error:
            raise InputError(f"{self.path}: {data.name} is damaged") from error

    def names(self) -> list[str]:
        """Paths of all data sets."""
        found: list[str] = []
        self.file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return found

    def describe(self, name: str) -> dict[str, object]:
        """Shape, type, unit and meaning of a data set."""
        data = self.file[name]
        return {"shape": data.shape, "dtype": str(data.dtype), **{k: data.attrs.get(k, "") for k in ("unit", "about")}}

    def labels(self, name: str) -> tuple[str, ...]:
        """What the values 0, 1, ... of a data set stand for; empty where they are numbers.

        Raises:
            InputError: there is no data set of that name.
        """
        return tuple(map(str, self._dataset(name).attrs.get("labels", ())))

    def config_json(self) -> dict[str, object]:
        """The radar configuration as plain data."""
        return json.loads(self.config.model_dump_json())
