"""Recordings as a torch `Dataset`: windows of frames with their truth, read on access, from any number of processes.

| field | axes, after those of the window | unit |
|---|---|---|
| range_azimuth, elevation_aware | range bins from 0, azimuth -59.25...59.25 deg ascending to the left (80) | dB |
| doppler_azimuth, doppler_elevation_aware | closing speed ascending, zero in row n / 2; azimuth as above | dB |
| adc | loop, tx, rx, sample, I and Q; int16 | counts |
| time | (none); float64: start of the frame | s |
| velocity, pose | forward, left, up; x y z qx qy qz qw | m/s; m |
| turn | (none), one fewer than frames: change of yaw, positive to the left | rad |
| scan | bearing, `radarize.signal.bearings.BEARINGS` | m |
| depth, occupancy | row, column; range cell, azimuth | mm; class |

`FrameDataset.axes` has the values of axes. Maps are those of the shipped networks: `rz.range_azimuth` and
`rz.doppler_azimuth` at these azimuths, the latter of an amplitude-limited spectrum, in dB of squared ADC counts, at
least -30 dB, rounded to 0.25 dB (`radarize.signal.maps`). Networks subtract the mean of each map and divide by 10 dB
(`radarize.learning.nets.maps.level`), which removes the receiver's gain.
"""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Dataset

from radarize.io.errors import InputError, explained
from radarize.io.jsonfile import read_json
from radarize.io.pose import wrap
from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.signal.maps import MAPS, Axes, MapMaker, maps_of

#: Truth by field name: path in the recording, and columns.
TRUTH = {
    "velocity": ("truth/velocity", slice(0, 3)),  # m/s, sensor frame, at the burst's centre
    "pose": ("truth/pose", slice(None)),  # position m, quaternion x y z w
    "scan": ("truth/scan", slice(None)),  # m, first surface by bearing
    "depth": ("truth/depth", slice(None)),  # mm, 0 where there is none
    "occupancy": ("truth/occupancy", slice(None)),  # polar labels
}
DEFAULT = ("range_azimuth", "elevation_aware", "doppler_azimuth", "doppler_elevation_aware", "velocity", "turn", "scan")


