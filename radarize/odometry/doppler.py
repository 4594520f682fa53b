"""Ego-velocity from the Doppler shifts of a static world: the classical baseline of the networks.

The closing speed of a static echo from unit direction u is v . u, where v is the sensor's velocity. Echoes are peaks of
the range-Doppler-azimuth cube of a burst. The azimuth row measures u_y, and the phase between the elevation pairs
measures u_z, so that echoes of ceiling and floor fit the same model as echoes of walls.

In a furnished room most peaks are no single direct echo: several echoes share their cell, or they came over several
surfaces, and both close more slowly than a direct echo of the same azimuth. The likelihood of a velocity is therefore
that of a mixture: an echo is direct, with an error of its own standard deviation, or its closing speed is uniform over
the unambiguous span (MLESAC: Torr and Zisserman, "MLESAC: A new robust estimator with application to estimating image
geometry", 2000). Before its speed is compared with any velocity, the odds that an echo is direct follow from how well
one plane wave fits its cell, in azimuth and in elevation. Pairs of echoes give hypotheses. Expectation maximisation
refines the likeliest one by weighted least squares, which yields the covariance (after Doer and Trommer, "An EKF based
approach to radar inertial odometry", 2020: REVE).

Errors in the regressors bias a fit. An echo with measured u_z = 0 comes from a little above or below, so its u_x is
smaller than measured, and the estimated speed is too small: by 0.8 % in offices, by 2.5 % between bare walls. Each echo
therefore has a variance of its own u_z, estimated from the coherence of the elevation pairs as in interferometry, and
the fit uses the expected direction (regression calibration: Carroll, Ruppert, Stefanski, Crainiceanu, "Measurement
error in nonlinear models", 2006, ch. 4),

    E[u_x] = sqrt(1 - u_y^2 - E[u_z]^2 - Var[u_z]).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Int
from numba import njit

from radarize.io.plain import Frozen, setting
from radarize.odometry.mixture import MIN_ECHOES, fit_velocity
from radarize.odometry.parabola import vertex
from radarize.radar.array import ROW, virtual_positions
from radarize.signal.batch import Batch
from radarize.signal.heatmaps import Heatmaps


@dataclass(frozen=True)
class Velocities:
    """Sensor velocities, one per frame, at the burst centres.

    Attributes:
        velocity: (frame, 2) m/s, sensor frame (x forward, y left).
        covariance: (frame, 2, 2) (m/s)^2; large where the velocity is unobservable.
        inliers: (frame,) number of echoes that agree with the velocity.
        seen: (frame,) False where the velocity is unobservable; its value there has no meaning.
    """

    velocity: Float[np.ndarray, "frame 2"]
    covariance: Float[np.ndarray, "frame 2 2"]
    inliers: Int[np.ndarray, "frame"]
    seen: Bool[np.ndarray, "frame"]


class DopplerConfig(Frozen):
    """Ego-velocity from the Doppler shifts of single echoes (`DopplerVelocity`)."""

    beams: int = setting(
        48, "azimuth beams of the range-Doppler-azimuth cube, uniform in u_y, the sine of azimuth", "beams", ge=8
    )
    echoes: int = setting(160, "maximum number of echoes per frame, strongest first", "echoes", ge=4)
    threshold: float = setting(20.0, "minimum power of an echo over the median of the cube", "1", gt=1)
    min_range: float = setting(0.25, "minimum range of an echo; nearer peaks are transmitter leakage", "m", ge=0)
    direct: float = setting(
        0.05, "prior odds that an echo is direct, times p / (1 - p), where p is the share of its cell's power that "
        "one plane wave explains", "1", tuned="12 walks of 60 s (FURNISHED)", gt=0
    )  # fmt: skip
    guess: float = setting(
        0.015, "standard deviation of the velocity of a pair of echoes", "m/s", tuned="12 walks of 60 s (FURNISHED)",
        gt=0
    )  # fmt: skip
    hypotheses: int = setting(100, "pairs of echoes that are tried", "pairs", ge=1)
    speed_noise: float = setting(0.003, "standard deviation of the radial velocity of a strong echo", "m/s", gt=0)
    power_noise: float = setting(
        0.1, "standard deviation of the radial velocity of an echo at the median of the cube; it decreases with "
        "amplitude", "m/s", gt=0
    )  # fmt: skip
    azimuth_noise: float = setting(0.005, "standard deviation of an echo's u_y", "1", gt=0)
    elevation: float = setting(
        0.4, "prior standard deviation of u_z, the sine of elevation, over all echoes; it shrinks measured u_z "
        "towards the horizon", "1", gt=0
    )  # fmt: skip
    beam: float = setting(
        0.25, "maximum standard deviation of u_z within one echo, set by the elevation beam; used where no "
        "elevation pair measures it", "1", gt=0
    )  # fmt: skip
    climb: float = setting(
        0.15, "standard deviation of the vertical velocity of a handheld radar; its mean is zero", "m/s", gt=0
    )
    still: float = setting(
        0.02, "speed below which the sensor is at rest, if the speed is within its standard error and most echoes "
        "are at rest", "m/s", ge=0
    )  # fmt: skip
    few: float = setting(
        24.0, "inliers at which the covariance of the fit is doubled; with fewer it grows further, because a larger "
        "share of them has come over several surfaces", "echoes", tuned="12 walks of 60 s (FURNISHED)", ge=0
    )  # fmt: skip
    scale_noise: float = setting(
        0.003, "standard deviation of the error along the velocity that all echoes of a frame share (elevation), as "
        "a fraction of speed", "1", tuned="6 walks of 20 s (ODOMETRY)", ge=0
    )  # fmt: skip
    course_noise: float = setting(
        0.004, "standard deviation of the error across the velocity that all echoes of a frame share (azimuth)",
        "rad", tuned="12 walks of 60 s (FURNISHED)", ge=0
    )  # fmt: skip
    rough: float = setting(
        0.03, "standard deviation of the shared error along and across the velocity, as a fraction of speed, for "
        "arrays that do not measure elevation; twice that for azimuth rows of fewer than 8 antennas", "1",
        tuned="12 walks of 12 s (RADARS_FURNISHED) with one and two transmitters and with three other boards", ge=0
    )  # fmt: skip
    floor: float = setting(0.0005, "minimum standard deviation of a velocity", "m/s", ge=0)


class DopplerVelocity:
    """Velocity estimator by robust least squares over Doppler peaks; it keeps no state between frames.

    `Batch.aliases` resolves speeds beyond `config.max_velocity`. Residuals are taken modulo the unambiguous span, so a
    higher speed is also found where the aliases are not resolved, from echoes to the side.

    Attributes:
        lever: m, lever arm, see `VelocityEstimator`.
    """

    def __init__(self, heatmaps: Heatmaps, settings: DopplerConfig | None = None):
        self.settings = settings or DopplerConfig()
        self.config = heatmaps.config
        self.row, self.pairs = heatmaps.row, heatmaps.pairs
        self._heatmaps = heatmaps
        self._u = np.linspace(-0.94, 0.94, self.settings.beams)
        self._steering = torch.as_tensor(heatmaps.steering(self.row, self._u))
        self._steering = self._steering.to(torch.complex64)
        self._array = _array(heatmaps, self._u)
        # The phase of an echo follows the path from the transmitter to the target to the receiver, so the measured
        # velocity is that of the point midway between transmitter and receiver, averaged over the row.
        self.lever = float(virtual_positions(self.config).reshape(-1, 3)[self.row, 1].mean()) / 2
        self._first = int(np.searchsorted(heatmaps.ranges, self.settings.min_range))
        no_elevation, short_row = self.pairs is None, len(self.row) < ROW
        self._rough = self.settings.rough * (2 if short_row else 1 if no_elevation else 0)
        # One table of random numbers for all frames: the result of a frame does not depend on its batch.
        self._random = np.random.default_rng(0).random((self.settings.hypotheses, 2))

    def estimate(self, batch: Batch) -> Velocities:
        """Return the velocities of the next frames."""
        spectrum = batch.spectrum
        power = self._heatmaps.beamformed(spectrum, self.row, self._steering).numpy()
        frames = zip(spectrum.numpy(), power, batch.aliases, strict=True)
        found = [self.solve(self._echoes(*frame)) for frame in frames]
        velocity, covariance, inliers = map(np.array, zip(*found, strict=True))
        seen = (np.linalg.eigvalsh(covariance)[:, -1] < _MAX_STD**2) & (inliers >= MIN_ECHOES)
        inflation = 1 + (self.settings.few / inliers[seen]) ** 4
        covariance[seen] = inflation[:, None, None] * covariance[seen] + self._common_covariance(velocity[seen])
        return Velocities(velocity, covariance, inliers, seen)

    def _common_covariance(self, velocity: Float[np.ndarray, "frame 2"]) -> Float[np.ndarray, "frame 2 2"]:
        """Covariance of the errors that all echoes of a frame have in common. The residuals of the fit do not contain
        them."""
        s = self.settings
        across = np.stack([-velocity[:, 1], velocity[:, 0]], axis=1)
        along, side = (v[:, :, None] * v[:, None] for v in (velocity, across))
        scale, course = (noise**2 + self._rough**2 for noise in (s.scale_noise, s.course_noise))
        return scale * along + course * side + s.floor**2 * np.eye(2)

    def echoes(self, spectrum: Complex64[torch.Tensor, "range doppler antenna"]) -> Float[np.ndarray, "echo 7"]:
        """Return the peaks of one frame: range bin, closing speed (m/s), u_y, u_z, variance of u_z, power over the
        median, share of the cell's power over the row that one plane wave explains."""
        power = self._heatmaps.beamformed(spectrum[None], self.row, self._steering)[0].numpy()
        return self._echoes(spectrum.numpy(), power, np.zeros(spectrum.shape[1], int))

    def _echoes(self, cells: np.ndarray, power: np.ndarray, aliases: np.ndarray) -> np.ndarray:
        level = float(np.median(power[self._first :: 2, :, ::4]))
        found = _peaks(power, max(level, 1e-12) * self.settings.threshold, self._first)
        if len(found) > self.settings.echoes:
            strength = power[found[:, 0], found[:, 1], found[:, 2]]
            found = found[np.argsort(-strength, kind="stable")[: self.settings.echoes]]
        speeds = self._array.velocities + 2 * self.config.max_velocity * aliases
        echoes = _refine(found, power, cells, self._array._replace(velocities=speeds), self.settings.beam)
        echoes[:, 5] /= max(level, 1e-12)
        return echoes

    def solve(self, echoes: Float[np.ndarray, "echo 7"]) -> tuple[np.ndarray, np.ndarray, int]:
        """Return the velocity (2,) in m/s, its covariance (2, 2) and the number of inliers from a frame's `echoes`."""
        s = self.settings
        # Without elevation pairs the vertical speed is unobservable.
        climb = s.climb if self.pairs is not None else 1e-3
        noise = np.array([s.speed_noise, s.power_noise, s.azimuth_noise, s.elevation, climb])
        # A single echo, too, has to have the memory layout that the loop is compiled for.
        seen = np.ascontiguousarray(echoes[:, 1:])
        span = 2 * self.config.max_velocity
        velocity, covariance, inliers = fit_velocity(seen, self._odds(seen), self._random, noise, s.guess, span)
        if inliers and np.hypot(*velocity) < s.still and np.median(np.abs(echoes[:, 1])) < 2 * s.still:
            if velocity @ np.linalg.solve(covariance, velocity) < _SIGMAS**2:
                velocity = np.zeros(2)
        return velocity, covariance, inliers

    def _odds(self, echoes: Float[np.ndarray, "echo 6"]) -> Float[np.ndarray, "echo"]:
        """Prior odds that echoes are direct. Incoherent elevation pairs show several echoes in a cell."""
        spread, purity = echoes[:, 3], np.minimum(echoes[:, 5], 1)
        odds = self.settings.direct * purity / (1 - purity + _IMPURITY)
        return odds if self.pairs is None else odds * np.maximum(1 - spread / self.settings.beam**2, 0)


