"""What trainings on pictures have in common: they read what pictures are made of, and their networks read pictures."""

from typing import Any

from torch import Tensor

from radarize.baselines.pictures.maps import PictureMaker
from radarize.learning.features.grid import MapGrid
from radarize.learning.nets.weights import Header
from radarize.learning.task import Settings, Task
from radarize.radar.presets import PRESETS


class PictureTask(Task[Tensor]):
    """A task of a network that reads pictures, which are made anew in every step of its training."""

    maps, reads = ("antennas",), ("picture",)

    def header(self, settings: Settings, grid: MapGrid | None, **about: Any) -> Header:
        """Of pictures, which come as often as what they are made of."""
        if grid is not None:
            picture = MapGrid.of(PRESETS["radarhd"], "picture", PictureMaker)
            grid = picture.model_copy(update={"frame_period": grid.frame_period})
        return super().header(settings, grid, **about)
