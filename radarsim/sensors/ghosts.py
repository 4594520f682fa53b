"""Path type of each cell of the range-azimuth map: direct echoes, ghosts, floor and ceiling, moving objects.

The map of each path type equals `radarize.signal.heatmaps.Heatmaps.range_azimuth` (Bartlett, same windows) of its part
of the I/Q, at a fraction of the cost: it needs neither samples nor transforms. An echo's range spectrum is the window's
transform about its beat frequency, eight bins wide, so each echo adds eight numbers per antenna; a few instants of the
burst suffice, because the map sums over Doppler, which equals the mean over loops. Left out are noise, converter,
channel mismatch (which calibration removes), and the smear over azimuth of echoes whose closing speed exceeds
`RadarConfig.max_velocity`, whose delays between transmitters the map compensates at the wrong speed.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Float32, Int, UInt8
from numba import njit, prange

from radarize.io.recording import Stream
from radarize.radar.array import azimuth_row, virtual_positions
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarize.radar.windows import taylor
from radarsim.propagation.burst import BurstClock
from radarsim.propagation.path_types import PathType
from radarsim.receiver.synthesis import _sincos_cycles
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.by_path_type import PARTS, TYPES
from radarsim.sensors.scan import AZIMUTHS, axes
from radarsim.sensors.sensor import Sensor

_INSTANTS = 3
#: Half width of the window's transform, bins, and its table's entries per bin.
_WIDTH, _FINE = 4, 64
#: Step and lowest level of stored powers, dB and dB below the noise: rounded values compress better.
STEP, DEPTH = 0.25, 10.0
#: Label of cells in which no echo reaches the noise.
NOISE = 255


class Ghosts(Sensor):
    """Power by path type on the radar's range bins and the scan's bearings, and the strongest type of each cell."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        config, front_end = scenario.config, scenario.board
        self._maps = PathTypeMaps(config)
        window = np.hanning(config.samples)
        window /= window.sum()
        taper = self._maps.taper
        self._floor = 10 * np.log10(front_end.counts**2 * front_end.noise_power * np.sum(window**2) * np.sum(taper**2))
        leakage = np.fft.fft(front_end.by_path_type([])[0][0] * window, axis=-1).reshape(-1, config.samples)
        self._leakage = self._maps.beams(leakage[self._maps.row].T[None])
        shape = (config.samples, len(AZIMUTHS))
        labels = ", ".join(f"{i} {name}" for i, name in enumerate(PARTS))
        self.streams = {
            "truth/cause_power": Stream(
                (len(PathType), *shape), "f2", "dB of ADC counts^2",
                f"range-azimuth power by path type ({', '.join(TYPES)}), not below {DEPTH:g} dB under the noise",
            ),
            "truth/cause": Stream(
                shape, "u1", "", f"strongest path type of a range-azimuth cell: {labels}, {NOISE} noise",
                labels=PARTS,
            ),
        }  # fmt: skip
        self.products = axes("truth/cause", config, "range bins")

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Power maps and labels of frames."""
        power, cause = [], []
        for lengths, amplitudes, types in zip(frames.lengths, frames.received, frames.types, strict=True):
            maps = self._maps(lengths, self.scenario.board.scale * amplitudes, types)
            power.append(maps)
            cause.append(self.label(maps))
        level = 10 * np.log10(np.maximum(np.stack(power), 10 ** ((self._floor - DEPTH) / 10)))
        return {"truth/cause_power": STEP * np.rint(level / STEP), "truth/cause": np.stack(cause)}

    def label(self, power: Float[np.ndarray, "type range azimuth"]) -> UInt8[np.ndarray, "range azimuth"]:
        """Index into `PARTS` of the strongest part, leakage included, or `NOISE`."""
        every = np.concatenate([power, self._leakage[None]])
        return np.where(every.sum(axis=0) > 10 ** (self._floor / 10), every.argmax(axis=0), NOISE).astype(np.uint8)


class _Tones(NamedTuple):
    """Constants of `_spread`.

    Attributes:
        row: antennas.
        instants: of the burst, -1...1.
        kernel: window transform of a tone between two bins.
        per_metre, per_rate: bins by path length and by its change over half a burst.
        wavenumber: cycles per metre.
        video: cycles per square metre of the residual video phase.
    """

    row: Int[np.ndarray, "antenna"]
    instants: Float[np.ndarray, "instant"]
    kernel: Float32[np.ndarray, "offset"]
    per_metre: float
    per_rate: float
    wavenumber: float
    video: float


class PathTypeMaps:
    """Range-azimuth power of each path type, computed from the echoes.

    Args:
        config: radar configuration.

    Attributes:
        row: the antennas that make the map.
        taper: their weights.
    """

    def __init__(self, config: RadarConfig):
        self.config, self.row = config, azimuth_row(config)
        self.taper = taylor(len(self.row))
        self.taper /= self.taper.sum()
        y = virtual_positions(config).reshape(-1, 3)[self.row, 1]
        steering = np.exp(2j * np.pi / config.wavelength * y[:, None] * np.sin(AZIMUTHS))
        self._steering = (steering * self.taper[:, None]).astype(np.complex64)
        clock, n = BurstClock.of(config), config.samples
        window = np.hanning(n)
        offset = np.arange(-_WIDTH * _FINE, _WIDTH * _FINE + 1) / _FINE
        turns = np.cos(2 * np.pi * offset[:, None] * (np.arange(n) - (n - 1) / 2) / n)
        kernel = (turns @ window / window.sum()).astype(np.float32)
        # Loops are weighted by the square of the window: a few instants at equal parts of this weight represent them.
        share = np.cumsum(np.hamming(max(config.loops, 2)) ** 2)
        even = (np.arange(_INSTANTS) + 0.5) / _INSTANTS
        instants = np.interp(even, share / share[-1], np.linspace(-1, 1, len(share)))
        wavenumber = config.center_frequency / SPEED_OF_LIGHT
        per_rate = wavenumber * n / config.sample_rate / clock.half
        per_metre, video = 1 / (2 * config.range_resolution), config.slope / (2 * SPEED_OF_LIGHT**2)
        self._tones = _Tones(self.row, instants, kernel, per_metre, per_rate, wavenumber, video)

    def __call__(
        self,
        lengths: Float[np.ndarray, "echo virtual 3"],
        amplitudes: Complex[np.ndarray, "echo"],
        types: UInt8[np.ndarray, "echo"],
    ) -> Float[np.ndarray, "type range azimuth"]:
        """Power of each path type in the square of the amplitudes' unit."""
        n = self.config.samples
        spectra = np.zeros((_INSTANTS, len(PathType), n, 2, len(self.row)), np.float32)
        polar = np.abs(amplitudes).astype(np.float32), np.angle(amplitudes) / (2 * np.pi)
        _spread(spectra, lengths, polar, types, self._tones)
        return self.beams(spectra[..., 0, :] + 1j * spectra[..., 1, :])

    def beams(self, spectra: Complex[np.ndarray, "instant *cell antenna"]) -> Float[np.ndarray, "*cell azimuth"]:
        """Mean power of the windowed sum over instants."""
        beams = (spectra.reshape(-1, spectra.shape[-1]) @ self._steering).reshape(*spectra.shape[:-1], -1)
        return np.mean(beams.real**2 + beams.imag**2, axis=0)


