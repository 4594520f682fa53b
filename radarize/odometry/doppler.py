"""Ego-velocity from the Doppler shifts of a static world: the classical baseline of the networks.

The closing speed of a static echo from unit direction u is v . u, where v is the sensor's velocity. Echoes are peaks of
the range-Doppler-azimuth cube of a burst. The azimuth row measures u_y, and the phase between the elevation pairs
measures u_z, so that echoes of ceiling and floor fit the same model as echoes of walls. RANSAC rejects people, ghosts
and aliased echoes. Iteratively reweighted least squares refines the result and yields the covariance (after Doer and
Trommer, "An EKF based approach to radar inertial odometry", 2020: REVE).

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
    """Velocity from the Doppler shifts of echoes (`DopplerVelocity`)."""

    beams: int = setting(48, "azimuth beams of the cube, uniform in u_y", ge=8)
    echoes: int = setting(160, "maximum number of peaks per frame, the strongest ones", ge=4)
    threshold: float = setting(20.0, "minimum power of a peak over the median of the cube", gt=1)
    min_range: float = setting(0.25, "m, minimum range; nearer peaks are transmitter leakage", ge=0)
    inlier: float = setting(0.15, "m/s, maximum residual of an inlier of RANSAC", gt=0)
    hypotheses: int = setting(200, "number of pairs of echoes that RANSAC tries", ge=1)
    speed_noise: float = setting(0.003, "m/s, standard deviation of the closing speed of a strong echo", gt=0)
    power_noise: float = setting(
        0.1, "m/s, additional standard deviation of an echo as strong as the median of the cube; it decreases with the "
        "echo's amplitude", gt=0
    )  # fmt: skip
    azimuth_noise: float = setting(0.005, "standard deviation of an echo's u_y", gt=0)
    elevation: float = setting(
        0.4, "standard deviation of u_z over all echoes, the prior that shrinks measured u_z towards the horizon", gt=0
    )
    beam: float = setting(
        0.25, "maximum standard deviation of u_z within one echo, given by the elevation beam; used where it is not "
        "measured", gt=0
    )  # fmt: skip
    climb: float = setting(
        0.15, "m/s, standard deviation of the vertical speed (bobbing of a handheld sensor); its mean is zero", gt=0
    )
    still: float = setting(
        0.02, "m/s; the velocity is set to zero below this speed if it agrees with zero within its covariance and most "
        "echoes do not move", ge=0
    )  # fmt: skip
    few: float = setting(
        32.0, "number of inliers at which the covariance of the fit is doubled; it grows further with fewer inliers, "
        "because more of them are multipath; chosen on 12 walks of 60 s (handheld, cart, robot; A to D of seeds 301 to "
        "304)", ge=0
    )  # fmt: skip
    scale_noise: float = setting(
        0.003, "standard deviation of the error along the velocity that all echoes of a frame share, as a share of the "
        "speed; it comes from their elevation", ge=0
    )  # fmt: skip
    course_noise: float = setting(
        0.0065, "rad, standard deviation of the error across the velocity that all echoes share: a common bias of "
        "azimuth", ge=0
    )  # fmt: skip
    rough: float = setting(
        0.06, "standard deviation of the shared error along and across the velocity where the array does not measure "
        "elevation, as a share of the speed; twice that for rows of fewer than 8 antennas; chosen on two walks of 20 s "
        "(handheld in A, seed 301; cart in C, seed 303) with two transmitters, the first also with one transmitter and "
        "with two other boards", ge=0
    )  # fmt: skip
    floor: float = setting(0.0005, "m/s, minimum standard deviation of a velocity", ge=0)


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
        seen = (np.linalg.eigvalsh(covariance)[:, -1] < _MAX_STD**2) & (inliers >= _MIN_ECHOES)
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

    def echoes(self, spectrum: Complex64[torch.Tensor, "range doppler antenna"]) -> Float[np.ndarray, "echo 6"]:
        """Return the peaks of one frame: range bin, closing speed (m/s), u_y, u_z, variance of u_z, power over the
        median."""
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

    def solve(self, echoes: Float[np.ndarray, "echo 6"]) -> tuple[np.ndarray, np.ndarray, int]:
        """Return the velocity (2,) in m/s, its covariance (2, 2) and the number of inliers from a frame's `echoes`."""
        s = self.settings
        # Without elevation pairs the vertical speed is unobservable.
        climb = s.climb if self.pairs is not None else 1e-3
        noise = np.array([s.speed_noise, s.power_noise, s.azimuth_noise, s.elevation, climb])
        # A single echo, too, has to have the memory layout that the loop is compiled for.
        seen = np.ascontiguousarray(echoes[:, 1:])
        velocity, covariance, inliers = _fit(seen, self._random, noise, s.inlier, 2 * self.config.max_velocity)
        if inliers and np.hypot(*velocity) < s.still and np.median(np.abs(echoes[:, 1])) < 2 * s.still:
            if velocity @ np.linalg.solve(covariance, velocity) < _SIGMAS**2:
                velocity = np.zeros(2)
        return velocity, covariance, inliers


class _Array(NamedTuple):
    """Radar parameters of `_refine`: direction cosines of beams, speeds of Doppler bins and their width (m/s); antennas
    of the elevation pairs and their height / wavelength; per antenna y / wavelength and TDM phase per speed (rad
    s/m)."""

    u: np.ndarray
    velocities: np.ndarray
    bin_width: float
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
    return _Array(u, heatmaps.velocities, config.velocity_resolution, pairs, height, positions[:, 1].copy(), tdm)


