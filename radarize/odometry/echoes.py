"""The strongest echoes of a frame whose bearing is unambiguous."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex64, Float
from numba import njit

from radarize.odometry.parabola import vertex
from radarize.signal.heatmaps import Heatmaps

#: Minimum power of a cell over the median; minimum share of its power that comes from a single direction: the bearing
#: of two echoes in one cell varies as they interfere.
_MIN_POWER, _MIN_PURITY = 1e4, 0.98
#: Maximum number of echoes per frame; sines of azimuth of the search; maximum sine of a detection, as the true
#: direction of a peak at the edge may be beyond it.
_MAX_ECHOES, _SINES, _MAX_SINE = 8, np.linspace(-0.9, 0.9, 91), 0.87
#: Minimum number of antennas in a row: with fewer, two echoes are not distinguished from one between them.
_MIN_ANTENNAS = 4


class Echo(NamedTuple):
    """Range (m), closing speed (m/s, within the unambiguous span) and bearing (rad, positive to the left)."""

    range: float
    speed: float
    bearing: float


class Echoes:
    """Detector of the strongest echoes.

    Args:
        heatmaps: of the radar.
        first: first range bin with echoes.
    """

    def __init__(self, heatmaps: Heatmaps, first: int):
        self._ranges, self._speeds, self._first = heatmaps.ranges, heatmaps.velocities, first
        self._row = heatmaps.row
        self._steering = heatmaps.steering(self._row, _SINES).conj().T.astype(np.complex64)

    def of(self, cells: Complex64[np.ndarray, "range doppler antenna"]) -> list[Echo]:
        """Return the echoes of a frame's spectrum, strongest first; empty if the array has too few antennas."""
        if len(self._row) < _MIN_ANTENNAS:
            return []
        found = []
        for r, d in zip(*_peaks(cells, self._row, self._first), strict=True):
            wave = cells[r, d][self._row]
            beams = np.abs(self._steering @ wave) ** 2
            purity = beams.max() / len(self._row) / max(float(np.square(np.abs(wave)).sum()), 1e-30)
            k = int(np.clip(beams.argmax(), 1, len(_SINES) - 2))
            sine = _SINES[k] + (_SINES[1] - _SINES[0]) * _peak_offset(beams[k - 1 : k + 2])
            if purity > _MIN_PURITY and abs(sine) < _MAX_SINE:
                powers = np.square(np.abs(cells[r - 1 : r + 2, d][:, self._row])).sum(axis=1)
                distance = self._ranges[r] + (self._ranges[1] - self._ranges[0]) * _peak_offset(powers)
                found.append(Echo(float(distance), float(self._speeds[d]), float(np.arcsin(sine))))
        return found


def _peak_offset(powers: Float[np.ndarray, "3"]) -> float:
    """Offset of a peak from its bin, in bins, by interpolation of three powers."""
    return float(np.clip(vertex(*np.log(np.maximum(powers, 1e-30))), -1, 1))


@njit(cache=True)
def _peaks(cells, row, first):
    """Range and Doppler bins of the strongest local maxima, strongest first."""
    ranges, bins, _ = cells.shape
    power = np.zeros((ranges, bins), np.float32)
    for r in range(ranges):
        for d in range(bins):
            for antenna in row:
                value = cells[r, d, antenna]
                power[r, d] += value.real**2 + value.imag**2
    least = _MIN_POWER * max(np.median(power[first::4]), 1e-30)
    strongest = np.zeros(_MAX_ECHOES, np.float32)
    places = np.zeros((2, _MAX_ECHOES), np.int64)
    for r in range(max(first, 1), ranges - 1):
        for d in range(bins):
            here = power[r, d]
            if here <= max(least, strongest[-1]):
                continue
            before, after = (d - 1) % bins, (d + 1) % bins
            if here < max(power[r, before], power[r, after]):
                continue
            around = max(power[r - 1, before], power[r - 1, d], power[r - 1, after])
            if here < max(around, power[r + 1, before], power[r + 1, d], power[r + 1, after]):
                continue
            k = _MAX_ECHOES - 1
            while k > 0 and strongest[k - 1] < here:
                strongest[k], places[:, k] = strongest[k - 1], places[:, k - 1]
                k -= 1
            strongest[k], places[0, k], places[1, k] = here, r, d
    count = np.count_nonzero(strongest)
    return places[0, :count], places[1, :count]
