"""Interference: chirps of other radars that cross the IF band of the receiver.

The radar mixes received signals with its own ramp. With t from that ramp's start, and l(t) the time within the other
radar's ramp, by its own clock, at which the wave was sent, the mixer output is

    x(t) = a exp(j 2 pi [ f t + S t^2 / 2  -  f' l - S' l^2 / 2 ]),      a^2 = G G' (lambda / 4 pi d)^2  (Friis),

for as long as both ramps last: a linear chirp of slope S - S' (after G. M. Brooker, "Mutual interference of
millimeter-wave radar systems", IEEE Trans. EMC 49, 2007). As l is linear in t (distance, both speeds and the clocks'
error are), so is the frequency, and the spectrum of such a piece is a difference of two Fresnel integrals. The IF
filter is a product with it, and the samples are its transform: nothing is sampled at a higher rate, and a crossing
shorter than a sample comes out as the filter's response to it.

Only the straight path between the radars counts, with obstacles on it; reflections of interference are not modelled.
Every ramp begins with phase 0, by either radar's clock.
"""

from typing import NamedTuple

import numpy as np
import scipy.fft
from jaxtyping import Bool, Complex, Float, Int
from numba import njit
from scipy.special import fresnel

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarsim.motion.trajectory import Motion
from radarsim.propagation.antenna import gain_pattern
from radarsim.propagation.fields import dot, gain_towards, length, minus, unit, upright, upwards, vec
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles
from radarsim.receiver.frontend import FrontEnd
from radarsim.world.interferers import Interferer

#: Distance from the band within which a chirp counts, in units of the spread of its own ends, which are 36 dB down
#: there.
_NEAR = 10.0
#: Largest phase deviation (cycles) at which a chirp is treated as a tone.
_TONE = 1e-4


class Sweeps(NamedTuple):
    """Linear chirps: phase p0 + p1 t + p2 t^2 / 2 in cycles, t in s, from begin to end."""

    phase: Float[np.ndarray, "*n 3"]
    begin: Float[np.ndarray, "*n"]
    end: Float[np.ndarray, "*n"]

    def mirrored(self) -> "Sweeps":
        """Complex conjugates of the sweeps."""
        return self._replace(phase=-self.phase)

    def entering(self, low: float, high: float) -> Bool[np.ndarray, "*n"]:
        """Mask of sweeps that have a duration and come near a band, Hz."""
        first, last = (self.phase[..., 1] + self.phase[..., 2] * t for t in (self.begin, self.end))
        lasting = self.end > self.begin
        duration = np.where(lasting, self.end - self.begin, 1.0)
        near = _NEAR * np.maximum(np.sqrt(np.abs(self.phase[..., 2])), 1 / duration)
        return lasting & (np.minimum(first, last) < high + near) & (np.maximum(first, last) > low - near)

    def at(self, rows: Bool[np.ndarray, "*n"]) -> "Sweeps":
        """Select some sweeps."""
        return Sweeps(self.phase[rows], self.begin[rows], self.end[rows])

    def spectrum(self, f: Float[np.ndarray, "bin"]) -> Complex[np.ndarray, "n bin"]:
        """Fourier integrals at frequencies, Hz: Fresnel integrals from end to end, sinc functions for tones."""
        middle, half = (self.begin + self.end) / 2, (self.end - self.begin) / 2
        p0, p1, p2 = self.phase.T
        cycles = p0 + middle * (p1 + middle * p2 / 2)
        away = (p1 + middle * p2)[:, None] - f  # frequency offset of the sweep's middle
        out = np.empty(away.shape, complex)
        bent = np.abs(p2) * half**2 / 2 > _TONE
        width = 2 * half[~bent, None]
        out[~bent] = width * np.sinc(width * away[~bent])
        p2, half, away = p2[bent, None], half[bent, None], away[bent]
        scale = np.sqrt(2 * np.abs(p2))
        (s1, c1), (s0, c0) = (fresnel(scale * (edge + away / p2)) for edge in (half, -half))
        whole = (c1 - c0 + 1j * np.sign(p2) * (s1 - s0)) / scale
        out[bent] = whole * np.exp(-1j * np.pi * away**2 / p2)
        return out * np.exp(2j * np.pi * (cycles[:, None] - f * middle[:, None]))


