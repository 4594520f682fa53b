"""Reader of recordings: complete, growing, or interrupted."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize.io.errors import InputError, explained
from radarize.io.files import regular
from radarize.io.hdf5 import dataset, open_hdf5
from radarize.io.recording.growing import GrowingFile, is_growing
from radarize.io.recording.stamps import Stamps
from radarize.io.recording.unpacking import Rows
from radarize.io.trajectory import Trajectory
from radarize.radar.boards import Board
from radarize.radar.config import RadarConfig

#: Environment variable with which `radarize train --board` sets the board file for all processes that read recordings.
BOARD = "RADARIZE_BOARD"


@dataclass(eq=False, repr=False)
class Recording:
    """A recording opened for reading; use as a context manager, or keep it open.

    ``recording[100]`` and ``recording[100:110]`` are frames, see `Clip`; ``len(recording)`` is their number. Damage is
    limited to the affected frames: a frame that cannot be unpacked counts as lost (zero, and not valid), and a damaged
    stamp is interpolated from its neighbours, or its frame is left out; `damage` lists this.

    Args:
        path: an ``.h5`` file: complete, growing, or interrupted.
        board: board of the radar with its calibration, instead of the recording's: a board file, a name, or a board. By
            default that in the environment variable `BOARD`, if a command has set it for its jobs.

    Attributes:
        config: configuration of the radar.
        times: (frame,) s, starts of the frames' first chirps.

    Raises:
        InputError: missing file, not a recording, or a broken configuration.

    Example:
        >>> with rz.Recording("walk.h5") as rec:
        ...     len(rec), rec[4:8].samples.shape  # frame, loop, transmitter, receiver, sample, I and Q
        (24, (4, 32, 3, 4, 96, 2))
    """

    path: Path
    board: str | Path | Board | None = field(default_factory=lambda: os.environ.get(BOARD))
    config: RadarConfig = field(init=False)
    times: Float[np.ndarray, "frame"] = field(init=False)

    def __post_init__(self):
        self.path = Path(self.path)
        regular(self.path, "a recording (.h5)")
        with ExitStack() as stack:
            with explained(f"{self.path}: not a readable HDF5 recording"):
                growing = stack.enter_context(GrowingFile(self.path)) if is_growing(self.path) else None
                self.file = stack.enter_context(open_hdf5(self.path, growing))
            with explained(f"{self.path}: not a recording of this project"):
                self._look(growing is not None)
            if self.board is not None:
                self.config = self.config.changed(str(self.board), board=self.board)
            self._files = stack.pop_all()

    def _look(self, growing: bool) -> None:
        radar = self.file["radar"]
        self.config = RadarConfig.model_validate_json(radar.attrs["config"])
        self.cfg_text = str(radar.attrs.get("cfg", ""))
        self._clocks: dict[str, np.ndarray] = {}
        self._read: dict[str, Rows] = {}
        self._adc = dataset(radar, "adc", self.path) if "adc" in radar else None
        if self._adc is None and "maps" not in self.file:
            raise InputError(f"{self.path}: not a recording of this project (neither /radar/adc nor /maps)")
        self._valid, times = dataset(radar, "valid", self.path), dataset(radar, "time", self.path)
        for data, kind, shape in (
            (self._adc, np.int16, self.config.frame_shape),
            (self._valid, np.bool_, self.config.frame_shape[:2]),
            (times, np.float64, ()),
        ):
            if data is not None and (data.dtype != kind or not data.ndim or data.shape[1:] != shape):
                raise InputError(
                    f"{self.path}: {data.name} holds {data.dtype} of shape {data.shape[1:]}, "
                    f"expected {np.dtype(kind)} of {shape} from its configuration"
                )
        # A frame counts once its time is written, which happens after its samples are on disk.
        written = {data.name: len(data) for data in (times, self._valid, self._adc) if data is not None}
        whole = min(written.values())
        self.written = max(written.values())
        self._stamps = Stamps(self._rows_of(times).read(0, whole), self.config.frame_period)
        self._leave_out_unwritten()
        self.times = self._stamps.times
        self._shorter = [] if growing or self.written == whole else [
            f"{', '.join(f'{name} has {count} rows' for name, count in written.items())}: frames beyond {whole} are "
            "left out"
        ]  # fmt: skip

    def _leave_out_unwritten(self) -> None:
        """Leave out frames at the end without stamps and samples: those whose writing was interrupted."""
        corrected, count = set(self._stamps.corrected.tolist()), len(self._stamps.rows)
        while self._adc is not None and count and (row := int(self._stamps.rows[count - 1])) in corrected:
            if self._rows_of(self._adc).stored(row):
                break
            count -= 1
        if count < len(self._stamps.rows):
            self._stamps.keep(np.arange(len(self._stamps.rows)) < count)

    @property
    def damage(self) -> list[str]:
        """Sentences on the damage of the file, as far as it has been read; empty without damage.

        Example:
            >>> rec = rz.load("walk.h5")
            >>> rec.damage
            []
        """
        found = [*self._shorter, *self._stamps.warnings()]
        for name, rows in self._read.items():
            lost = np.flatnonzero(rows.damaged())
            if name == "/radar/adc":
                lost = np.flatnonzero(np.isin(self._stamps.rows, lost))
                what = f"of {len(self)} frames cannot be unpacked and count as lost"
            else:
                what = f"of {len(rows.data)} rows of {name} cannot be unpacked and are left empty"
            if len(lost):
                found.append(f"{len(lost)} {what} (the first is {lost[0]})")
        return found

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, frames: int | slice) -> "Clip":
        """Return some frames, without reading them yet.

        Raises:
            IndexError: there is no frame of this number.
            InputError: the frames are not in ascending order.
        """
        return Clip(self, range(len(self)))[frames]

    def __repr__(self) -> str:
        c, scene = self.config, self.attributes.get("scene", "")
        return (
            f"<recording {self.path.name}: {len(self)} frames of {1e3 * c.frame_period:.4g} ms"
            f"{f', scene {scene}' if scene else ''}; {c.loops} loops, {len(c.tx)} transmitters, {len(c.rx)} receivers, "
            f"{c.samples} samples; {c.range_resolution:.3g} m to {c.max_range:.3g} m, +-{c.max_velocity:.3g} m/s>"
        )

    def __enter__(self) -> "Recording":
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    @property
    def has_samples(self) -> bool:
        """Whether the recording has raw samples."""
        return self._adc is not None

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes of the file: scene, seed, versions, ...

        Raises:
            InputError: they are damaged.
        """
        with explained(f"{self.path}: its attributes are damaged"):
            return {k: v.item() if isinstance(v, np.generic) else v for k, v in self.file.attrs.items()}

    def adc(self, start: int, stop: int) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """Return raw samples of frames start to stop - 1; zero if a frame's chunk is damaged, see `valid`.

        Raises:
            InputError: the recording has heat maps only.
        """
        if self._adc is None:
            raise InputError(f"{self.path}: has no raw samples, only heat maps, expected a recording with /radar/adc")
        return self._frames(self._adc, start, stop)

    def valid(self, start: int, stop: int) -> Bool[np.ndarray, "frame loop tx"]:
        """Return per chirp, False if samples were lost or its frame cannot be unpacked."""
        valid = self._frames(self._valid, start, stop)
        if self._adc is not None and len(valid):
            rows = self._stamps.rows[start:stop]
            whole = self._rows_of(self._adc).whole(int(rows[0]), int(rows[-1]) + 1)
            valid &= whole[rows - rows[0], None, None]
        return valid

    def _rows_of(self, data: h5py.Dataset) -> Rows:
        if data.name not in self._read:
            self._read[data.name] = Rows(data)
        return self._read[data.name]

    def _frames(self, data: h5py.Dataset, start: int, stop: int) -> np.ndarray:
        """Return rows start to stop - 1 of data with a row per frame."""
        with explained(f"{self.path}: frames {start}...{stop - 1} of {data.name} cannot be read"):
            rows = self._stamps.rows[start:stop]
            first = int(rows[0]) if len(rows) else 0
            found = self._rows_of(data).read(first, int(rows[-1]) + 1 if len(rows) else 0)
            places = (rows - first)[rows - first < len(found)]
            return found if len(places) == len(found) else found[places]

    def batches(self, size: int = 32) -> Iterator[tuple[slice, np.ndarray]]:
        """Yield frames in batches, as (slice of frames, raw samples)."""
        for start in range(0, len(self), size):
            stop = min(start + size, len(self))
            yield slice(start, stop), self.adc(start, stop)

    def has(self, name: str) -> bool:
        """Return whether there is a data set such as ``truth/pose``."""
        with explained(f"{self.path}: is damaged"):
            return name in self.file

    def read(self, name: str) -> np.ndarray:
        """Read a whole data set by path; a stream is cut after the last complete frame.

        Raises:
            InputError: there is none of that name, or it is damaged.
        """
        data = self._dataset(name)
        return self.rows(name, 0, len(self)) if self._clock(data) else self._slice(data)

    def true_poses(self) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]] | None:
        """Return stamps (s) and poses (position m, quaternion x y z w) of the known truth; None without truth."""
        if not (self.has("truth/time") and self.has("truth/pose")):
            return None
        times, poses = self.read("truth/time"), self.read("truth/pose")
        shared = min(len(times), len(poses))
        seen = np.isfinite(poses[:shared]).all(axis=1)  # a tracking camera may lose tracking for a while
        return times[:shared][seen], poses[:shared][seen]

    @property
    def truth(self) -> Trajectory | None:
        """True poses where known, with velocities and floor plan if known; None without truth."""
        if (poses := self.true_poses()) is None:
            return None
        velocity = self.read("truth/velocity") if self.has("truth/velocity") else np.zeros((0, 3))
        plan = self.read("truth/floor_plan") if self.has("truth/floor_plan") else None
        known = velocity if len(velocity) == len(poses[0]) else None
        return Trajectory(*poses, velocity=known, floor_plan=plan, name="truth")

    def rows(self, name: str, start: int, stop: int) -> np.ndarray:
        """Read the rows of a stream that belong to frames start to stop - 1.

        A stream at its own rate is read from the start of the first frame to the start of the frame after the last.

        Raises:
            InputError: there is none of this name, it is not a stream, or it is damaged.
        """
        data = self._dataset(name)
        if not (clock := self._clock(data)):
            raise InputError(f"{self.path}: /{name} was written once, expected a stream with rows for every frame")
        if clock == "radar/time":
            return self._frames(data, start, stop)
        first, last = self._row(clock, start), self._row(clock, stop)
        with explained(f"{self.path}: {data.name} cannot be read"):
            found = self._rows_of(data).read(first, last)
        ticks = self._clocks[clock][first:last]
        if ticks.dtype.kind == "f" or len(self._stamps.rows) == len(self._stamps.written):
            return found
        numbers = np.searchsorted(self._stamps.rows, ticks)  # of frames, if some rows are left out
        known = np.isin(ticks, self._stamps.rows)[: len(found)]
        return (numbers.astype(found.dtype) if name == clock else found)[known]

    def _clock(self, data: h5py.Dataset) -> str:
        """Return the name of the data set with the frame or time of a stream's rows; empty if there is none."""
        with explained(f"{self.path}: {data.name} is damaged"):
            clock = str(data.attrs.get("clock", ""))
            if clock and not data.ndim:
                raise InputError(f"{self.path}: {data.name} is a single value with a clock, expected rows")
            return clock

    def _row(self, clock: str, frame: int) -> int:
        """Return the first row of a stream at its own rate that belongs to `frame` or a later one."""
        if clock not in self._clocks:
            self._clocks[clock] = self._slice(self._dataset(clock))
        ticks = self._clocks[clock]
        if ticks.ndim != 1 or ticks.dtype.kind not in "iuf":
            raise InputError(f"{self.path}: /{clock} holds {ticks.dtype} of shape {ticks.shape}, expected a clock")
        frame = int(np.clip(frame, 0, len(self)))
        if not len(self):
            return 0
        if ticks.dtype.kind == "f":
            after = self.times[-1] + self.config.frame_period
            # Sums and products of the same period differ in the last bit; no sample falls between the two.
            return int(np.searchsorted(ticks, (self.times[frame] if frame < len(self) else after) - 1e-9))
        rows = self._stamps.rows
        return int(np.searchsorted(ticks, rows[frame] if frame < len(self) else rows[-1] + 1))

    def _dataset(self, name: str) -> h5py.Dataset:
        if not self.has(name):
            raise InputError(f"{self.path}: has no /{name}; there are {', '.join(self.names())}")
        with explained(f"{self.path}: /{name} is damaged"):
            return dataset(self.file, name, self.path)

    def _slice(self, data: h5py.Dataset) -> np.ndarray:
        with explained(f"{self.path}: {data.name} is damaged"):
            return data[...]

    def names(self) -> list[str]:
        """Return the paths of all data sets."""
        found: list[str] = []
        with explained(f"{self.path}: its data sets cannot be listed"):
            self.file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return found

    def describe(self, name: str) -> dict[str, object]:
        """Return shape, type, unit and meaning of a data set."""
        data = self._dataset(name)
        with explained(f"{self.path}: /{name} is damaged"):
            notes = {key: str(data.attrs.get(key, "")) for key in ("unit", "about")}
            return {"shape": data.shape, "dtype": str(data.dtype), **notes}

    def labels(self, name: str) -> tuple[str, ...]:
        """Return the meaning of the values 0, 1, ... of a data set; empty if they are numbers.

        Raises:
            InputError: there is no data set of that name.
        """
        return tuple(map(str, self._dataset(name).attrs.get("labels", ())))


