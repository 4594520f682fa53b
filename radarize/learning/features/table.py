"""Maps, other inputs and truth of recordings in memory, for fast indexing; 1 h of two range maps takes 1.7 GB."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import psutil
import torch
from jaxtyping import Float, Float16, Int
from torch import Tensor

from radarize.io.errors import InputError
from radarize.io.jobs import Report, attempt, perform
from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.learning.features.grid import MapGrid, Resampling
from radarize.signal.maps import Maker, MapMaker, maps_of

#: Maps, and all other data, of one recording, by name.
_Read = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]


@dataclass(frozen=True)
class Reading:
    """Data read from a recording's frames: labels, or network inputs other than maps.

    Attributes:
        name: its name.
        where: data set of the recording that it is computed from.
        of: function of a recording and a slice of frames that returns a row per frame; None: rows of the data set.
        on_grid: resamples rows on a radar's grid (first) to another; None: rows have no grid.
    """

    name: str
    where: str
    of: Callable[[Recording, slice], np.ndarray] | None = None
    on_grid: Callable[[np.ndarray, MapGrid, MapGrid], np.ndarray] | None = None

    def rows(self, recording: Recording, frames: slice) -> np.ndarray:
        """Return a row for each of some frames."""
        return self.of(recording, frames) if self.of else recording.read(self.where)[frames]


def _velocity(recording: Recording, frames: slice) -> np.ndarray:
    return recording.read("truth/velocity")[frames, :2].astype(np.float32)


def _yaw(recording: Recording, frames: slice) -> np.ndarray:
    return planar(recording.read("truth/pose")[frames])[:, 2:].astype(np.float32)


#: Truth that several methods train on: m/s (forward, left); rad; m and quaternion.
VELOCITY = Reading("velocity", "truth/velocity", _velocity)
YAW = Reading("yaw", "truth/pose", _yaw)
POSE = Reading("pose", "truth/pose")
_BATCH = 32


@dataclass(frozen=True, eq=False)
class FeatureTable:
    """Consecutive frames of several recordings.

    Attributes:
        maps: maps by name, (frame, row, azimuth) float16, dB.
        truth: labels by name, (frame, ...).
        lengths: number of frames of each recording.
        grid: grid of the maps; None without maps.
        frame_period: s.
        sensed: other network inputs by name, (frame, ...).
    """

    maps: dict[str, Tensor]
    truth: dict[str, Tensor]
    lengths: Sequence[int]
    grid: MapGrid | None
    frame_period: float
    sensed: dict[str, Tensor] = field(default_factory=dict)

    @classmethod
    def read(
        cls,
        paths: Sequence[Path],
        maps: Sequence[str],
        truth: Sequence[Reading] = (),
        sensed: Sequence[Reading] = (),
        maker: type[Maker] = MapMaker,
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: MapGrid | None = None,
    ) -> "FeatureTable":
        """Read recordings of maps, or compute the maps of recordings of samples.

        Args:
            paths: recordings, of one radar configuration unless there is a grid.
            maps: names of maps of `maker`.
            truth, sensed: other data to read.
            maker: class that computes the maps.
            workers: processes that read; more than one is useful if maps have to be computed.
            progress: called with (stage, recordings done, recordings in all).
            grid: grid to which maps of any radar are resampled; None: they have a common grid.

        Raises:
            InputError: a recording lacks data, has another grid of maps, or has truth that is entirely unknown; or
                memory does not suffice.
        """
        lengths, periods, grids = zip(*(_open(path, maps, maker, grid) for path in paths), strict=True)
        for path, period, own in zip(paths, periods, grids, strict=True):
            if maps and (difference := grids[0][maps[0]].difference(own[maps[0]])):
                raise InputError(f"{path}: has maps of {difference} as in {paths[0].name}, expected one radar's")
            if abs(period - periods[0]) > 1e-6:
                raise InputError(
                    f"{path}: has frames every {period:g} s, expected {periods[0]:g} s as in {paths[0].name}"
                )
        shapes = {name: (grid.rows, grid.azimuths) for name, grid in grids[0].items()}
        size = 2 * sum(lengths) * sum(rows * columns for rows, columns in shapes.values())
        if size > (free := psutil.virtual_memory().available):
            raise InputError(
                f"{paths[0].parent}: its maps take {size / 1e9:.1f} GB, expected at most {free / 1e9:.1f} GB"
            )
        joined = {name: np.empty((sum(lengths), *shape), np.float16) for name, shape in shapes.items()}
        ends = np.cumsum(lengths)
        places = {str(path): slice(end - length, end) for path, end, length in zip(paths, ends, lengths, strict=True)}
        todo = {str(path): partial(_read, path, tuple(maps), (*truth, *sensed), maker, grid) for path in paths}
        if workers > 1 and len(paths) > 1:
            reports = (news for news in perform(todo, workers) if news.ended)
        else:
            reports = (attempt(name, job, lambda done: None) for name, job in todo.items())
        others: dict[str, dict[str, np.ndarray]] = {}
        for news in reports:
            if news.error is not None:
                raise news.failure
            made, others[news.name] = cast(_Read, news.result)
            for name in maps:
                joined[name][places[news.name]] = made[name]
            progress("reading", len(others), len(paths))
        rows = {
            reading.name: torch.from_numpy(np.concatenate([others[path][reading.name] for path in places]))
            for reading in (*truth, *sensed)
        }
        return cls(
            {name: torch.from_numpy(values) for name, values in joined.items()},
            {reading.name: rows[reading.name] for reading in truth},
            list(lengths),
            next(iter(grids[0].values()), None),
            periods[0],
            {reading.name: rows[reading.name] for reading in sensed},
        )

    @property
    def duration(self) -> float:
        """Total duration of the recordings, s."""
        return sum(self.lengths) * self.frame_period

    def starts(self, reach: int) -> Int[Tensor, "window"]:
        """Return the frames with `reach` - 1 frames after them in their recording, all with known truth and inputs."""
        first = np.cumsum([0, *self.lengths[:-1]])
        windows = [np.arange(a, a + max(0, n - reach + 1)) for a, n in zip(first, self.lengths, strict=True)]
        found = torch.from_numpy(np.concatenate(windows))
        unknown = torch.zeros(sum(self.lengths) + 1, dtype=torch.int64)  # number of unknown frames before each frame
        for values in (*self.truth.values(), *self.sensed.values()):
            unknown[1:] |= ~values.isfinite().flatten(1).all(dim=1)
        unknown = unknown.cumsum(0)
        return found[unknown[found + reach] == unknown[found]]

    def divide(self, count: int) -> tuple["FeatureTable", "FeatureTable"]:
        """Split into the first `count` recordings, and the others."""
        frame = sum(self.lengths[:count])

        def part(frames: slice, lengths: Sequence[int]) -> FeatureTable:
            def some(columns: dict[str, Tensor]) -> dict[str, Tensor]:
                return {name: rows[frames] for name, rows in columns.items()}

            return replace(
                self, lengths=lengths, maps=some(self.maps), truth=some(self.truth), sensed=some(self.sensed)
            )

        return part(slice(frame), self.lengths[:count]), part(slice(frame, None), self.lengths[count:])

    def on(self, device: torch.device) -> "FeatureTable":
        """Return the table with its maps in a device's memory, where windows are cut many times faster than
        transferred."""
        return replace(self, maps={name: values.to(device) for name, values in self.maps.items()})

    def window(self, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item frame map row azimuth"]:
        """Return the maps of windows of frames."""
        return torch.stack([values[frames] for values in self.maps.values()], dim=2).float()


def _open(
    path: Path, maps: Sequence[str], maker: type[Maker], grid: MapGrid | None
) -> tuple[int, float, dict[str, MapGrid]]:
    """Return number and period of the frames that networks use, and the grids of their maps (`grid` if given)."""
    with Recording(path) as recording:
        stride = maker.stride(recording.config)
        grids = {name: grid or MapGrid.of(recording.config, name, maker) for name in maps}
        return _seen(recording, maker), stride * recording.config.frame_period, grids


def _seen(recording: Recording, maker: type[Maker]) -> int:
    """Return the number of frames of a recording that networks use."""
    return max(0, -(-(len(recording) - maker.warmup) // maker.stride(recording.config)))


def _read(
    path: Path, maps: tuple[str, ...], readings: tuple[Reading, ...], kind: type[Maker], grid: MapGrid | None, _: Report
) -> _Read:
    """Read the maps and other data of one recording, resampled to a grid if given."""
    with Recording(path) as recording:
        maker, count = kind(recording.config), len(recording)
        stride = maker.stride(recording.config)
        size = _BATCH * stride
        starts = range(kind.warmup, count if maps else 0, size)
        own, bring = {}, {}
        if grid is not None:
            own = {name: MapGrid.of(recording.config, name, kind) for name in maps}
            bring = {n: Resampling.between(grid, g, kind.axes(recording.config, n).centred) for n, g in own.items()}
        parts = []
        for start in starts:
            made = maps_of(recording, start, min(start + size, count), maps, maker, stride)
            parts.append({name: _brought(values, bring.get(name)) for name, values in made.items()})
        found, frames = {}, slice(kind.warmup, count, stride)
        for reading in readings:
            rows = reading.rows(recording, frames)
            if grid is not None and reading.on_grid is not None:
                rows = reading.on_grid(rows, own[maps[0]], grid)
            found[reading.name] = rows
            # Some values may be unknown, since a tracking camera sometimes loses tracking.
            if len(rows) < _seen(recording, kind) or not np.isfinite(rows).any():
                raise InputError(f"{path}: /{reading.where} lacks values or has no numbers, expected {count} frames")
        return {name: np.concatenate([part[name] for part in parts]) for name in maps}, found


def _brought(
    made: Float[np.ndarray, "frame row azimuth"], resampling: Resampling | None
) -> Float16[np.ndarray, "frame known azimuth"]:
    """Resample maps, if there is a resampling."""
    if resampling is None:
        return made.astype(np.float16, copy=False)
    return resampling(torch.from_numpy(made).float()[:, None])[:, 0].half().numpy()