#: Prior standard deviation of the velocity, m/s, above any walking speed: it keeps the fit regular where all echoes
#: come from one direction.
UNKNOWN_SPEED = 10.0
#: Minimum number of inliers, and maximum standard deviation (m/s), of an observable velocity.
_MIN_ECHOES, _MAX_STD = 4, 0.3
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
    """Interpolate the peaks between bins; returns echoes (range bin, speed, u_y, u_z, variance of u_z, power)."""
    u, velocities, bin_width, pairs, height, y, tdm = array
    echoes = np.empty((len(found), 6))
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
        limit = 0.98 * np.sqrt(max(1 - u_y * u_y, 0.0))
        u_z = min(max(u_z, -limit), limit)
        echoes[i, 0], echoes[i, 4], echoes[i, 5] = r, spread, p
        echoes[i, 1], echoes[i, 2], echoes[i, 3] = velocities[d] + speed_offset, u_y, u_z
    return echoes


@njit(cache=True)
def _wrap(residual, span):
    return residual - span * np.rint(residual / span)


@njit(cache=True)
def _fit(echoes, random, noise, inlier, span):
    """Fit (vx, vy, vz) by RANSAC over pairs of echoes, then by iteratively reweighted least squares."""
    count = len(echoes)
    unknown = np.array([[1.0, 0.0], [0.0, 1.0]])
    if count < _MIN_ECHOES:
        return np.zeros(2), unknown, 0
    speed, spread, power = echoes[:, 0], echoes[:, 3], echoes[:, 4]
    speed_noise, power_noise, azimuth_noise, elevation, climb = noise
    u = np.empty((count, 3))
    u[:, 1], u[:, 2] = echoes[:, 1], echoes[:, 2] * elevation**2 / (elevation**2 + spread)
    u[:, 0] = np.sqrt(np.maximum(1 - u[:, 1] ** 2 - u[:, 2] ** 2 - spread, 0.02))

    limit = max(1.5 * span / 2, 1.2 * np.abs(speed).max())
    best, score = np.zeros(2), -1.0
    for h in range(len(random) + 1):
        v = np.zeros(2)  # the first hypothesis is standing still
        if h:
            i, j = int(random[h - 1, 0] * count), int(random[h - 1, 1] * count)
            det = u[i, 0] * u[j, 1] - u[j, 0] * u[i, 1]
            if abs(det) < 0.15:
                continue
            v[0] = (speed[i] * u[j, 1] - speed[j] * u[i, 1]) / det
            v[1] = (u[i, 0] * speed[j] - u[j, 0] * speed[i]) / det
            if v[0] ** 2 + v[1] ** 2 > limit**2:
                continue
        total = 0.0
        for k in range(count):
            e = _wrap(speed[k] - v[0] * u[k, 0] - v[1] * u[k, 1], span) / inlier
            total += max(1 - e * e, 0.0)
        if total > score:
            best, score = v, total

    v = np.array([best[0], best[1], 0.0])
    normal = np.zeros((3, 3))
    scale, inliers = 1.0, 0
    for iteration in range(8):
        normal[:] = 0.0
        normal[0, 0] = normal[1, 1] = 1 / UNKNOWN_SPEED**2
        normal[2, 2] = 1 / climb**2
        right = np.zeros(3)
        squares, weights, inliers = 0.0, 0.0, 0
        # Start with a wide residual scale and halve it in each iteration: otherwise a few strong echoes hold the fit at
        # the coarse result of RANSAC.
        rough = (0.5 * inlier * 0.5**iteration) ** 2
        for k in range(count):
            # u_x is not measured: it follows from u_y and u_z, and so do its errors. The measured u_z is a mean over
            # the elevation pairs; the remaining u_z^2 is distributed like the square of a Gaussian.
            slope_y = v[1] - v[0] * u[k, 1] / u[k, 0]
            slope_z = v[2] - v[0] * u[k, 2] / u[k, 0]
            variance = rough + speed_noise**2 + power_noise**2 / power[k] + (slope_y * azimuth_noise) ** 2
            variance += 0.5 * spread[k] * (slope_z**2 + spread[k] * (v[0] / u[k, 0]) ** 2)
            predicted = v[0] * u[k, 0] + v[1] * u[k, 1] + v[2] * u[k, 2]
            e = _wrap(speed[k] - predicted, span)
            z = e * e / variance
            w = 1 / (1 + z / 9) ** 2  # Geman-McClure: the influence of an outlier vanishes
            inliers += z < 9
            squares += w * z
            weights += w
            for a in range(3):
                right[a] += w / variance * u[k, a] * (e + predicted)
                for b in range(3):
                    normal[a, b] += w / variance * u[k, a] * u[k, b]
        v = np.linalg.solve(normal, right)
        scale = max(squares / max(weights - 2, 1.0), 1.0)
    covariance = np.linalg.inv(normal)[:2, :2] * scale
    # With few inliers, or a small share of them, the fit may be to moving objects or multipath.
    share = inliers / count
    covariance *= 1 + (0.5 / max(share, 0.05)) ** 4 + (8 / max(inliers, 1)) ** 4
    return v[:2].copy(), covariance.copy(), inliers
