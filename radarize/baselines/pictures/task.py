"""Base class of training tasks on pictures: they read antenna signals, from which augmented pictures are computed."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from radarize.baselines.pictures.maps import PictureMaker
from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import FeatureTable
from radarize.learning.nets.weights import Header
from radarize.learning.task import Settings, Task
from radarize.radar.presets import PRESETS


class PictureTask(Task[Tensor]):
    """Training task of a network on pictures, which are computed with new random properties in every step."""

    maps, reads = ("antennas",), ("picture",)

    def table(
        self,
        paths: Sequence[Path],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: MapGrid | None = None,
    ) -> FeatureTable:
        """Read the antenna signals and labels of recordings. A grid (`train --start`) belongs to the pictures and is
        not used, because all recordings are of one radar."""
        return super().table(paths, workers, progress)

    def header(self, settings: Settings, grid: MapGrid | None, **about: Any) -> Header:
        """Return the header of the weights, with the grid of the pictures at the frame period of the recordings."""
        if grid is not None:
            picture = MapGrid.of(PRESETS["radarhd"], "picture", PictureMaker)
            grid = picture.model_copy(update={"frame_period": grid.frame_period})
        return super().header(settings, grid, **about)