class _Array(NamedTuple):
    """Radar parameters of `_refine`: direction cosines of beams, speeds of Doppler bins and their width (m/s); antennas
    of the row; antennas of the elevation pairs and their height / wavelength; per antenna y / wavelength and TDM phase
    per speed (rad s/m)."""

    u: np.ndarray
    velocities: np.ndarray
    bin_width: float
    row: np.ndarray
    pairs: np.ndarray
    height: float
    y: np.ndarray
    tdm: np.ndarray


def _array(heatmaps: Heatmaps, u: np.ndarray) -> _Array:
    config = heatmaps.config
    positions = virtual_positions(config).reshape(-1, 3) / config.wavelength
    delay = np.repeat(np.asarray(config.slot) * config.chirp_time, len(config.rx))
    heights = np.unique(np.round(positions[:, 2], 6))
    height = float(heights[1] - heights[0]) if len(heights) > 1 else 0.5
    pairs = np.zeros((0, 2), np.int64) if heatmaps.pairs is None else heatmaps.pairs.astype(np.int64)
    tdm = 4 * np.pi / config.wavelength * delay
    row, y = np.asarray(heatmaps.row, np.int64), positions[:, 1].copy()
    return _Array(u, heatmaps.velocities, config.velocity_resolution, row, pairs, height, y, tdm)


