"""Statistics of the pictures of a walk: number, positions, levels and persistence of peaks."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, UInt8
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from benchmarks.likeness.pictures import TIMES, Bursts
from radarize.signal import polar

#: Dynamic range of a picture, dB.
DEPTH = -20 * np.log10(polar.THRESHOLD)
#: Size of the neighbourhood of a local maximum, range and azimuth cells.
_PEAK = 5, 9
#: Levels below the strongest cell within which peaks are counted, and within which their positions are evaluated, dB.
DEPTHS, SPREAD = (10, 20, 26), 20
#: Distance from the strongest cell within which power counts as its own, m.
_OWN = 0.2
#: Maximum distance to a peak in a later frame, m and rad, and its growth with time, m/s and rad/s.
_GATE, _GATE_RATE = (0.1, np.radians(5)), (0.5, np.radians(10))
_RANGES, _AZIMUTHS = polar.RANGES, polar.AZIMUTHS


def shares(kept: Bool[np.ndarray, "frame range azimuth"]) -> tuple[float, float, float]:
    """Return the shares of non-zero cells, of ranges with such a cell, and of non-zero azimuths at such a range."""
    lit = kept.any(axis=2)
    return kept.mean(), lit.mean(), kept.sum(axis=2)[lit].mean() / polar.COLUMNS


def levels(pictures: UInt8[np.ndarray, "*frame range azimuth"]) -> Float[np.ndarray, "*frame range azimuth"]:
    """Return levels relative to the strongest cell, dB; -inf in zero cells."""
    return np.where(pictures > 0, DEPTH * (pictures / 255.0 - 1), -np.inf)


def peaks(level: Float[np.ndarray, "range azimuth"]) -> Bool[np.ndarray, "range azimuth"]:
    """Find the local maxima of a picture."""
    return (level == maximum_filter(level, _PEAK)) & np.isfinite(level)


@dataclass(frozen=True)
class Peaks:
    """Peaks of one picture: ranges (m), azimuths (rad) and levels (dB)."""

    range: Float[np.ndarray, "peak"]
    azimuth: Float[np.ndarray, "peak"]
    level: Float[np.ndarray, "peak"]

    @classmethod
    def of(cls, picture: UInt8[np.ndarray, "range azimuth"]) -> "Peaks":
        """Find the peaks of a picture."""
        level = levels(picture)
        row, column = np.nonzero(peaks(level))
        return cls(_RANGES[row], _AZIMUTHS[column], level[row, column])

    def above(self, level: float) -> "Peaks":
        """Select the peaks above a level, dB."""
        some = self.level >= level
        return Peaks(self.range[some], self.azimuth[some], self.level[some])


def persistence(first: Peaks, later: Peaks, lag: float) -> tuple[float, Float[np.ndarray, "found"]]:
    """Return the share of peaks that are found again after `lag` s, and the changes of their levels, dB."""
    if not len(first.range) or not len(later.range):
        return 0.0, np.empty(0)
    gate = [least + rate * lag for least, rate in zip(_GATE, _GATE_RATE, strict=True)]
    scaled = [np.column_stack([each.range / gate[0], each.azimuth / gate[1]]) for each in (first, later)]
    distance, index = cKDTree(scaled[1]).query(scaled[0])
    found = distance <= 1
    return float(found.mean()), later.level[index[found]] - first.level[found]


def of(bursts: Bursts) -> dict[str, float]:
    """Return the statistics of a walk, means over its frames, by name with unit."""
    pictures = bursts.reshape(-1, *bursts.shape[2:])
    found = [[Peaks.of(picture) for picture in burst] for burst in bursts]
    flat = [each for burst in found for each in burst]
    result = {f"peaks within {depth} dB": np.mean([len(p.above(-depth).range) for p in flat]) for depth in DEPTHS}
    near = [p.above(-SPREAD) for p in flat]
    result["their spread over range m"] = np.mean([np.ptp(np.quantile(p.range, [0.1, 0.9])) for p in near])
    result["over azimuth deg"] = np.degrees(np.mean([p.azimuth.std() for p in near]))
    power = polar.power(pictures)
    strongest = _RANGES[power.max(axis=2).argmax(axis=1)]
    own = np.abs(_RANGES - strongest[:, None]) <= _OWN
    by_range = power.sum(axis=2)
    result["power near the strongest %"] = 100 * np.mean((by_range * own).sum(axis=1) / by_range.sum(axis=1))
    result["range of the strongest m"] = np.median(strongest)
    names = "cells kept %", "ranges with any %", "azimuths lit there %"
    result |= dict(zip(names, 100 * np.array(shares(pictures > 0)), strict=True))
    distance, level = (np.concatenate([getattr(p, name) for p in flat]) for name in ("range", "level"))
    away = distance > 0.5
    result["level of peaks dB per octave of range"] = np.polyfit(np.log2(distance[away]), level[away], 1)[0]
    for index in range(1, 4):
        lag = TIMES[index]
        pairs = [persistence(burst[0].above(-SPREAD), burst[index], lag) for burst in found]
        change = np.concatenate([each for _, each in pairs])
        result[f"found after {lag:.2g} s %"] = 100 * np.mean([share for share, _ in pairs])
        result[f"change in {lag:.2g} s dB"] = np.sqrt(np.mean(change**2))
    return {name: float(value) for name, value in result.items()}


def beam_misfit(pictures: UInt8[np.ndarray, "frame range azimuth"], antennas: int) -> float:
    """Return the median over frames of the RMS difference between the row of the strongest cell and the best-fitting
    beam of a number of antennas half a wavelength apart, dB."""
    sines, misfits = np.sin(polar.AZIMUTHS), []
    for picture in pictures:
        row, column = np.unravel_index(picture.argmax(), picture.shape)
        kept = picture[row] > 0
        level = DEPTH * (picture[row, kept] / 255 - 1)
        off = sines[kept] - (sines[column] + np.linspace(-0.08, 0.08, 17))[:, None]
        beam = np.abs(np.sinc(antennas * off / 2) / np.sinc(off / 2))
        beam = np.maximum(20 * np.log10(np.maximum(beam, 1e-6)), -DEPTH)
        misfits.append(np.sqrt(np.mean((beam - level) ** 2, axis=1)).min())
    return float(np.median(misfits))