class FrameDataset(Dataset):
    """Windows of frames of recordings, as dictionaries of tensors.

    Args:
        folder: folder from `radarsim dataset`, or any folder of recordings, or a recording, or several (splits need the
            first).
        split: split in the specification, such as ``random-0``; None for all recordings.
        part: ``train``, ``validation`` or ``test``.
        fields: fields of an item, each with the window as first axis: maps (`radarize.signal.maps.MAPS`, float32, dB),
            ``adc`` (int16 samples), ``time`` (s, float64), truth (`TRUTH`), and ``turn``: change of yaw from each frame
            of the window to the next, rad, positive to the left, one fewer than frames.
        window: number of frames of an item.
        spacing: spacing between frames of a window, in frames.
        stride: frames between the starts of consecutive windows.
        cache: keep computed maps in memory, 31 kB per frame and map of 96 x 80 cells, in each worker process (which
            should be persistent); computing them takes about 10 ms per frame.

    Raises:
        InputError: no recordings, an unknown split, part or field, or truth that a recording lacks.
    """

    def __init__(
        self,
        folder: str | Path | Sequence[str | Path],
        split: str | None = None,
        part: str = "train",
        fields: Sequence[str] = DEFAULT,
        window: int = 2,
        spacing: int = 1,
        stride: int = 1,
        cache: bool = False,
    ):
        known = (*MAPS, "adc", "time", "turn", *TRUTH)
        for field in fields:
            if field not in known:
                raise InputError(f"fields names {field!r}, expected some of: {', '.join(known)}")
        if min(window, spacing, stride) < 1:
            raise InputError(
                f"window, spacing and stride are {window}, {spacing}, {stride}, expected positive numbers of frames"
            )
        self.fields, self.window, self.spacing, self.stride = tuple(fields), window, spacing, stride
        self.paths = recordings(folder, split, part)
        self._open: dict[tuple[int, int], tuple[Recording, MapMaker]] = {}
        self._cache, self._kept = cache, dict[tuple[int, int], dict[str, np.ndarray]]()
        self._ends = np.cumsum([self._count(path) for path in self.paths])
        if not self._ends[-1]:
            raise InputError(f"{folder}: no recording has {self._reach} frames, expected enough for a window")

    def _count(self, path: Path) -> int:
        """Return the number of windows in a recording; raise if it lacks a requested field."""
        needed = [TRUTH[f][0] for f in self.fields if f in TRUTH] + ["truth/pose"] * ("turn" in self.fields)
        needed += ["radar/adc"] * ("adc" in self.fields)
        with Recording(path) as recording:
            for name in needed:
                if not recording.has(name):
                    raise InputError(f"{path}: has no /{name}; there are {', '.join(recording.names())}")
            return max(0, -(-(len(recording) - self._reach + 1) // self.stride))

    @property
    def _reach(self) -> int:
        return (self.window - 1) * self.spacing + 1

    @property
    def axes(self) -> dict[str, Axes]:
        """Rows, row step (m or m/s) and azimuths (rad) of the maps, for the first recording's radar.

        Example:
            >>> rz.torch_dataset("walk.h5", features=["doppler_azimuth"]).axes["doppler_azimuth"].step  # m/s
            0.118...
        """
        with Recording(self.paths[0]) as recording:
            return {field: MapMaker.axes(recording.config, field) for field in self.fields if field in MAPS}

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        index %= len(self)
        number = int(np.searchsorted(self._ends, index, side="right"))
        first = (index - (int(self._ends[number - 1]) if number else 0)) * self.stride
        recording, _ = self._recording(number)
        frames = slice(first, first + self._reach, self.spacing)

        item: dict[str, np.ndarray] = {}
        names = tuple(field for field in self.fields if field in MAPS)
        if names:
            item |= self._maps(number, frames, names)
        for field in self.fields:
            if field in TRUTH:
                path, columns = TRUTH[field]
                item[field] = recording.rows(path, first, frames.stop)[:: self.spacing][:, columns]
            elif field == "adc":
                item[field] = recording.adc(first, frames.stop)[:: self.spacing]
            elif field == "time":
                item[field] = recording.times[frames]
            elif field == "turn":
                poses = recording.rows("truth/pose", first, frames.stop)[:: self.spacing]
                item[field] = wrap(np.diff(planar(poses)[:, 2]))
        return {name: _tensor(item[name], exact=name == "time") for name in self.fields}

    def _maps(self, number: int, frames: slice, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        """Return the maps of a window of a recording's frames."""
        recording, maker = self._recording(number)
        if not self._cache:
            return maps_of(recording, frames.start, frames.stop, names, maker, self.spacing)
        wanted = range(frames.start, frames.stop, self.spacing)
        for frame in wanted:
            if (number, frame) not in self._kept:
                made = maps_of(recording, frame, frame + 1, names, maker)
                self._kept[number, frame] = {name: values[0].copy() for name, values in made.items()}
        return {name: np.stack([self._kept[number, frame][name] for frame in wanted]) for name in names}

    def _recording(self, number: int) -> tuple[Recording, MapMaker]:
        """Return a recording, opened by each process on first use, since HDF5 files do not survive a fork."""
        key = os.getpid(), number
        if key not in self._open:
            recording = Recording(self.paths[number])
            self._open[key] = recording, MapMaker(recording.config)
        return self._open[key]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_open": {}}


def recordings(folder: str | Path | Sequence[str | Path], split: str | None = None, part: str = "train") -> list[Path]:
    """Return the recordings of a folder, or of a part of a split of its specification, or the named ones.

    Raises:
        InputError: there are none, no such split or part, or recordings of it are missing.
    """
    if isinstance(folder, str | Path) and Path(folder).suffix == ".h5" and not Path(folder).is_dir():
        folder = [folder]
    if not isinstance(folder, str | Path):
        if split is not None:
            raise InputError(
                f"split is {split!r}, but single recordings are named, expected a folder with dataset.json"
            )
        if not folder:
            raise InputError("data names no recording, expected at least one")
        return [Path(path) for path in folder]
    folder = Path(folder)
    if split is None:
        found = sorted(folder.glob("*.h5"))
        if not found:
            raise InputError(f"{folder}: holds no recordings, expected *.h5")
        return found
    index = folder / "dataset.json"
    if not index.is_file():
        raise InputError(f"{index}: no such file, expected a data set with splits, as `radarsim dataset` makes it")
    with explained(f"{index}: is no readable data set, needed for a split"):
        splits = read_json(index)["splits"]
    if split not in splits:
        raise InputError(f"{index}: has no split {split!r}, expected one of: {', '.join(splits) or 'there are none'}")
    if part not in splits[split]:
        raise InputError(f"part is {part!r}, expected one of: {', '.join(splits[split])}")
    found = [folder / f"{name}.h5" for name in splits[split][part]]
    if missing := [path.name for path in found if not path.is_file()]:
        raise InputError(f"{folder}: lacks {missing[0]} and {len(missing) - 1} more of {split}/{part}; make them first")
    if not found:
        raise InputError(f"{index}: {split}/{part} is empty, expected at least one recording")
    return found


def _tensor(values: np.ndarray, exact: bool = False) -> torch.Tensor:
    """Return numbers as float32, except float64 where needed: stamps of frames differ in the 11th digit."""
    values = np.asarray(values)
    return torch.from_numpy(values.astype(np.float32) if values.dtype.kind == "f" and not exact else values)
