"""Grid of a map's cells, comparison of the grids of two radars, and resampling from one to the other.

A network learns metres and m/s as rows and columns of the maps that it was trained on. Maps of radars with other chirps
are resampled to these rows, so that a row has the same range or speed for any radar.
"""

import numpy as np
import torch
from jaxtyping import Float
from pydantic import Field

from radarize.io.plain import Frozen
from radarize.radar.config import RadarConfig
from radarize.signal.maps import Maker, MapMaker

#: Relative difference of range or speed steps below which grids count as equal.
TOLERANCE = 0.01
#: Minimum share of a network's span in range or speed that another radar has to cover, and maximum ratio of its row
#: step. Requirements on the array are in `radarize.learning.nets.weights`.
LEAST_SHARE, COARSEST = 0.5, 2.0


class MapGrid(Frozen):
    """Grid of a map's cells; a network trained on one grid estimates wrong speeds and ranges on another.

    Attributes:
        rows: number of range or Doppler bins.
        step: step between rows, m or m/s.
        azimuths: number of columns.
        field: angle from the first column to the last, rad.
        frame_period: s.
    """

    # The limits include any radar; files of weights are foreign input.
    rows: int = Field(ge=1, le=1 << 14)
    step: float = Field(gt=0, le=1e3)
    azimuths: int = Field(ge=1, le=1 << 14)
    field: float
    frame_period: float = Field(gt=0, le=1e4)

    @classmethod
    def of(cls, config: RadarConfig, name: str, maker: type[Maker] = MapMaker) -> "MapGrid":
        """Return the grid of a radar's map."""
        axes = maker.axes(config, name)
        return cls(
            rows=axes.rows,
            step=axes.step,
            azimuths=len(axes.azimuths),
            field=float(axes.azimuths[-1] - axes.azimuths[0]),
            frame_period=config.frame_period * maker.stride(config),
        )

    def difference(self, other: "MapGrid", ignore: tuple[str, ...] = ()) -> str | None:
        """Return the difference from another grid in words; None if they are equal."""
        for name, own in self:
            if name not in ignore and abs(own - getattr(other, name)) > TOLERANCE * abs(own):
                return f"{name.replace('_', ' ')} {getattr(other, name):.6g} instead of {own:.6g}"
        return None

    @property
    def reach(self) -> float:
        """Span of the rows: m, or m/s from the lowest speed to the highest."""
        return self.rows * self.step

    def lack(self, other: "MapGrid", unit: str) -> str | None:
        """Return in words why another radar's maps, with rows in `unit`, cannot be resampled to this grid; None if they
        can."""
        coarsest, least = COARSEST * self.step, LEAST_SHARE * self.reach
        if other.step > coarsest:
            return f"bins of {other.step:.3g} {unit}, expected at most {coarsest:.3g} {unit}"
        if other.reach < least:
            return f"a reach of {other.reach:.3g} {unit}, expected at least {least:.3g} {unit}"
        return None


class Resampling:
    """Resamples maps of a radar to the rows of a network.

    A row is the mean power of the radar's rows around it, weighted by a triangle with a half width of the larger step:
    finer rows are averaged, coarser ones interpolated. Rows that the radar does not cover get the minimum of their
    column.

    Args:
        known: grid of the network.
        own: grid of the radar.
        centred: whether rows are speeds, with zero in the middle; otherwise ranges, from zero.
    """

    def __init__(self, known: MapGrid, own: MapGrid, centred: bool):
        wide = max(known.step, own.step)
        apart = np.abs(_places(known, centred)[:, None] - _places(own, centred))
        weights = np.clip(1 - apart / wide, 0, None)
        whole = weights.sum(axis=1, keepdims=True)
        self._unseen = torch.from_numpy(whole[:, 0] < 0.5 * wide / own.step)
        self._weights = torch.from_numpy(weights / np.maximum(whole, 1e-9)).float()

    @classmethod
    def between(cls, known: MapGrid, own: MapGrid, centred: bool) -> "Resampling | None":
        """Return the resampling; None if both grids have the same rows."""
        same = known.rows == own.rows and np.isclose(known.step, own.step, rtol=1e-6)
        return None if same else cls(known, own, centred)

    def __call__(
        self, maps: Float[torch.Tensor, "frame map row azimuth"]
    ) -> Float[torch.Tensor, "frame map known azimuth"]:
        """Resample maps in dB."""
        power = 10 ** (maps / 10)
        found = self._weights @ power
        found[:, :, self._unseen] = power.amin(dim=2, keepdim=True)
        return 10 * torch.log10(found)


def _places(grid: MapGrid, centred: bool) -> Float[np.ndarray, "row"]:
    """Return the ranges or speeds of the rows, m or m/s."""
    return grid.step * (np.arange(grid.rows) - (grid.rows // 2 if centred else 0))
