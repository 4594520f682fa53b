"""Turns told by the bearing of the strongest echo, followed from frame to frame.

A wall's specular flash stands where the wall is met at a right angle: its bearing is the wall's normal wherever the
sensor goes, and all that it moves by is the sensor's turn. The echo of a post or a corner moves by the turn and by what
passing it does, the velocity across over the range. Which of the two an echo is, nobody knows when it is first seen;
range and Doppler shift tell nothing of it, since a slide along a wall and a circle about a post look the same. But it
remains what it is, so odds are kept: of the two turns, which one another estimator of turns agrees with over some time.
Along bare walls and glass that estimator may err by as much as what passing does; the odds that the echo had before
hold, and it goes on as a compass.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex64, Float
from numba import njit

from radarize.heatmaps import Heatmaps

#: The strongest cell's power over the median's from which on it counts, and the share of it that comes from a single
#: direction: two echoes in a cell have a bearing that wanders as they beat. Direction cosines that it is sought at.
_STRONG, _PURE, _BEAMS = 1e4, 0.98, np.linspace(-0.9, 0.9, 91)
#: m, m/s and rad/s: by how much an echo may be off what is expected of it in the next frame to be taken for the same.
_RANGE, _SPEED, _BEARING = 0.06, 0.25, np.radians(75.0)
#: s over which turns are compared, and rad, what another estimator may err by in that time.
_COMPARED, _ERRS = 0.33, np.radians(3.0)
#: Log-odds are not more extreme than this: walls end, and corners begin.
_SUREST = 6.0
#: rad, standard deviation of the bearing's change from frame to frame.
_NOISE = np.radians(0.15)


class Strongest(NamedTuple):
    """The strongest echo of a frame: range (m), closing speed (m/s), bearing (rad), and whether it can be followed."""

    range: float
    speed: float
    bearing: float
    clear: bool


class Turn(NamedTuple):
    """A turn (rad) since the frame before, its variance, and the probability that the echo is a wall's flash."""

    yaw: float
    variance: float
    flash: float


class Compass:
    """Follows the strongest echo; frames are pushed in order.

    Args:
        heatmaps: of the radar.
        first: range bin from which on echoes count.
    """

    def __init__(self, heatmaps: Heatmaps, first: int):
        self._ranges, self._speeds, self._first = heatmaps.ranges, heatmaps.velocities, first
        self._row, self._span = heatmaps.row, 2 * heatmaps.config.max_velocity
        self._steering = heatmaps.steering(self._row, _BEAMS).conj().T.astype(np.complex64)
        self._last: Strongest | None = None
        self._odds, self._apart = 0.0, np.zeros(2)

    def strongest(self, cells: Complex64[np.ndarray, "range doppler antenna"]) -> Strongest:
        """Of a frame's spectrum."""
        r, d, power = _strongest(cells, self._row, self._first)
        beams = np.abs(self._steering @ cells[r, d][self._row]) ** 2
        k = int(np.clip(beams.argmax(), 1, len(_BEAMS) - 2))
        sine = _BEAMS[k] + (_BEAMS[1] - _BEAMS[0]) * _vertex(beams[k - 1 : k + 2])
        pure = beams.max() / len(self._row) / max(np.square(np.abs(cells[r, d][self._row])).sum(), 1e-30)
        near = np.square(np.abs(cells[r - 1 : r + 2, d][:, self._row])).sum(axis=1)
        between = _vertex(near) if len(near) == 3 else 0.0
        away = self._ranges[r] + (self._ranges[1] - self._ranges[0]) * between
        bearing = float(np.arcsin(np.clip(sine, -1, 1)))
        return Strongest(float(away), float(self._speeds[d]), bearing, power > _STRONG and pure > _PURE)

    def turn(self, echo: Strongest, dt: float, velocity: Float[np.ndarray, "2"], told: float) -> Turn | None:
        """By how much the sensor has turned in the last `dt` s by the strongest echo; None where it was another one, or
        one that moves.

        Args:
            velocity: of the sensor, m/s.
            told: turn by another estimator, rad.
        """
        last, self._last = self._last, echo
        ahead = np.array([np.cos(echo.bearing), np.sin(echo.bearing)])
        closing, across = velocity @ ahead, velocity[1] * ahead[0] - velocity[0] * ahead[1]
        off = (echo.speed - closing + self._span / 2) % self._span - self._span / 2
        same = last is not None and last.clear and echo.clear and abs(off) < _SPEED
        if not (same and abs(echo.range - last.range + closing * dt) < _RANGE):
            self._odds, self._apart = 0.0, np.zeros(2)
            return None
        flash = last.bearing - echo.bearing
        turns = np.array([flash, flash - across * dt / max(echo.range, 0.1)])
        if np.abs(turns - told).min() > _BEARING * dt:
            self._odds, self._apart = 0.0, np.zeros(2)
            return None
        self._apart = np.exp(-dt / _COMPARED) * self._apart + (told - turns)
        gain = (self._apart[1] ** 2 - self._apart[0] ** 2) / (2 * _ERRS**2)
        self._odds = float(np.clip(self._odds + dt / _COMPARED * gain, -_SUREST, _SUREST))
        share = 1 / (1 + np.exp(-self._odds))
        # Whoever takes it for the wrong one does so in all frames that are compared.
        spread = share * (1 - share) * (turns[0] - turns[1]) ** 2 * max(_COMPARED / dt, 1.0)
        return Turn(share * turns[0] + (1 - share) * turns[1], _NOISE**2 + spread, share)


def _vertex(powers: Float[np.ndarray, "3"]) -> float:
    """Offset in bins of a peak from the parabola through three log powers."""
    a, b, c = np.log(np.maximum(powers, 1e-30))
    bend = a - 2 * b + c
    return float(np.clip(0.5 * (a - c) / bend, -1, 1)) if bend < -1e-9 else 0.0


@njit(cache=True)
def _strongest(cells, row, first):
    """Range and Doppler bin of the strongest cell with neighbours in range, and its power over the median cell's."""
    ranges, bins, _ = cells.shape
    power = np.zeros((ranges, bins), np.float32)
    best, place = -1.0, (first, 0)
    for r in range(first, ranges):
        for d in range(bins):
            for antenna in row:
                value = cells[r, d, antenna]
                power[r, d] += value.real**2 + value.imag**2
            if 0 < r < ranges - 1 and power[r, d] > best:
                best, place = power[r, d], (r, d)
    return place[0], place[1], best / max(np.median(power[first::4]), 1e-30)