#: Share of a direct echo's power that its plane wave leaves, by noise and by what calibration leaves.
_IMPURITY = 0.003
#: Maximum standard deviation of an observable velocity, m/s.
_MAX_STD = 0.3
#: Number of standard deviations beyond which a velocity differs from zero: a starting walk is slow, but its speed is
#: well known.
_SIGMAS = 3.0
#: Power relative to a stronger peak of the same range and Doppler below which a peak may be its sidelobe (-25 dB, and
#: mismatch).
SIDELOBE = 0.1


@njit(cache=True)
def _peaks(power, threshold, first):
    """Local maxima of the cube (range, Doppler cyclic, beam) above a threshold, as index triples."""
    ranges, bins, beams = power.shape
    found = []
    for r in range(max(first, 1), ranges - 1):
        for d in range(bins):
            before, after = (d - 1) % bins, (d + 1) % bins
            strongest = threshold
            for b in range(beams):
                strongest = max(strongest, SIDELOBE * power[r, d, b])
            for b in range(1, beams - 1):
                p = power[r, d, b]
                if p < strongest or p <= power[r, d, b - 1] or p < power[r, d, b + 1]:
                    continue
                if p <= power[r, before, b] or p < power[r, after, b]:
                    continue
                if p <= power[r - 1, d, b] or p < power[r + 1, d, b]:
                    continue
                found.append((r, d, b))
    result = np.empty((len(found), 3), np.int64)
    for i, cell in enumerate(found):
        result[i] = cell
    return result


