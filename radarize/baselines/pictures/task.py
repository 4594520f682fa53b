"""What trainings on pictures have in common: they read what pictures are made of, and their networks read pictures."""

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
    """A task of a network that reads pictures, which are made anew in every step of its training."""

    maps, reads = ("antennas",), ("picture",)

    def table(
        self,
        paths: Sequence[Path],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: MapGrid | None = None,
    ) -> FeatureTable:
        """All that it reads of recordings. A grid (`train --start`) is that of the pictures, not of what they are made
        of, and there is only one radar."""
        return super().table(paths, workers, progress)

    def header(self, settings: Settings, grid: MapGrid | None, **about: Any) -> Header:
        """Of pictures, which come as often as what they are made of."""
        if grid is not None:
            picture = MapGrid.of(PRESETS["radarhd"], "picture", PictureMaker)
            grid = picture.model_copy(update={"frame_period": grid.frame_period})
        return super().header(settings, grid, **about)
