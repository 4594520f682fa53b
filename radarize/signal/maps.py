"""Input maps of the networks: four heat maps per frame in dB, small enough to store instead of the samples.

| map | axes | for |
|---|---|---|
| range_azimuth | range x azimuth, row of 8 antennas, Capon | rotation, segmentation |
| elevation_aware | range x azimuth, antenna pairs focused on the horizon, Bartlett | segmentation |
| doppler_azimuth | Doppler x azimuth, row of 8 antennas, Capon, limited | translation |
| doppler_elevation_aware | Doppler x azimuth, antenna pairs focused on the horizon, Bartlett, limited | translation |

Azimuth has 80 columns of 1.5 deg, the width of Capon's ridges, symmetric about the boresight, so that a flip is a
mirror image. Range and Doppler keep their bins. Maps over Doppler use the limited spectrum (`Heatmaps.limited`),
otherwise a single specular reflection would mask the ridge of the static world. Decibels refer to squared ADC counts,
rounded to a quarter: far below the speckle's 5.6 dB, exact in float16, and compressible to 0.4 of the size.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Float16, Int, Int16, Real
from torch import Tensor

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.io.stopwatch import stage
from radarize.radar.config import RadarConfig
from radarize.signal.heatmaps import Heatmaps

#: Descriptions of the maps by name.
MAPS = {
    "range_azimuth": "power over range and azimuth",
    "elevation_aware": "power over range and azimuth near the horizon, of antenna pairs",
    "doppler_azimuth": "power over closing speed and azimuth",
    "doppler_elevation_aware": "power over closing speed and azimuth near the horizon, of antenna pairs",
}
#: Maps as input of networks.
Maps = Float[Tensor, "item frame map row azimuth"]
#: Columns, rad, positive to the left, ascending.
AZIMUTHS = np.radians(np.arange(-59.25, 60.0, 1.5))
#: Lower limit, dB; about the level of an ADC's rounding.
FLOOR = -30.0
STEP = 0.25


@dataclass(frozen=True)
class Axes:
    """Axes of a map.

    Attributes:
        rows: range bins, or Doppler bins.
        step: m, or m/s, between rows.
        azimuths: of columns, rad, ascending to the left.
        centred: rows are speeds, m/s, zero in the middle; otherwise ranges, m, from zero on.
    """

    rows: int
    step: float
    azimuths: Float[np.ndarray, "azimuth"]
    centred: bool = False


class Maker(ABC):
    """Interface of the makers of a method's input maps, for one radar configuration.

    Attributes:
        maps: descriptions by name.
        history: number of earlier frames that a map needs.
        warmup: number of first frames of a recording without maps.
        physical: whether rows are in metres or m/s, so that a network can use those of any chirp, see `Resampling`.
    """

    maps: dict[str, str]
    history = warmup = 0
    physical = False

    @abstractmethod
    def __init__(self, config: RadarConfig):
        """Prepare for frames of a radar configuration."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all maps."""
        return tuple(self.maps)

    @staticmethod
    def stride(config: RadarConfig) -> int:
        """Distance in frames between the frames that networks use; 1 unless overridden."""
        return 1

    @staticmethod
    @abstractmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Axes of a map."""

    @abstractmethod
    def __call__(
        self,
        adc: Int16[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        names: tuple[str, ...] | None = None,
        frames: slice | Int[np.ndarray, "map"] = slice(None),
    ) -> dict[str, Float[np.ndarray, "map row azimuth"]]:
        """Compute maps of some consecutive frames.

        Args:
            adc, valid: see `Heatmaps.spectrum`.
            names: of `self.names`; all if None.
            frames: frames to compute.

        Raises:
            InputError: samples that do not fit the configuration.
        """


class MapMaker(Maker):
    """Input maps of one radar configuration, dB.

    Without antennas of two heights, maps near the horizon are the row's, by Bartlett as well: they include echoes from
    above and below.
    """

    maps = MAPS
    physical = True

    def __init__(self, config: RadarConfig):
        self.heatmaps = Heatmaps(config, AZIMUTHS)

    @staticmethod
    def axes(config: RadarConfig, name: str) -> Axes:
        """Rows and columns of a map."""
        if name.startswith("doppler"):
            return Axes(config.loops, config.velocity_resolution, AZIMUTHS, centred=True)
        return Axes(config.samples, config.range_resolution, AZIMUTHS)

    def shape(self, name: str) -> tuple[int, int]:
        """Rows and columns of a map."""
        axes = self.axes(self.heatmaps.config, name)
        return axes.rows, len(axes.azimuths)

    def __call__(
        self,
        adc: Real[np.ndarray, "frame loop tx rx sample 2"],
        valid: Bool[np.ndarray, "frame loop tx"] | None = None,
        names: tuple[str, ...] | None = None,
        frames: slice | Int[np.ndarray, "map"] = slice(None),
    ) -> dict[str, Float16[np.ndarray, "map row azimuth"]]:
        return self.of(self.heatmaps.spectrum(adc[frames], None if valid is None else valid[frames]), names)

    def of(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"], names: tuple[str, ...] | None = None
    ) -> dict[str, Float16[np.ndarray, "frame row azimuth"]]:
        """Maps from an existing spectrum."""
        heatmaps, names = self.heatmaps, names or self.names
        paired = heatmaps.pairs is not None
        with stage("maps"):
            # Only Doppler maps use the limited spectrum.
            limited = heatmaps.limited(spectrum) if any(n.startswith("doppler") for n in names) else spectrum
            makers = {
                "range_azimuth": lambda: heatmaps.range_azimuth_of(spectrum, "capon"),
                "elevation_aware": lambda: (
                    heatmaps.elevation_aware_of(spectrum) if paired else heatmaps.range_azimuth_of(spectrum)
                ),
                "doppler_azimuth": lambda: heatmaps.doppler_azimuth_of(limited, "capon"),
                "doppler_elevation_aware": lambda: heatmaps.doppler_azimuth_of(limited, elevation_aware=paired),
            }
            return {name: _decibels(makers[name]()) for name in names}


def _decibels(power: torch.Tensor) -> np.ndarray:
    level = 10 * torch.log10(power.clamp_min(10 ** (FLOOR / 10)))
    return (torch.round(level / STEP) * STEP).half().cpu().numpy()


def maps_of(recording: Recording, start: int, stop: int, names: tuple[str, ...], maker: Maker, stride: int = 1) -> dict:
    """Maps of every N-th of frames start...stop-1 (N = `stride`): as stored, or made from the samples; both are equal.

    Raises:
        InputError: a map that is not stored and cannot be made.
    """
    for name in names:
        if name not in maker.names:
            raise InputError(f"{recording.path}: has no map {name}; its array makes {', '.join(maker.names)}")
    if all(recording.has(f"maps/{name}") for name in names):
        return {name: recording.rows(f"maps/{name}", start, stop)[::stride] for name in names}
    first = max(0, start - maker.history)
    return maker(recording.adc(first, stop), recording.valid(first, stop), names, slice(start - first, None, stride))