@njit(cache=True)
def _peak_offset(left, middle, right):
    """Offset of a peak from its bin, in bins, by interpolation of three powers."""
    return vertex(np.log(left + 1e-30), np.log(middle + 1e-30), np.log(right + 1e-30))


@njit(cache=True)
def _refine(found, power, cells, array, beam):
    """Interpolate the peaks between bins; returns echoes: range bin, speed, u_y, u_z, its variance, power, purity."""
    u, velocities, bin_width, row, pairs, height, y, tdm = array
    echoes = np.empty((len(found), 7))
    bins = power.shape[1]
    for i in range(len(found)):
        r, d, b = found[i]
        p = power[r, d, b]
        speed_offset = bin_width * _peak_offset(power[r, (d - 1) % bins, b], p, power[r, (d + 1) % bins, b])
        u_y = u[b] + (u[1] - u[0]) * _peak_offset(power[r, d, b - 1], p, power[r, d, b + 1])
        u_z, spread = 0.0, beam**2
        if len(pairs):
            lower, upper, total = 0.0j, 0.0j, 1e-30
            for low, high in pairs:
                for antenna in (low, high):
                    phase = 2 * np.pi * y[antenna] * u_y + tdm[antenna] * speed_offset
                    value = cells[r, d, antenna] * np.exp(1j * phase)
                    total += value.real**2 + value.imag**2
                    if antenna == low:
                        lower += value
                    else:
                        upper += value
            u_z = -np.angle(upper * np.conj(lower)) / (2 * np.pi * height)
            # The coherence of echoes with standard deviation s of u_z is exp(-(2 pi height s)^2 / 2). A difference in
            # power between the two heights reduces it too.
            coherence = min(max(2 * abs(upper * lower) / (len(pairs) * total), 1e-6), 1 - 1e-6)
            spread_squared = -2 * np.log(coherence) / (2 * np.pi * height) ** 2
            spread = spread_squared * beam**2 / (spread_squared + beam**2)
        wave, total = 0.0j, 1e-30
        for antenna in row:
            value = cells[r, d, antenna]
            wave += value * np.exp(1j * (2 * np.pi * y[antenna] * u_y + tdm[antenna] * speed_offset))
            total += value.real**2 + value.imag**2
        echoes[i, 6] = (wave.real**2 + wave.imag**2) / (len(row) * total)
        limit = 0.98 * np.sqrt(max(1 - u_y * u_y, 0.0))
        u_z = min(max(u_z, -limit), limit)
        echoes[i, 0], echoes[i, 4], echoes[i, 5] = r, spread, p
        echoes[i, 1], echoes[i, 2], echoes[i, 3] = velocities[d] + speed_offset, u_y, u_z
    return echoes