@njit(parallel=True, fastmath=True, cache=True)
def _spread(spectra, lengths, polar, types, tones):
    """spectra[instant, cause, bin, (re, im), antenna] += A exp(j phase) K(tone - bin); `polar`: A's sizes and turns.

    Phase and tone are those of `synthesis`. The tone is taken to be the same for all antennas: across the array it
    changes by less than a fifth of a bin.
    """
    row, kernel = tones.row, tones.kernel
    sizes, turns = polar
    antennas, n = len(row), spectra.shape[2]
    for i in prange(len(tones.instants)):
        s = tones.instants[i]
        wave = np.empty((2, antennas), np.float32)
        for e in range(len(sizes)):
            c0, c1, c2 = lengths[e, row[antennas // 2]]
            tone = (c0 + s * (c1 + s * c2)) * tones.per_metre + (c1 + 2 * s * c2) * tones.per_rate
            below = int(np.floor(tone))
            # A tone N bins higher has turned (N - 1) / 2 cycles more between the middle and the first sample.
            turn = turns[e] - below // n * ((n - 1) / 2)
            for a in range(antennas):
                path = lengths[e, row[a], 0] + s * (lengths[e, row[a], 1] + s * lengths[e, row[a], 2])
                cycles = turn + (tones.wavenumber - tones.video * path) * path
                sine, cosine = _sincos_cycles(np.float32(cycles - np.floor(cycles + 0.5)))
                wave[0, a] = sizes[e] * cosine
                wave[1, a] = sizes[e] * sine
            for k in range(2 * _WIDTH):
                x = (below - _WIDTH + 1 + k - tone + _WIDTH) * _FINE
                at = min(max(int(x), 0), 2 * _WIDTH * _FINE - 1)
                weight = kernel[at] + np.float32(x - at) * (kernel[at + 1] - kernel[at])
                cell = spectra[i, types[e], (below - _WIDTH + 1 + k) % n]
                for part in range(2):
                    for a in range(antennas):
                        cell[part, a] += weight * wave[part, a]
