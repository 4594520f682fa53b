"""Recordings' maps, other readings and truth in memory, ready to be indexed: an hour of two range maps takes 1.7 GB."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import psutil
import torch
from jaxtyping import Float, Int
from torch import Tensor

from radarize.baselines import inertial, panorama, radarhd
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
    "scan": ("truth/scan", radarhd.bins),
    "pose": ("truth/pose", lambda r, f: r.read("truth/pose")[f]),
    "displacement": ("truth/pose", inertial.displacement),
    "published_velocity": ("truth/pose", labels.velocity),
    "published_occupancy": ("truth/depth", labels.occupancy),
}
#: What networks read of a frame besides maps, by name, likewise.
SENSED: dict[str, tuple[str, Callable[[Recording, slice], np.ndarray]]] = {
    "panorama": ("radar/adc", panorama.seen),
    "imu": ("imu/time", inertial.latest),
    "levelled": ("imu/time", inertial.levelled),
}
_BATCH = 32


class Table:
    """Frames of recordings, one after the other.

    Attributes:
        maps: by name, (frame, row, azimuth) float16, dB.
        truth: by name, (frame, ...), keys of `TRUTH`.
        lengths: frames of each recording.
        grid: of the maps; None without any.
        frame_period: s.
        sensed: by name, (frame, ...), keys of `SENSED`.
    """

    def __init__(
        self,
        maps: dict[str, Tensor],
        truth: dict[str, Tensor],
        lengths: Sequence[int],
        grid: Grid | None,
        frame_period: float,
        sensed: dict[str, Tensor] | None = None,
    ):
        self.maps, self.truth, self.lengths, self.grid = maps, truth, list(lengths), grid
        self.frame_period, self.sensed = frame_period, sensed or {}

    @classmethod
    def read(
        cls,
        paths: Sequence[Path],
        maps: Sequence[str],
        truth: Sequence[str],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        setting: str = "corrected",
        sensed: Sequence[str] = (),
    ) -> "Table":
        """Read recordings of maps, or make the maps of recordings of samples.

        Args:
            paths: recordings of one radar configuration.
            maps, truth: what to read.
            workers: processes that read; more than one pays where maps have to be made.
            progress: called with (stage, recordings done, recordings in all).
            setting: key of `radarize.settings.SETTINGS`, which says which maps there are.
            sensed: what else to read.

        Raises:
            InputError: a recording lacks something, differs from the others in its maps' grid, has truth that is all
                unknown, or memory does not suffice.
        """
        lengths, periods, grids = zip(*(_open(path, maps, setting) for path in paths), strict=True)
        for path, period, grid in zip(paths, periods, grids, strict=True):
            if grid and (difference := grids[0].difference(grid)):
                raise InputError(f"{path}: has maps of {difference} as in {paths[0].name}, expected one radar's")
            if abs(period - periods[0]) > 1e-6:
                raise InputError(
                    f"{path}: has frames every {period:g} s, expected {periods[0]:g} s as in {paths[0].name}"
                )
        shapes = _shapes(paths[0], maps, setting)
        size = 2 * sum(lengths) * sum(rows * columns for rows, columns in shapes.values())
        if size > (free := psutil.virtual_memory().available):
            raise InputError(
                f"{paths[0].parent}: its maps take {size / 1e9:.1f} GB, expected at most {free / 1e9:.1f} GB"
            )
        joined = {name: np.empty((sum(lengths), *shape), np.float16) for name, shape in shapes.items()}
        others: dict[str, list[np.ndarray]] = {name: [] for name in (*truth, *sensed)}
        arguments = [(path, tuple(maps), tuple(others), setting) for path in paths]
        pool = ProcessPoolExecutor(workers, get_context("spawn")) if workers > 1 and len(paths) > 1 else None
        try:
            first = 0
            for done, (made, rows) in enumerate((pool.map if pool else map)(_read, arguments)):
                for name in maps:
                    joined[name][first : first + lengths[done]] = made[name]
                for name in others:
                    others[name].append(rows[name])
                first += lengths[done]
                progress("reading", done + 1, len(paths))
        finally:
            if pool:
                pool.shutdown(cancel_futures=True)
        rows = {name: torch.from_numpy(np.concatenate(values)) for name, values in others.items()}
        return cls(
            {name: torch.from_numpy(values) for name, values in joined.items()},
            {name: rows[name] for name in truth},
            lengths,
            grids[0],
            periods[0],
            {name: rows[name] for name in sensed},
        )

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

    def divide(self, count: int) -> tuple["Table", "Table"]:
        """The first `count` recordings, and the others."""
        frame = sum(self.lengths[:count])
        parts = (slice(frame), self.lengths[:count]), (slice(frame, None), self.lengths[count:])

        def some(columns: dict[str, Tensor], part: slice) -> dict[str, Tensor]:
            return {name: values[part] for name, values in columns.items()}

        return tuple(
            Table(
                some(self.maps, part), some(self.truth, part), lengths, self.grid, self.frame_period,
                some(self.sensed, part),
            ) for part, lengths in parts
        )  # fmt: skip

    def window(self, frames: Int[Tensor, "item frame"]) -> Float[Tensor, "item frame map row azimuth"]:
        """Maps of windows of frames."""
        return torch.stack([values[frames] for values in self.maps.values()], dim=2).float()


def _shapes(path: Path, maps: Sequence[str], setting: str) -> dict[str, tuple[int, int]]:
    with Recording(path) as recording:
        axes = {name: SETTINGS[setting].maker.axes(recording.config, name) for name in maps}
    return {name: (own.rows, len(own.azimuths)) for name, own in axes.items()}


def _open(path: Path, maps: Sequence[str], setting: str) -> tuple[int, float, Grid | None]:
    """Frames that networks see, their period, and the grid of their maps, if they see any."""
    with Recording(path) as recording:
        stride = SETTINGS[setting].maker.stride(recording.config)
        grid = Grid.of(recording.config, maps[0], setting) if maps else None
        return -(-len(recording) // stride), stride * recording.config.frame_period, grid


def _read(arguments: tuple[Path, tuple[str, ...], tuple[str, ...], str]) -> tuple[dict, dict]:
    """Maps, and all else, of one recording."""
    path, maps, others, setting = arguments
    with Recording(path) as recording:
        maker, count = SETTINGS[setting].maker(recording.config), len(recording)
        stride = maker.stride(recording.config)
        size = _BATCH * stride
        starts = range(0, count if maps else 0, size)
        parts = [maps_of(recording, start, min(start + size, count), maps, maker, stride) for start in starts]
        found, frames = {}, slice(0, count, stride)
        for name in others:
            where, of = (TRUTH | SENSED)[name]
            found[name] = of(recording, frames)
            # Some may be unknown: a tracking camera is blind now and then.
            if len(found[name]) < -(-count // stride) or not np.isfinite(found[name]).any():
                raise InputError(f"{path}: /{where} lacks values or holds no numbers, expected {count} frames")
        return {name: np.concatenate([part[name] for part in parts]) for name in maps}, found
