"""The strongest echoes of a frame whose bearing is sure."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex64, Float
from numba import njit

from radarize.odometry.parabola import vertex
from radarize.signal.heatmaps import Heatmaps

#: The power of a cell over the median's from which on it counts, and the share of it that comes from a single
#: direction: two echoes in a cell have a bearing that wanders as they beat.
_STRONG, _PURE = 1e4, 0.98
#: So many of a frame at most, and direction cosines at which they are sought; those at the ends may lie beyond.
_MOST, _BEAMS, _EDGE = 8, np.linspace(-0.9, 0.9, 91), 0.87
#: Antennas in a row that tell directions apart; with fewer, two echoes look like one between them.
_ANTENNAS = 4


class Echo(NamedTuple):
    """Range (m), closing speed (m/s, within the unambiguous span) and bearing (rad, positive to the left)."""

    range: float
    speed: float
    bearing: float


class Echoes:
    """Finds them.

    Args:
        heatmaps: of the radar.
        first: range bin from which on echoes count.
    """

    def __init__(self, heatmaps: Heatmaps, first: int):
        self._ranges, self._speeds, self._first = heatmaps.ranges, heatmaps.velocities, first
        self._row = heatmaps.row
        self._steering = heatmaps.steering(self._row, _BEAMS).conj().T.astype(np.complex64)

    def of(self, cells: Complex64[np.ndarray, "range doppler antenna"]) -> list[Echo]:
        """Of a frame's spectrum, the strongest first; none where the array's bearings are never sure."""
        if len(self._row) < _ANTENNAS:
            return []
        found = []
        for r, d in zip(*_peaks(cells, self._row, self._first), strict=True):
            wave = cells[r, d][self._row]
            beams = np.abs(self._steering @ wave) ** 2
            pure = beams.max() / len(self._row) / max(float(np.square(np.abs(wave)).sum()), 1e-30)
            k = int(np.clip(beams.argmax(), 1, len(_BEAMS) - 2))
            sine = _BEAMS[k] + (_BEAMS[1] - _BEAMS[0]) * _between(beams[k - 1 : k + 2])
            if pure > _PURE and abs(sine) < _EDGE:
                powers = np.square(np.abs(cells[r - 1 : r + 2, d][:, self._row])).sum(axis=1)
                away = self._ranges[r] + (self._ranges[1] - self._ranges[0]) * _between(powers)
                found.append(Echo(float(away), float(self._speeds[d]), float(np.arcsin(sine))))
        return found


def _between(powers: Float[np.ndarray, "3"]) -> float:
    """Offset in bins of a peak, by three powers."""
    return float(np.clip(vertex(*np.log(np.maximum(powers, 1e-30))), -1, 1))


@njit(cache=True)
def _peaks(cells, row, first):
    """Range and Doppler bins of the strongest cells that no neighbour outshines, the strongest first."""
    ranges, bins, _ = cells.shape
    power = np.zeros((ranges, bins), np.float32)
    for r in range(ranges):
        for d in range(bins):
            for antenna in row:
                value = cells[r, d, antenna]
                power[r, d] += value.real**2 + value.imag**2
    least = _STRONG * max(np.median(power[first::4]), 1e-30)
    strongest = np.zeros(_MOST, np.float32)
    places = np.zeros((2, _MOST), np.int64)
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
            k = _MOST - 1
            while k > 0 and strongest[k - 1] < here:
                strongest[k], places[:, k] = strongest[k - 1], places[:, k - 1]
                k -= 1
            strongest[k], places[0, k], places[1, k] = here, r, d
    count = np.count_nonzero(strongest)
    return places[0, :count], places[1, :count]
