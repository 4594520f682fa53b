"""Recordings' maps and truth in memory, float16, ready to be indexed: an hour of two range maps takes 1.7 GB."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import psutil
import torch
from jaxtyping import Float, Int
from torch import Tensor

from radarize.errors import InputError
from radarize.nets.weights import Grid
from radarize.published import labels
from radarize.recording import Recording
from radarize.settings import SETTINGS
from radarize.training.maps import maps_of
from radarize.tum import planar

#: What labels are made of, by name: path in the recording, and what is made of some of a recording's frames there.
TRUTH: dict[str, tuple[str, Callable[[Recording, slice], np.ndarray]]] = {
    "velocity": ("truth/velocity", lambda r, f: r.read("truth/velocity")[f, :2].astype(np.float32)),
    "yaw": ("truth/pose", lambda r, f: planar(r.read("truth/pose")[f])[:, 2:].astype(np.float32)),
    "occupancy": ("truth/occupancy", lambda r, f: r.read("truth/occupancy")[f]),
    "published_velocity": ("truth/pose", labels.velocity),
    "published_occupancy": ("truth/depth", labels.occupancy),
}
_BATCH = 32


class Table:
    """Frames of recordings, one after the other.

    Attributes:
        maps: by name, (frame, row, azimuth) float16, dB.
        truth: by name, (frame, ...), keys of `TRUTH`.
        lengths: frames of each recording.
        grid: of the maps.
    """

    def __init__(self, maps: dict[str, Tensor], truth: dict[str, Tensor], lengths: Sequence[int], grid: Grid):
        self.maps, self.truth, self.lengths, self.grid = maps, truth, list(lengths), grid

    @classmethod
    def read(
        cls,
        paths: Sequence[Path],
        maps: Sequence[str],
        truth: Sequence[str],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        setting: str = "corrected",
    ) -> "Table":
        """Read recordings of maps, or make the maps of recordings of samples.

        Args:
            paths: recordings of one radar configuration.
            maps, truth: what to read.
            workers: processes that read; more than one pays where maps have to be made.
            progress: called with (stage, recordings done, recordings in all).
            setting: key of `radarize.settings.SETTINGS`, which says which maps there are.

        Raises:
            InputError: a recording lacks something, differs from the others in its maps' grid, has truth that is all
                unknown, or memory does not suffice.
        """
        lengths, grids = zip(*(_open(path, maps[0], setting) for path in paths), strict=True)
        for path, grid in zip(paths, grids, strict=True):
            if difference := grids[0].difference(grid):
                raise InputError(f"{path}: has maps of {difference} as in {paths[0].name}, expected one radar's")
        shapes = _shapes(paths[0], maps, setting)
        size = 2 * sum(lengths) * sum(rows * columns for rows, columns in shapes.values())
        if size > (free := psutil.virtual_memory().available):
            raise InputError(
                f"{paths[0].parent}: its maps take {size / 1e9:.1f} GB, expected at most {free / 1e9:.1f} GB"
            )
        joined = {name: np.empty((sum(lengths), *shape), np.float16) for name, shape in shapes.items()}
        labels: dict[str, list[np.ndarray]] = {name: [] for name in truth}
        arguments = [(path, tuple(maps), tuple(truth), setting) for path in paths]
        pool = ProcessPoolExecutor(workers, get_context("spawn")) if workers > 1 and len(paths) > 1 else None
        try:
            first = 0
            for done, (made, rows) in enumerate((pool.map if pool else map)(_read, arguments)):
                for name in maps:
                    joined[name][first : first + lengths[done]] = made[name]
                for name in truth:
                    labels[name].append(rows[name])
                first += lengths[done]
                progress("reading", done + 1, len(paths))
        finally:
            if pool:
                pool.shutdown(cancel_futures=True)
        return cls(
            {name: torch.from_numpy(values) for name, values in joined.items()},
            {name: torch.from_numpy(np.concatenate(values)) for name, values in labels.items()},
            lengths,
            grids[0],
        )

    def starts(self, reach: int) -> Int[Tensor, "window"]:
        """Frames that have `reach` - 1 more after them in their recording, all of them with truth that is known."""
        first = np.cumsum([0, *self.lengths[:-1]])
        windows = [np.arange(a, a + max(0, n - reach + 1)) for a, n in zip(first, self.lengths, strict=True)]
        found = torch.from_numpy(np.concatenate(windows))
        blind = torch.zeros(sum(self.lengths) + 1, dtype=torch.int64)  # unknown ones up to each frame
        for values in self.truth.values():
            blind[1:] |= ~values.isfinite().flatten(1).all(dim=1)
        blind = blind.cumsum(0)
        return found[blind[found + reach] == blind[found]]

    def divide(self, count: int) -> tuple["Table", "Table"]:
        """The first `count` recordings, and the others."""
        frame = sum(self.lengths[:count])
        return tuple(
            Table(
                {name: values[part] for name, values in self.maps.items()},
                {name: values[part] for name, values in self.truth.items()},
                lengths,
                self.grid,
            )
            for part, lengths in ((slice(frame), self.lengths[:count]), (slice(frame, None), self.lengths[count:]))
        )

    def window(self, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item frame map row azimuth"]:
        """Maps of windows of frames."""
        return torch.stack([values[frames] for values in self.maps.values()], dim=2).float()


def _shapes(path: Path, maps: Sequence[str], setting: str) -> dict[str, tuple[int, int]]:
    with Recording(path) as recording:
        axes = {name: SETTINGS[setting].maker.axes(recording.config, name) for name in maps}
    return {name: (own.rows, len(own.azimuths)) for name, own in axes.items()}


def _open(path: Path, name: str, setting: str) -> tuple[int, Grid]:
    """Frames that networks see, and their grid."""
    with Recording(path) as recording:
        stride = SETTINGS[setting].maker.stride(recording.config)
        return -(-len(recording) // stride), Grid.of(recording.config, name, setting)


def _read(arguments: tuple[Path, tuple[str, ...], tuple[str, ...], str]) -> tuple[dict, dict]:
    """Maps and labels of one recording."""
    path, maps, truth, setting = arguments
    with Recording(path) as recording:
        maker, count = SETTINGS[setting].maker(recording.config), len(recording)
        stride = maker.stride(recording.config)
        size = _BATCH * stride
        parts = [
            maps_of(recording, start, min(start + size, count), maps, maker, stride) for start in range(0, count, size)
        ]
        found, frames = {}, slice(0, count, stride)
        for name in truth:
            where, of = TRUTH[name]
            found[name] = of(recording, frames)
            # Some may be unknown: a tracking camera is blind now and then.
            if len(found[name]) < -(-count // stride) or not np.isfinite(found[name]).any():
                raise InputError(f"{path}: /{where} lacks values or holds no numbers, expected {count} frames")
        return {name: np.concatenate([part[name] for part in parts]) for name in maps}, found