@dataclass(frozen=True, eq=False)
class Clip:
    """Some frames of a recording, ``recording[start:stop:step]``, or a single one, ``recording[number]``. Samples are
    read
        on access.

    Attributes:
        recording: the recording.
        numbers: numbers of the frames, counted from 0.
        alone: whether it is a single frame, so that results have no axis of frames.
    """

    recording: Recording
    numbers: range
    alone: bool = False

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, frames: int | slice) -> "Clip":
        if not isinstance(frames, slice):
            number = self.numbers[frames]
            return Clip(self.recording, range(number, number + 1), alone=True)
        if frames.step is not None and frames.step < 1:
            raise InputError(f"{self.recording.path}: frames step by {frames.step}, expected 1 (all frames) or more")
        return Clip(self.recording, self.numbers[frames])

    def __repr__(self) -> str:
        which = f"frame {self.numbers[0]}" if self.alone else f"frames {list(self.numbers)}"
        if len(self) > 4:
            which = f"{len(self)} frames {self.numbers[0]}, {self.numbers[1]} ... {self.numbers[-1]}"
        return f"<{which} of {self.recording.path.name}>"

    @property
    def span(self) -> range:
        """Numbers of the frames from the first to the last, including those skipped by a step."""
        return range(self.numbers.start, self.numbers.stop)

    @property
    def config(self) -> RadarConfig:
        """Configuration of the radar with the frame period of these frames."""
        return self.recording.config.every(self.numbers.step)

    @property
    def times(self) -> Float[np.ndarray, "frame"]:
        """Starts of the frames' first chirps, s."""
        return self.recording.times[self.numbers.start : self.numbers.stop : self.numbers.step]

    @property
    def samples(self) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """Raw I/Q samples, ADC counts.

        Raises:
            InputError: see `Recording.adc`.
        """
        return self._every(self.recording.adc)

    @property
    def valid(self) -> Bool[np.ndarray, "frame loop tx"]:
        """Per chirp, False if samples were lost."""
        return self._every(self.recording.valid)

    @property
    def truth(self) -> Trajectory | None:
        """The part of `Recording.truth` from the start of the first frame to the start of the frame after the last."""
        if (truth := self.recording.truth) is None or not len(self):
            return truth
        first, last = self.recording.times[[self.numbers[0], self.numbers[-1]]]
        return truth.where((truth.time >= first) & (truth.time < last + self.recording.config.frame_period))

    def _every(self, read: Callable[[int, int], np.ndarray]) -> np.ndarray:
        return read(self.numbers.start, self.numbers.stop)[:: self.numbers.step]