class Interference:
    """Signal of other radars at the receiver.

    Args:
        interferers: the other radars.
        board: front end of the disturbed radar.
        obstacles: obstacles between the radars.
    """

    def __init__(self, interferers: list[Interferer], board: FrontEnd, obstacles: Obstacles):
        self.interferers, self.board, self.obstacles, self.config = interferers, board, obstacles, board.config
        config, (low, high) = self.config, board.passband
        self._pattern = gain_pattern(board.settings.pattern)
        # A line spectrum is that of a periodic signal: the period is twice a ramp, in which the filters' response
        # decays.
        count = scipy.fft.next_fast_len(int(np.ceil(2 * config.ramp_end_time * config.sample_rate)))
        step = config.sample_rate / count
        self._bins = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
        at = config.adc_start_time + np.arange(config.samples) / config.sample_rate
        self._response = board.beat_response(self._bins)
        self._transform = (step * np.exp(2j * np.pi * self._bins[:, None] * at)).astype(np.complex64)
        # Interference enters at the receivers: the transmitters' part of the channel gains is not in it.
        self._receivers = (board.channel[0] / board.channel)[..., None]

    def __call__(self, motion: Motion, time: float) -> Complex[np.ndarray, "loop tx rx sample"]:
        """Interference in the frame that starts at `time`, in the unit of `FrontEnd.receive`."""
        config = self.config
        loops, tx, rx, samples, _ = config.frame_shape
        out = np.zeros((loops * tx, rx, samples), np.complex64)
        for amplitude, other in zip(self._amplitudes(motion, time), self.interferers, strict=True):
            if not amplitude:
                continue
            sweeps = self._sweeps(other, motion, time)
            self._add(sweeps, amplitude * self._response, out)
            if (rejection := self.board.settings.image_rejection_db) is not None:
                # The mixer's image of signals below zero; `FrontEnd.receive` adds the image of those above.
                above = self._response * (self._bins > 0)
                self._add(sweeps.mirrored(), amplitude.conjugate() * 10 ** (-rejection / 20) * above, out)
        return out.reshape(loops, tx, rx, samples) * self._receivers.astype(np.complex64)

    def _add(
        self, sweeps: Sweeps, response: Complex[np.ndarray, "bin"], out: Complex[np.ndarray, "chirp rx sample"]
    ) -> None:
        """Add the samples of sweeps (chirp, candidate, rx) that a response passes."""
        for candidate in range(sweeps.begin.shape[1]):
            some = Sweeps(*(each[:, candidate] for each in sweeps))
            rows = some.entering(self._bins[0], self._bins[-1])
            if rows.any():
                out[rows] += (some.at(rows).spectrum(self._bins) * response).astype(np.complex64) @ self._transform

    def _amplitudes(self, motion: Motion, time: float) -> list[complex]:
        """Amplitude of each radar: square root of its power at an RX over the power that the disturbed radar transmits,
        in the middle of the burst."""
        middle = np.array([time + self.config.burst_center])
        here, rotation = motion.position(middle), motion.rotation(middle).as_matrix()
        there = np.array([other.places(middle[0]) for other in self.interferers])
        observation = Observation(here, rotation, middle, np.inf, self.config.wavelength, 0.0, *self._pattern)
        n = len(there)
        # Delays by slabs, some ps, are irrelevant: the phases of another radar are arbitrary.
        passed = self.obstacles.passage(
            observation, np.zeros(n, int), np.repeat(here, n, axis=0), there, np.ones(n, bool)
        )
        found = []
        for other, place, factor in zip(self.interferers, there, passed.factor, strict=True):
            power = 10 ** ((self.config.tx_backoff_db - other.radar.tx_backoff_db) / 20)
            link = _link(place - here[0], rotation[0], other.rotation, self._pattern)
            found.append(complex(factor * power * link * other.radar.wavelength / (4 * np.pi)))
        return found

    def _sweeps(self, other: Interferer, motion: Motion, time: float) -> Sweeps:
        """Chirps at the mixer's output: another radar's in each of the frame's chirps (in order of loop and tx), for
        each candidate of the other's chirps that may fall into it, and each rx."""
        config, theirs, rate = self.config, other.radar, 1 + 1e-6 * other.clock_ppm
        own = time + (config.chirp_times.ravel() - config.adc_center_time)  # start of each ramp, s
        ends = own[:, None] + [0, config.ramp_end_time]
        length = _lengths(config, other, motion, ends) / SPEED_OF_LIGHT  # chirp, begin and end, their tx, rx
        number, ramp = _chirps(theirs, rate * (own - other.start), rate * config.ramp_end_time)
        slot = number % (theirs.loops * len(theirs.tx_order)) % len(theirs.tx_order)
        sender = np.array(theirs.turn)[slot]
        late, later = (np.take_along_axis(length[:, k], sender[..., None], axis=1) for k in (0, 1))
        # Time within the other radar's ramp, by its clock: l = begun + pace t.
        pace = rate * (1 - (later - late) / config.ramp_end_time)
        begun = rate * (own[:, None, None] - other.start - late) - ramp[..., None]
        phase = np.stack([
            -begun * (theirs.start_frequency + begun * theirs.slope / 2),
            config.start_frequency - pace * (theirs.start_frequency + theirs.slope * begun),
            config.slope - theirs.slope * pace**2,
        ], axis=-1)  # fmt: skip
        begin = np.maximum(-begun / pace, 0)
        end = np.minimum((theirs.ramp_end_time - begun) / pace, config.ramp_end_time)
        return Sweeps(phase, begin, np.where(number[..., None] < 0, begin, end))


