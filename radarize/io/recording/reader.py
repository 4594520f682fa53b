"""Reading a recording, finished, growing, or left behind by a crash."""

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

#: Environment variable by which `radarize train --board` hands a board's file to all that read recordings.
BOARD = "RADARIZE_BOARD"


@dataclass(eq=False, repr=False)
class Recording:
    """A recording opened for reading; use as a context manager, or keep it open.

    ``recording[100]`` and ``recording[100:110]`` are frames, see `Clip`; ``len(recording)`` is how many there are.
    Damaged frames cost themselves alone: what cannot be unpacked is lost (zero, and not valid), and a damaged stamp is
    made anew from its neighbours, or its frame left out; `damage` says so.

    Args:
        path: an ``.h5`` file, finished, growing, or left behind by a crash.
        board: of the radar, with its calibration, instead of the recording's own: a board's file, a name, or a board.
            By default that of the environment variable `BOARD`, if a command has set it for its jobs.

    Attributes:
        config: of the radar.
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
        """Leave out frames at the end that have neither stamps nor samples: those that were about to be written."""
        mended, count = set(self._stamps.mended.tolist()), len(self._stamps.rows)
        while self._adc is not None and count and (row := int(self._stamps.rows[count - 1])) in mended:
            if self._rows_of(self._adc).stored(row):
                break
            count -= 1
        if count < len(self._stamps.rows):
            self._stamps.keep(np.arange(len(self._stamps.rows)) < count)

    @property
    def damage(self) -> list[str]:
        """Sentences on what of the file is damaged, as far as it has been read; empty for a sound one.

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
        """Some frames; none of them is read before it is asked for.

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
        """Whether raw samples were kept."""
        return self._adc is not None

    @property
    def attributes(self) -> dict[str, object]:
        """Scene, seed, versions and the like.

        Raises:
            InputError: they are damaged.
        """
        with explained(f"{self.path}: its attributes are damaged"):
            return {k: v.item() if isinstance(v, np.generic) else v for k, v in self.file.attrs.items()}

    def adc(self, start: int, stop: int) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """Raw samples of frames start...stop-1; zero where a frame's chunk on disk is damaged, see `valid`.

        Raises:
            InputError: only heat maps were kept.
        """
        if self._adc is None:
            raise InputError(f"{self.path}: has no raw samples, only heat maps, expected a recording with /radar/adc")
        return self._frames(self._adc, start, stop)

    def valid(self, start: int, stop: int) -> Bool[np.ndarray, "frame loop tx"]:
        """Per chirp: False where samples were lost, or their frame cannot be unpacked."""
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
        """Rows of frames start...stop-1, of data with a row for each."""
        with explained(f"{self.path}: frames {start}...{stop - 1} of {data.name} cannot be read"):
            rows = self._stamps.rows[start:stop]
            first = int(rows[0]) if len(rows) else 0
            found = self._rows_of(data).read(first, int(rows[-1]) + 1 if len(rows) else 0)
            places = (rows - first)[rows - first < len(found)]
            return found if len(places) == len(found) else found[places]

    def batches(self, size: int = 32) -> Iterator[tuple[slice, np.ndarray]]:
        """Frames in batches, as (slice of frames, raw samples)."""
        for start in range(0, len(self), size):
            stop = min(start + size, len(self))
            yield slice(start, stop), self.adc(start, stop)

    def has(self, name: str) -> bool:
        """Whether a data set such as ``truth/pose`` is there."""
        with explained(f"{self.path}: is damaged"):
            return name in self.file

    def read(self, name: str) -> np.ndarray:
        """A whole data set by path; of a stream, nothing past the last whole frame.

        Raises:
            InputError: there is none of that name, or it is damaged.
        """
        data = self._dataset(name)
        return self.rows(name, 0, len(self)) if self._clock(data) else self._slice(data)

    def true_poses(self) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]] | None:
        """Stamps (s) and poses (position m, quaternion x y z w) of the truth where it is known; None without truth."""
        if not (self.has("truth/time") and self.has("truth/pose")):
            return None
        times, poses = self.read("truth/time"), self.read("truth/pose")
        shared = min(len(times), len(poses))
        seen = np.isfinite(poses[:shared]).all(axis=1)  # a tracking camera may have been blind for a while
        return times[:shared][seen], poses[:shared][seen]

    @property
    def truth(self) -> Trajectory | None:
        """True poses where they are known, with velocities and floor plan where these are; None without truth."""
        if (poses := self.true_poses()) is None:
            return None
        velocity = self.read("truth/velocity") if self.has("truth/velocity") else np.zeros((0, 3))
        plan = self.read("truth/floor_plan") if self.has("truth/floor_plan") else None
        known = velocity if len(velocity) == len(poses[0]) else None
        return Trajectory(*poses, velocity=known, floor_plan=plan, name="truth")

    def rows(self, name: str, start: int, stop: int) -> np.ndarray:
        """Rows of a stream that belong to frames start...stop-1.

        Of a stream at its own rate: from the first frame's start until the frame after the last starts.

        Raises:
            InputError: there is none of that name, it is no stream, or it is damaged.
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
        numbers = np.searchsorted(self._stamps.rows, ticks)  # of frames, where some rows are none
        known = np.isin(ticks, self._stamps.rows)[: len(found)]
        return (numbers.astype(found.dtype) if name == clock else found)[known]

    def _clock(self, data: h5py.Dataset) -> str:
        """Name of the data set that says what a stream's rows belong to; empty where there is none."""
        with explained(f"{self.path}: {data.name} is damaged"):
            clock = str(data.attrs.get("clock", ""))
            if clock and not data.ndim:
                raise InputError(f"{self.path}: {data.name} is a single value with a clock, expected rows")
            return clock

    def _row(self, clock: str, frame: int) -> int:
        """First row of a stream at its own rate that belongs to `frame` or a later one."""
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
        """Paths of all data sets."""
        found: list[str] = []
        with explained(f"{self.path}: its data sets cannot be listed"):
            self.file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        return found

    def describe(self, name: str) -> dict[str, object]:
        """Shape, type, unit and meaning of a data set."""
        data = self._dataset(name)
        with explained(f"{self.path}: /{name} is damaged"):
            notes = {key: str(data.attrs.get(key, "")) for key in ("unit", "about")}
            return {"shape": data.shape, "dtype": str(data.dtype), **notes}

    def labels(self, name: str) -> tuple[str, ...]:
        """What the values 0, 1, ... of a data set stand for; empty where they are numbers.

        Raises:
            InputError: there is no data set of that name.
        """
        return tuple(map(str, self._dataset(name).attrs.get("labels", ())))


