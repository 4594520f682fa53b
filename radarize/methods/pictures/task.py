"""What trainings on pictures have in common: they read what pictures are made of, and their networks read pictures."""

from collections.abc import Callable, Sequence
from pathlib import Path

from radarize.features.grid import Grid
from radarize.features.table import Table
from radarize.methods.pictures.maps import PictureMaker
from radarize.methods.task import Settings, Task
from radarize.nets.weights import Header
from radarize.radar.presets import PRESETS


class PictureTask(Task):
    """A task of a network that reads pictures, which are made anew in every step of its training."""

    maps, reads = ("antennas",), ("picture",)

    def table(
        self,
        paths: Sequence[Path],
        workers: int = 1,
        progress: Callable[..., None] = lambda *where: None,
        grid: Grid | None = None,
    ) -> Table:
        """All that it reads of recordings. A grid (`train --start`) is that of the pictures, not of what they are made
        of, and there is only one radar."""
        return super().table(paths, workers, progress)

    def header(self, settings: Settings, grid: Grid | None, **about) -> Header:
        """Of pictures, which come as often as what they are made of."""
        if grid is not None:
            picture = Grid.of(PRESETS["radarhd"], "picture", PictureMaker)
            grid = picture.model_copy(update={"frame_period": grid.frame_period})
        return super().header(settings, grid, **about)
