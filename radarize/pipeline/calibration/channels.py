"""Gains and phases of the channels, estimated from plane waves.

A range-Doppler cell with a single far echo has the snapshot x = c s a(u): the channel factors c times a plane wave of
amplitude s from direction u. Each such cell measures c up to the wave's amplitude and direction. The average over many
cells is accurate, since second echoes in them have random phases. Plane waves do not determine a phase that grows
linearly along the array, which shifts all directions by the same amount (after Friedlander and Weiss, "Direction
finding in the presence of mutual coupling and unknown gain and phase", 1991); `radarize.pipeline.calibration.egomotion`
estimates it.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from radarize.pipeline.calibration.cells import Cells
from radarize.radar.array import virtual_positions
from radarize.radar.config import RadarConfig

#: Share of the cells that is fitted, the purest ones; purity from which on all cells are fitted; minimum purity.
_SHARE, _PURE, _LEAST = 0.4, 0.97, 0.5
_ROUNDS, _SETTLED = 12, 1e-4
#: Number of parts of the walk, whose scatter gives standard errors.
PARTS = 12


class Array:
    """Plane waves over the virtual antennas of a radar.

    Attributes:
        positions: (antenna, 2) left and up, in wavelengths.
        axes: axes (0 left, 1 up) along which antennas differ; direction cosines along another axis are 0.
    """

    def __init__(self, config: RadarConfig):
        self.positions = virtual_positions(config).reshape(-1, 3)[:, 1:] / config.wavelength
        self.axes = [axis for axis in (0, 1) if np.ptp(self.positions[:, axis]) > 0.1]
        self._slopes = np.column_stack([np.ones(len(self.positions)), -2 * np.pi * self.positions[:, self.axes]])
        self._inverse = np.linalg.pinv(self._slopes)
        sines = [np.linspace(-0.95, 0.95, 77), np.linspace(-0.8, 0.8, 17)]
        grid = np.meshgrid(*(each if axis in self.axes else [0.0] for axis, each in enumerate(sines)), indexing="ij")
        directions = np.stack([each.ravel() for each in grid], axis=1)
        self._grid = directions[(directions**2).sum(axis=1) < 0.95]
        self._beams = self.wave(self._grid).conj().T.astype(np.complex64)

    def wave(self, directions: Float[np.ndarray, "n 2"]) -> Complex[np.ndarray, "n antenna"]:
        """Return plane waves from direction cosines to the left and up."""
        return np.exp(-2j * np.pi * (directions @ self.positions.T))

    def slope(self, factors: Complex[np.ndarray, "antenna"]) -> Float[np.ndarray, "2"]:
        """Return the shift of direction cosines caused by the linear part of the channels' phases."""
        shift = np.zeros(2)
        shift[self.axes] = (self._inverse @ centred(factors))[1:]
        return shift

    def level(self, factors: Complex[np.ndarray, "antenna"]) -> Complex[np.ndarray, "antenna"]:
        """Return the factors with a mean gain of 0 dB and without the linear part of their phases (`slope`)."""
        phases = centred(factors)
        phases -= self._slopes @ (self._inverse @ phases)
        return np.abs(factors) / np.exp(np.log(np.abs(factors)).mean()) * np.exp(1j * phases)

    def fit(self, snapshots: Complex[np.ndarray, "cell antenna"]) -> "Waves":
        """Fit the strongest plane wave to each calibrated snapshot: peak of the beamformer, refined by phases."""
        directions = np.empty((len(snapshots), 2))
        for start in range(0, len(snapshots), 4096):
            beams = np.abs(snapshots[start : start + 4096].astype(np.complex64) @ self._beams)
            directions[start : start + 4096] = self._grid[beams.argmax(axis=1)]
        for _ in range(4):
            turned = snapshots * self.wave(directions).conj()
            off = np.angle(turned * turned.mean(axis=1, keepdims=True).conj())
            directions[:, self.axes] += np.clip(off @ self._inverse[1:].T, -0.1, 0.1)
            directions *= np.minimum(1, 0.98 / np.hypot(*directions.T).clip(1e-9))[:, None]
        amplitude = (snapshots * self.wave(directions).conj()).mean(axis=1)
        power = np.square(np.abs(snapshots)).mean(axis=1)
        return Waves(directions, amplitude, np.square(np.abs(amplitude)) / power.clip(1e-30))

    def noise(self, purity: Float[np.ndarray, "cell"]) -> Float[np.ndarray, "cell 2"]:
        """Return standard deviations of direction cosines, if the residual of a plane wave is random per antenna."""
        spread = np.square(2 * np.pi * (self.positions - self.positions.mean(axis=0))).sum(axis=0)
        free = max(len(self.positions) - 1 - len(self.axes), 1) / len(self.positions)
        leftover = (1 - purity)[:, None] / (2 * free)
        return np.sqrt(leftover / np.where(spread > 1e-3, spread, np.inf) + np.square([0.003, 0.01]))


@dataclass(frozen=True)
class Waves:
    """Plane waves of snapshots.

    Attributes:
        directions: (cell, 2) direction cosines to the left and up.
        amplitude: (cell,) mean over the antennas.
        purity: (cell,) share of the snapshot's power that the wave explains.
    """

    directions: Float[np.ndarray, "cell 2"]
    amplitude: Complex[np.ndarray, "cell"]
    purity: Float[np.ndarray, "cell"]


@dataclass(frozen=True)
class Channels:
    """Channel factors, estimated from plane waves.

    Attributes:
        factors: (antenna,) channel factors, levelled (`Array.level`).
        error: (antenna, 2) standard errors of their gains (dB) and phases (rad).
        waves: plane waves of all cells, corrected by the factors.
    """

    factors: Complex[np.ndarray, "antenna"]
    error: Float[np.ndarray, "antenna 2"]
    waves: Waves


def fit_channels(cells: Cells, array: Array) -> Channels:
    """Estimate channel factors from the purest cells, iteratively: better factors make more cells pure."""
    factors = np.ones(len(array.positions), complex)
    for _ in range(_ROUNDS):
        waves = array.fit(cells.snapshot / factors)
        before, pure = factors, _pure(waves)
        factors = _mean(cells, waves, pure, array)
        if np.abs(factors / before - 1).max() < _SETTLED:
            break
    waves = array.fit(cells.snapshot / factors)
    parts = [part for part in np.array_split(np.flatnonzero(_pure(waves)), PARTS) if len(part)]
    apart = np.log(np.array([_mean(cells, waves, part, array) for part in parts]) / factors)
    error = np.stack([20 / np.log(10) * apart.real, apart.imag], axis=-1).std(axis=0) / np.sqrt(max(len(parts) - 1, 1))
    return Channels(factors, error, waves)


def _pure(waves: Waves) -> np.ndarray:
    return waves.purity >= np.clip(np.quantile(waves.purity, 1 - _SHARE), _LEAST, _PURE)


def _mean(cells: Cells, waves: Waves, chosen: np.ndarray, array: Array) -> Complex[np.ndarray, "antenna"]:
    """Return the mean of the factors that the chosen cells measure, weighted by purity."""
    expected = waves.amplitude[chosen, None] * array.wave(waves.directions[chosen])
    weight = 1 / (1.01 - waves.purity[chosen])
    return array.level(weight @ (cells.snapshot[chosen] / expected))


def centred(factors: Complex[np.ndarray, "antenna"]) -> Float[np.ndarray, "antenna"]:
    """Return phases relative to their mean, rad."""
    return np.angle(factors * np.exp(-1j * np.angle(factors.sum())))
