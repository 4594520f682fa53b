"""Range scans from heat maps: detection, then echo suppression, by one of several methods.

A scan has one range per bearing, inf where nothing is detected. `METHODS` lists the methods; each is a function of
`Maps` that returns fractional range bins.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from radarize.io.errors import InputError
from radarize.io.plain import Frozen, setting
from radarize.io.stopwatch import stage
from radarize.scans import echoes
from radarize.signal.batch import Batch
from radarize.signal.bearings import BEARINGS
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import Cfar, level_around


class ScanConfig(Frozen):
    """Detection of echoes in range-azimuth maps, for scans without networks."""

    min_range: float = setting(0.3, "minimum range of an echo; nearer cells hold transmitter leakage", "m", ge=0)
    above_noise_db: float = setting(15.0, "minimum level of an echo above the noise", "dB", gt=0)
    below_ring_db: float = setting(
        15.0, "maximum level of an echo below the strongest cell at its range; weaker ones are taken for sidelobes",
        "dB", gt=0
    )  # fmt: skip
    below_bearing_db: float = setting(
        6.0, "maximum level of an echo below the strongest cell on its bearing; weaker and nearer ones are clutter "
        "above or below the plane, or the skirt of a neighbour. 6 dB halves the echoes that are too near and "
        "removes one in ten of the others", "dB", tuned="simulated offices", gt=0
    )  # fmt: skip
    noise_quantile: float = setting(
        0.25, "quantile of a frame's cells that is taken as noise level; most cells of a room are behind its walls",
        "1", gt=0, lt=1
    )  # fmt: skip
    cfar: Cfar = Cfar(window=8, guard=4, threshold=10.0)
    elevation_power: float = setting(
        2.0, "exponent that attenuates echoes off the horizon, for scans by elevation-aware: power is multiplied "
        "with (elevation-aware / reference power)^exponent, at most 1", "1", gt=0
    )  # fmt: skip


@dataclass(frozen=True)
class Maps:
    """Power maps on the bearings of the scan.

    Attributes:
        power: of all elevations.
        elevation_aware: with echoes off the horizon attenuated; None if the array cannot measure elevation.
        reference: of all elevations, by the beamformer of `elevation_aware`.
        ranges: of the bins, m, evenly spaced.
        config: parameters of the detection.
    """

    power: Float[np.ndarray, "frame range bearing"]
    elevation_aware: Float[np.ndarray, "frame range bearing"] | None
    reference: Float[np.ndarray, "frame range bearing"]
    ranges: Float[np.ndarray, "range"]
    config: ScanConfig

    @classmethod
    def of(cls, heatmaps: Heatmaps, config: ScanConfig, powers: Sequence[np.ndarray]) -> "Maps":
        """Return the maps on the bearings of the scan from range-azimuth maps: `power` and, if available, the two
        others."""
        power, *others = (_resample(each, heatmaps.azimuths) for each in powers)
        level, reference = others or (None, power)
        return cls(power, level, reference, heatmaps.ranges, config)

    def scans(self, method: str) -> Float[np.ndarray, "frame bearing"]:
        """Return the ranges on `BEARINGS`, m, inf where nothing is detected, by a key of `METHODS`."""
        return echoes.bins_to_ranges(METHODS[method](self), self.ranges)


def detect(power: Float[np.ndarray, "frame range bearing"], maps: Maps) -> Bool[np.ndarray, "frame range bearing"]:
    """Detect cells with an echo: above the noise, no sidelobe, not too weak for their bearing, and beyond the minimum
    range."""
    config = maps.config
    noise = np.quantile(power, config.noise_quantile, axis=(1, 2), keepdims=True)
    power = power * (maps.ranges >= config.min_range)[:, None]
    least = np.maximum(
        power.max(axis=2, keepdims=True) * 10 ** (-config.below_ring_db / 10),
        power.max(axis=1, keepdims=True) * 10 ** (-config.below_bearing_db / 10),
    )
    return power > np.maximum(least, noise * 10 ** (config.above_noise_db / 10))


def threshold(maps: Maps) -> Float[np.ndarray, "frame bearing"]:
    """Return the strongest echo on every bearing."""
    return echoes.strongest(detect(maps.power, maps), maps.power)


def cfar(maps: Maps) -> Float[np.ndarray, "frame bearing"]:
    """Return the strongest cell on every bearing that passes CFAR in range and in bearing."""
    level, cfar = 10 * np.log10(np.maximum(maps.power, 1e-30)), maps.config.cfar
    found = np.broadcast_to((maps.ranges >= maps.config.min_range)[:, None], level.shape)
    for axis in (1, 2):
        found = found & (level > level_around(level, cfar, axis, cyclic=False) + cfar.threshold)
    return echoes.strongest(found, maps.power)


def first_echo(maps: Maps) -> Float[np.ndarray, "frame bearing"]:
    """Return the first echo on every bearing."""
    return echoes.first(detect(maps.power, maps), maps.power)


def elevation_aware(maps: Maps) -> Float[np.ndarray, "frame bearing"]:
    """Return the first echo on every bearing after attenuating echoes from above and below."""
    horizon = np.clip(maps.elevation_aware / np.maximum(maps.reference, 1e-30), 0, 1)
    power = maps.power * horizon**maps.config.elevation_power
    return echoes.first(detect(power, maps), power)


METHODS: dict[str, Callable[[Maps], np.ndarray]] = {
    "threshold": threshold,
    "cfar": cfar,
    "first-echo": first_echo,
    "elevation-aware": elevation_aware,
}


class HeatmapScans:
    """Scan extractor from heat maps.

    Args:
        method: a key of `METHODS`.

    Raises:
        InputError: the method needs elevation-aware maps, and the array has none.
    """

    def __init__(self, heatmaps: Heatmaps, method: str, config: ScanConfig | None = None):
        if method == "elevation-aware" and heatmaps.pairs is None:
            raise InputError(
                "scans is 'elevation-aware', which needs antennas of two heights; this radar has none, use first-echo"
            )
        self.heatmaps, self.method, self.config = heatmaps, method, config or ScanConfig()

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Return the scans of the next frames: ranges on `BEARINGS`, m, inf where nothing is detected."""
        maps, spectrum = self.heatmaps, batch.spectrum
        with stage("maps"):
            # Capon's beamformer resolves better: in simulated offices 80 % of the ranges are within 10 cm, with
            # Bartlett's 50 %. The suppression by elevation compares two maps of one beamformer, Bartlett's.
            powers = [maps.range_azimuth_of(spectrum, "capon").numpy()]
            if self.method == "elevation-aware":
                powers += [maps.elevation_aware_of(spectrum).numpy(), maps.range_azimuth_of(spectrum).numpy()]
        with stage("scans"):
            return Maps.of(maps, self.config, powers).scans(self.method)


def _resample(power: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """Power on `BEARINGS`, interpolated linearly between columns, 0 outside of them; nan (a lost frame) counts as 0."""
    power = np.nan_to_num(np.asarray(power, float), nan=0.0, posinf=0.0)
    after = np.clip(np.searchsorted(azimuths, BEARINGS), 1, len(azimuths) - 1)
    fraction = (BEARINGS - azimuths[after - 1]) / (azimuths[after] - azimuths[after - 1])
    inside = (BEARINGS >= azimuths[0] - 1e-9) & (BEARINGS <= azimuths[-1] + 1e-9)
    fraction = np.clip(fraction, 0, 1)
    return (power[..., after - 1] * (1 - fraction) + power[..., after] * fraction) * inside
