"""Gain pattern of the antenna elements, the same for every transmitter and receiver."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numba import njit
from pydantic import Field, model_validator

from radarize.io.plain import Frozen
from radarize.radar.boards import Board, load_board


class Cut(Frozen):
    """Gain below the peak along one axis, linear between its points.

    Attributes:
        degrees: angle from boresight, either side, ascending from 0 to 90.
        loss_db: loss at the angles below the peak, dB.
    """

    degrees: tuple[float, ...]
    loss_db: tuple[float, ...]

    @model_validator(mode="after")
    def _consistent(self) -> "Cut":
        d = self.degrees
        if len(d) < 2 or len(d) != len(self.loss_db):
            raise ValueError(f"has {len(d)} degrees and {len(self.loss_db)} loss_db, expected as many, at least 2")
        if d[0] != 0 or d[-1] != 90 or np.any(np.diff(d) <= 0):
            raise ValueError(f"degrees is {list(d)}, expected ascending from 0 to 90")
        return self


class Antenna(Frozen):
    """An element's pattern: the product of an azimuth and an elevation cut.

    Attributes:
        peak_dbi: peak gain, dBi.
        azimuth: cut in the horizontal plane.
        elevation: cut in the vertical plane.
    """

    peak_dbi: float = Field(ge=-30, le=40)
    azimuth: Cut
    elevation: Cut

    @classmethod
    def of(cls, board: str | Board) -> "Antenna":
        """Pattern of a board's file; isotropic if it has none."""
        given = load_board(board).front_end.get("antenna")
        return cls.model_validate(given) if given else ISOTROPIC


#: Equal gain in all directions in front of the board.
ISOTROPIC = Antenna(
    peak_dbi=0, azimuth=Cut(degrees=(0, 90), loss_db=(0, 0)), elevation=Cut(degrees=(0, 90), loss_db=(0, 0))
)


class GainPattern(NamedTuple):
    """Amplitude gain (square root of power gain) of an element, as compiled kernels take it.

    Attributes:
        azimuth_gain, elevation_gain: gain over the absolute angle in steps of half a degree; the element's gain is
            their product.
        peak_gain: largest gain in any direction.
    """

    azimuth_gain: Float[np.ndarray, "181"]
    elevation_gain: Float[np.ndarray, "181"]
    peak_gain: float


def gain_pattern(antenna: Antenna) -> GainPattern:
    """Tabulate an antenna's gain."""
    degrees = np.linspace(0, 90, 181)
    azimuth, elevation = (
        10 ** ((level - np.interp(degrees, cut.degrees, cut.loss_db)) / 20)
        for level, cut in ((antenna.peak_dbi, antenna.azimuth), (0.0, antenna.elevation))
    )
    return GainPattern(azimuth, elevation, float(azimuth.max() * elevation.max()))


@njit
def amplitude_gain(x, y, z, pattern):
    """Amplitude gain towards a direction (x, y, z) in the sensor frame, not necessarily normalised; 0 behind the board.

    `pattern` is a `GainPattern`, or an `Observation`, which has its fields.
    """
    if x <= 0.0:
        return 0.0
    azimuth = _angle(abs(y), x) * (360.0 / np.pi)
    elevation = _angle(abs(z), np.sqrt(x * x + y * y)) * (360.0 / np.pi)
    i, j = min(int(azimuth), 179), min(int(elevation), 179)
    a = pattern.azimuth_gain[i] + (azimuth - i) * (pattern.azimuth_gain[i + 1] - pattern.azimuth_gain[i])
    b = pattern.elevation_gain[j] + (elevation - j) * (pattern.elevation_gain[j + 1] - pattern.elevation_gain[j])
    return a * b


@njit
def _angle(y, x):
    """arctan(y / x) for x > 0 and y >= 0 to 2e-8 rad, three times as fast (Abramowitz and Stegun 4.4.49)."""
    t = min(x, y) / max(x, y)
    s = t * t
    angle = t * (1 + s * (-0.3333314528 + s * (0.1999355085 + s * (-0.1420889944 + s * (0.1065626393
            + s * (-0.0752896400 + s * (0.0429096138 + s * (-0.0161657367 + s * 0.0028662257))))))))  # fmt: skip
    return angle if y < x else 0.5 * np.pi - angle