def _chirps(
    theirs: RadarConfig, time: Float[np.ndarray, "chirp"], duration: float
) -> tuple[Int[np.ndarray, "chirp candidate"], Float[np.ndarray, "chirp candidate"]]:
    """Candidates of a radar's chirps within a duration after each time: their numbers and ramp starts.

    Args:
        time: s, by that radar's clock since its first frame; earlier chirps have negative numbers.
        duration: s.

    Returns:
        both (chirp, candidate); s.
    """
    chirps = len(theirs.tx_order)
    count = theirs.loops * chirps
    frame = np.floor(time / theirs.frame_period).astype(int)
    since = time - frame * theirs.frame_period
    within = np.floor(since / theirs.chirp_time).astype(int)
    if theirs.loop_idle_time:
        loop = np.floor(since / theirs.loop_time).astype(int)
        slot = np.floor((since - loop * theirs.loop_time) / theirs.chirp_time).astype(int)
        within = loop * chirps + np.minimum(slot, chirps - 1)
    first = frame * count + np.clip(within, 0, count - 1)
    number = first[:, None] - 1 + np.arange(3 + int(duration / theirs.chirp_time))
    start = number // count * theirs.frame_period + number % count * theirs.chirp_time
    return number, start + theirs.idle_time + number % count // chirps * theirs.loop_idle_time


def _lengths(
    config: RadarConfig, other: Interferer, motion: Motion, times: Float[np.ndarray, "chirp end"]
) -> Float[np.ndarray, "chirp end tx rx"]:
    """Path lengths from another radar's transmitters to the receivers at times, s: (chirp, end, their tx, rx), m."""
    t = times.ravel()
    rx = motion.position(t)[:, None] + rx_positions(config) @ motion.rotation(t).as_matrix().transpose(0, 2, 1)
    tx = other.places(t)[:, None] + tx_positions(other.radar) @ other.rotation.T
    away = np.linalg.norm(tx[:, :, None] - rx[:, None], axis=-1)
    return away.reshape(*times.shape, *away.shape[1:])


@njit(cache=True)
def _link(there, rotation, other, pattern):
    """Amplitude gains of both antennas along the line between them, over its length, 1/m, for the field component
    vertical in both antennas' frames."""
    way = vec(there)
    towards, back = unit(way), unit(minus((0.0, 0.0, 0.0), way))
    shared = dot(upright(upwards(rotation), towards), upright(upwards(other), towards))
    return shared * gain_towards(towards, rotation, pattern) * gain_towards(back, other, pattern) / length(way)
