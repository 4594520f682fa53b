"""On which cells a map lies, and whether two radars' maps lie on the same."""

from radarize.features.maps import Maker, MapMaker
from radarize.plain import Frozen
from radarize.radar.config import RadarConfig

#: Steps of range or speed that differ by less read as the same grid.
TOLERANCE = 0.01


class Grid(Frozen):
    """Cells of a map: a network that knows one grid reads wrong speeds and ranges off another.

    Attributes:
        rows: range bins, or Doppler bins.
        step: m, or m/s, from row to row.
        azimuths: columns.
        field: rad, from the first column to the last.
        frame_period: s.
    """

    rows: int
    step: float
    azimuths: int
    field: float
    frame_period: float

    @classmethod
    def of(cls, config: RadarConfig, name: str, maker: type[Maker] = MapMaker) -> "Grid":
        """The grid of a radar's map."""
        axes = maker.axes(config, name)
        return cls(
            rows=axes.rows,
            step=axes.step,
            azimuths=len(axes.azimuths),
            field=float(axes.azimuths[-1] - axes.azimuths[0]),
            frame_period=config.frame_period * maker.stride(config),
        )

    def difference(self, other: "Grid", ignore: tuple[str, ...] = ()) -> str | None:
        """What differs of another grid, in words; None if nothing does."""
        for name, own in self:
            if name not in ignore and abs(own - getattr(other, name)) > TOLERANCE * abs(own):
                return f"{name.replace('_', ' ')} {getattr(other, name):.6g} instead of {own:.6g}"
        return None
