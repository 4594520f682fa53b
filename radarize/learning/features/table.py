"""Recordings' maps, other readings and truth in memory, ready to be indexed: an hour of two range maps takes 1.7 GB."""

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

#: Maps, and all else, of one recording, by name.
_Read = tuple[dict[str, np.ndarray], dict[str, np.ndarray]]


@dataclass(frozen=True)
class Reading:
    """What is read of a recording's frames: labels, or what networks see besides maps.

    Attributes:
        name: of it.
        where: data set of the recording that it is made of.
        of: makes it of some of a recording's frames, a row a frame; None: it is those rows of the data set.
        on_grid: brings rows that lie on a radar's grid (first) to another; None: they lie on none.
    """

    name: str
    where: str
    of: Callable[[Recording, slice], np.ndarray] | None = None
    on_grid: Callable[[np.ndarray, MapGrid, MapGrid], np.ndarray] | None = None

    def rows(self, recording: Recording, frames: slice) -> np.ndarray:
        """A row for each of some frames."""
        return self.of(recording, frames) if self.of else recording.read(self.where)[frames]


def _velocity(recording: Recording, frames: slice) -> np.ndarray:
    return recording.read("truth/velocity")[frames, :2].astype(np.float32)


def _yaw(recording: Recording, frames: slice) -> np.ndarray:
    return planar(recording.read("truth/pose")[frames])[:, 2:].astype(np.float32)


#: Truth that several methods learn from: m/s (forward, left); rad; m and quaternion.
VELOCITY = Reading("velocity", "truth/velocity", _velocity)
YAW = Reading("yaw", "truth/pose", _yaw)
POSE = Reading("pose", "truth/pose")
_BATCH = 32


@dataclass(frozen=True, eq=False)
class FeatureTable:
    """Frames of recordings, one after the other.

    Attributes:
        maps: by name, (frame, row, azimuth) float16, dB.
        truth: labels by name, (frame, ...).
        lengths: frames of each recording.
        grid: of the maps; None without any.
        frame_period: s.
        sensed: what else networks see by name, (frame, ...).
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
        """Read recordings of maps, or make the maps of recordings of samples.

        Args:
            paths: recordings, of one radar configuration unless there is a grid.
            maps: names of `maker`'s.
            truth, sensed: what else to read.
            maker: of the maps.
            workers: processes that read; more than one pays where maps have to be made.
            progress: called with (stage, recordings done, recordings in all).
            grid: to which maps of any radar are brought; None: they lie on one already.

        Raises:
            InputError: a recording lacks something, differs from the others in its maps' grid, has truth that is all
                unknown, or memory does not suffice.
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
            heard = (news for news in perform(todo, workers) if news.ended)
        else:
            heard = (attempt(name, job, lambda done: None) for name, job in todo.items())
        others: dict[str, dict[str, np.ndarray]] = {}
        for news in heard:
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
        """Of all recordings, s."""
        return sum(self.lengths) * self.frame_period

    def starts(self, reach: int) -> Int[Tensor, "window"]:
        """Frames that have `reach` - 1 more after them in their recording, with truth and readings that are known."""
        first = np.cumsum([0, *self.lengths[:-1]])
        windows = [np.arange(a, a + max(0, n - reach + 1)) for a, n in zip(first, self.lengths, strict=True)]
        found = torch.from_numpy(np.concatenate(windows))
        blind = torch.zeros(sum(self.lengths) + 1, dtype=torch.int64)  # unknown ones up to each frame
        for values in (*self.truth.values(), *self.sensed.values()):
            blind[1:] |= ~values.isfinite().flatten(1).all(dim=1)
        blind = blind.cumsum(0)
        return found[blind[found + reach] == blind[found]]

    def divide(self, count: int) -> tuple["FeatureTable", "FeatureTable"]:
        """The first `count` recordings, and the others."""
        frame = sum(self.lengths[:count])

        def part(frames: slice, lengths: Sequence[int]) -> FeatureTable:
            def some(columns: dict[str, Tensor]) -> dict[str, Tensor]:
                return {name: rows[frames] for name, rows in columns.items()}

            return replace(
                self, lengths=lengths, maps=some(self.maps), truth=some(self.truth), sensed=some(self.sensed)
            )

        return part(slice(frame), self.lengths[:count]), part(slice(frame, None), self.lengths[count:])

    def on(self, device: torch.device) -> "FeatureTable":
        """With its maps in a device's memory, where windows are cut out many times faster than they are sent."""
        return replace(self, maps={name: values.to(device) for name, values in self.maps.items()})

    def window(self, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item frame map row azimuth"]:
        """Maps of windows of frames."""
        return torch.stack([values[frames] for values in self.maps.values()], dim=2).float()


def _open(
    path: Path, maps: Sequence[str], maker: type[Maker], grid: MapGrid | None
) -> tuple[int, float, dict[str, MapGrid]]:
    """Frames that networks see, their period, and the grids of their maps: that one, if they are brought to one."""
    with Recording(path) as recording:
        stride = maker.stride(recording.config)
        grids = {name: grid or MapGrid.of(recording.config, name, maker) for name in maps}
        return _seen(recording, maker), stride * recording.config.frame_period, grids


def _seen(recording: Recording, maker: type[Maker]) -> int:
    """Frames of a recording that networks see."""
    return max(0, -(-(len(recording) - maker.warmup) // maker.stride(recording.config)))


def _read(
    path: Path, maps: tuple[str, ...], readings: tuple[Reading, ...], kind: type[Maker], grid: MapGrid | None, _: Report
) -> _Read:
    """Maps, and all else, of one recording, on a grid if there is one."""
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
            # Some may be unknown: a tracking camera is blind now and then.
            if len(rows) < _seen(recording, kind) or not np.isfinite(rows).any():
                raise InputError(f"{path}: /{reading.where} lacks values or holds no numbers, expected {count} frames")
        return {name: np.concatenate([part[name] for part in parts]) for name in maps}, found


def _brought(
    made: Float[np.ndarray, "frame row azimuth"], resampling: Resampling | None
) -> Float16[np.ndarray, "frame known azimuth"]:
    """Maps on another grid, if there is one."""
    if resampling is None:
        return made.astype(np.float16, copy=False)
    return resampling(torch.from_numpy(made).float()[:, None])[:, 0].half().numpy()
