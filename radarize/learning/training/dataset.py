"""Recordings as a torch `Dataset`: windows of frames with their truth, read lazily, from any number of processes."""

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
from radarize.signal.maps import MAPS, MapMaker, maps_of

#: Truth by the name of a field, as the path in the recording and the columns of it.
TRUTH = {
    "velocity": ("truth/velocity", slice(0, 3)),  # m/s, sensor frame, at the burst's centre
    "pose": ("truth/pose", slice(None)),  # position m, quaternion x y z w
    "scan": ("truth/scan", slice(None)),  # m, first surface by bearing
    "depth": ("truth/depth", slice(None)),  # mm, 0 where there is none
    "occupancy": ("truth/occupancy", slice(None)),  # polar labels
}
DEFAULT = ("range_azimuth", "elevation_aware", "doppler_azimuth", "doppler_elevation_aware", "velocity", "turn", "scan")


class FrameDataset(Dataset):
    """Windows of frames of the recordings in a folder, as dictionaries of tensors.

    Args:
        folder: what `radarsim dataset` wrote, or any folder of recordings (then without splits).
        split: a name of the specification's splits, such as ``random-0``; None for all recordings.
        part: ``train``, ``validation`` or ``test``.
        fields: of an item, each with the window as its first axis: maps (`radarize.signal.maps.MAPS`, float32, dB),
            ``adc`` (int16 samples), ``time`` (s), truth (`TRUTH`), and ``turn``: the change of yaw from each frame of
            the window to the next, rad, positive to the left, one fewer than frames.
        window: frames of an item.
        spacing: frames from one frame of a window to the next.
        stride: frames from one window's start to the next one's.

    Raises:
        InputError: no recordings, an unknown split, part or field, or truth that a recording lacks.
    """

    def __init__(
        self,
        folder: str | Path,
        split: str | None = None,
        part: str = "train",
        fields: Sequence[str] = DEFAULT,
        window: int = 2,
        spacing: int = 1,
        stride: int = 1,
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
        self._ends = np.cumsum([self._count(path) for path in self.paths])
        if not self._ends[-1]:
            raise InputError(f"{folder}: no recording has {self._reach} frames, expected enough for a window")

    def _count(self, path: Path) -> int:
        """Windows in a recording, which must have all that is asked for."""
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

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        index %= len(self)
        number = int(np.searchsorted(self._ends, index, side="right"))
        first = (index - (int(self._ends[number - 1]) if number else 0)) * self.stride
        recording, maker = self._recording(number)
        frames = slice(first, first + self._reach, self.spacing)

        item: dict[str, np.ndarray] = {}
        names = tuple(field for field in self.fields if field in MAPS)
        if names:
            item |= maps_of(recording, first, frames.stop, names, maker, self.spacing)
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
        return {name: _tensor(item[name]) for name in self.fields}

    def _recording(self, number: int) -> tuple[Recording, MapMaker]:
        """Opened at first use, by every process for itself: HDF5 files do not survive a fork."""
        key = os.getpid(), number
        if key not in self._open:
            recording = Recording(self.paths[number])
            self._open[key] = recording, MapMaker(recording.config)
        return self._open[key]

    def __getstate__(self) -> dict:
        return self.__dict__ | {"_open": {}}


def recordings(folder: str | Path, split: str | None = None, part: str = "train") -> list[Path]:
    """Recordings of a folder, or of one part of a split of its specification.

    Raises:
        InputError: none there, no such split or part, or one that has not been made yet.
    """
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


def _tensor(values: np.ndarray) -> torch.Tensor:
    values = np.asarray(values)
    return torch.from_numpy(values.astype(np.float32) if values.dtype.kind == "f" else values)
