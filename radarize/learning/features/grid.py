"""On which cells a map lies, whether two radars' maps lie on the same, and how those of one are brought to the other's.

Networks know metres and m/s by rows and columns of the maps that they were trained on. Maps of other chirps are brought
to these rows, so that what is far for one radar is far for any.
"""

import numpy as np
import torch
from jaxtyping import Float
from pydantic import Field

from radarize.io.plain import Frozen
from radarize.radar.config import RadarConfig
from radarize.signal.maps import Maker, MapMaker

#: Steps of range or speed that differ by less read as the same grid.
TOLERANCE = 0.01
#: Of what a network sees in range or speed, the least share that another radar has to see; and how much coarser its
#: rows may be. What is asked of the array is in `radarize.learning.nets.weights`.
LEAST_SHARE, COARSEST = 0.5, 2.0


class MapGrid(Frozen):
    """Cells of a map: a network that knows one grid reads wrong speeds and ranges off another.

    Attributes:
        rows: range bins, or Doppler bins.
        step: m, or m/s, from row to row.
        azimuths: columns.
        field: rad, from the first column to the last.
        frame_period: s.
    """

    # Limits are those of any radar: files of weights are foreign input.
    rows: int = Field(ge=1, le=1 << 14)
    step: float = Field(gt=0, le=1e3)
    azimuths: int = Field(ge=1, le=1 << 14)
    field: float
    frame_period: float = Field(gt=0, le=1e4)

    @classmethod
    def of(cls, config: RadarConfig, name: str, maker: type[Maker] = MapMaker) -> "MapGrid":
        """The grid of a radar's map."""
        axes = maker.axes(config, name)
        return cls(
            rows=axes.rows,
            step=axes.step,
            azimuths=len(axes.azimuths),
            field=float(axes.azimuths[-1] - axes.azimuths[0]),
            frame_period=config.frame_period * maker.stride(config),
        )

    def difference(self, other: "MapGrid", ignore: tuple[str, ...] = ()) -> str | None:
        """What differs of another grid, in words; None if nothing does."""
        for name, own in self:
            if name not in ignore and abs(own - getattr(other, name)) > TOLERANCE * abs(own):
                return f"{name.replace('_', ' ')} {getattr(other, name):.6g} instead of {own:.6g}"
        return None

    @property
    def reach(self) -> float:
        """m, or m/s from the lowest speed to the highest."""
        return self.rows * self.step

    def lack(self, other: "MapGrid", unit: str) -> str | None:
        """What another radar's maps, with rows in a unit, lack to be brought to this grid, in words; None if nothing
        does."""
        coarsest, least = COARSEST * self.step, LEAST_SHARE * self.reach
        if other.step > coarsest:
            return f"bins of {other.step:.3g} {unit}, expected at most {coarsest:.3g} {unit}"
        if other.reach < least:
            return f"a reach of {other.reach:.3g} {unit}, expected at least {least:.3g} {unit}"
        return None


class Resampling:
    """Brings maps of a radar to the rows that a network knows.

    A row is the mean power of what the radar sees about it, weighted by a triangle of the coarser step to either side:
    finer rows are averaged, coarser ones interpolated. Where the radar sees nothing, a column is as quiet as anywhere.

    Args:
        known: grid of the network.
        own: grid of the radar.
        centred: rows are of speeds, zero in the middle; otherwise of ranges, from zero on.
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
        """None where both have the same rows."""
        same = known.rows == own.rows and np.isclose(known.step, own.step, rtol=1e-6)
        return None if same else cls(known, own, centred)

    def __call__(
        self, maps: Float[torch.Tensor, "frame map row azimuth"]
    ) -> Float[torch.Tensor, "frame map known azimuth"]:
        """Maps in dB, from dB."""
        power = 10 ** (maps / 10)
        found = self._weights @ power
        found[:, :, self._unseen] = power.amin(dim=2, keepdim=True)
        return 10 * torch.log10(found)


def _places(grid: MapGrid, centred: bool) -> Float[np.ndarray, "row"]:
    """Of rows, m or m/s."""
    return grid.step * (np.arange(grid.rows) - (grid.rows // 2 if centred else 0))