@dataclass(frozen=True, eq=False)
class Clip:
    """Some frames of a recording, by ``recording[start:stop:step]``, or one of them, by ``recording[number]``. Samples
    are read when they are asked for.

    Attributes:
        recording: that they are of.
        numbers: of the frames, counted from 0.
        alone: it is one frame, and what is made of it has no axis of frames.
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
        """Numbers of the frames, those included that lie between every N-th."""
        return range(self.numbers.start, self.numbers.stop)

    @property
    def config(self) -> RadarConfig:
        """Of a radar that delivers no more frames than these."""
        return self.recording.config.every(self.numbers.step)

    @property
    def times(self) -> Float[np.ndarray, "frame"]:
        """Starts of the frames' first chirps, s."""
        return self.recording.times[self.numbers.start : self.numbers.stop : self.numbers.step]

    @property
    def samples(self) -> Int16[np.ndarray, "frame loop tx rx sample 2"]:
        """Raw I/Q, ADC counts.

        Raises:
            InputError: see `Recording.adc`.
        """
        return self._every(self.recording.adc)

    @property
    def valid(self) -> Bool[np.ndarray, "frame loop tx"]:
        """Per chirp: False where samples were lost."""
        return self._every(self.recording.valid)

    @property
    def truth(self) -> Trajectory | None:
        """The part of `Recording.truth` from the first frame's start until the frame after the last starts."""
        if (truth := self.recording.truth) is None or not len(self):
            return truth
        first, last = self.recording.times[[self.numbers[0], self.numbers[-1]]]
        return truth.where((truth.time >= first) & (truth.time < last + self.recording.config.frame_period))

    def _every(self, read: Callable[[int, int], np.ndarray]) -> np.ndarray:
        return read(self.numbers.start, self.numbers.stop)[:: self.numbers.step]
