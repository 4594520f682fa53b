"""Ego-velocity from the Doppler shifts of a static world: the classical odometry that networks must beat.

An echo from unit direction u of a static world closes at v . u, v being the sensor's velocity. Echoes are peaks of a
burst's range-Doppler-azimuth cube. Their u_y comes from the azimuth row, their u_z from the phase between the elevation
pairs, so that ceiling and floor, which close more slowly than the wall below them, fit the same model. RANSAC rejects
people, ghosts and aliased echoes; reweighted least squares refines and yields the covariance (after Doer and
Trommer, "An EKF based approach to radar inertial odometry", 2020: REVE).

Regressors with errors bend a fit. An echo that reads u_z = 0 comes from a little above and below, so its u_x is less
than the reading says, and v comes out short: by 0.8 % in offices, 2.5 % between bare walls. So each echo brings the
variance of its own u_z along, told by the coherence of the elevation pairs as in interferometry, and the fit regresses
on the expected direction (regression calibration: Carroll, Ruppert, Stefanski, Crainiceanu, "Measurement error in
nonlinear models", 2006, ch. 4),

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
    """Sensor velocities, one per frame, at the frames' burst centres.

    Attributes:
        velocity: (frame, 2) m/s, sensor frame (x forward, y left).
        covariance: (frame, 2, 2) (m/s)^2; large where the echoes do not determine a velocity.
        inliers: (frame,) echoes that agree with the velocity.
        seen: (frame,) False where nothing determines a velocity, and what is given here is as good as none.
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
    inlier: float = setting(0.15, "maximum residual of an inlier in RANSAC", "m/s", gt=0)
    hypotheses: int = setting(200, "pairs of echoes that RANSAC tries", "pairs", ge=1)
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
        32.0, "inliers at which the covariance of the fit is doubled; with fewer it grows further, because a larger "
        "share of them has come over several surfaces", "echoes", tuned="12 walks of 60 s (FURNISHED)", ge=0
    )  # fmt: skip
    scale_noise: float = setting(
        0.003, "standard deviation of the error along the velocity that all echoes of a frame share (elevation), as "
        "a fraction of speed", "1", tuned="6 walks of 20 s (ODOMETRY)", ge=0
    )  # fmt: skip
    course_noise: float = setting(
        0.0065, "standard deviation of the error across the velocity that all echoes of a frame share (azimuth)",
        "rad", tuned="6 walks of 20 s (ODOMETRY)", ge=0
    )  # fmt: skip
    rough: float = setting(
        0.06, "standard deviation of the shared error along and across the velocity, as a fraction of speed, for "
        "arrays that do not measure elevation; twice that for azimuth rows of fewer than 8 antennas", "1", tuned="2 "
        "walks of 20 s with one and two transmitters and with two other boards (RADARS)", ge=0
    )  # fmt: skip
    floor: float = setting(0.0005, "minimum standard deviation of a velocity", "m/s", ge=0)


class DopplerVelocity:
    """Velocity estimator by robust least squares over Doppler peaks; stateless between frames.

    Speeds beyond `config.max_velocity` are as `Batch.aliases` has them. Residuals are taken modulo the unambiguous
    span, so where nothing tells aliases, a faster walk is still found from the echoes to the side.

    Attributes:
        lever: m, see `VelocityEstimator`.
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
        # An echo's phase turns with its way to the transmitter and back to the receiver: it is the middle that moves.
        self.lever = float(virtual_positions(self.config).reshape(-1, 3)[self.row, 1].mean()) / 2
        self._first = int(np.searchsorted(heatmaps.ranges, self.settings.min_range))
        flat, short = self.pairs is None, len(self.row) < ROW
        self._rough = self.settings.rough * (2 if short else 1 if flat else 0)
        # One table of random numbers for all frames: the same frame gives the same answer in any batch.
        self._draws = np.random.default_rng(0).random((self.settings.hypotheses, 2))

    def estimate(self, batch: Batch) -> Velocities:
        """Velocities of the next frames."""
        spectrum = batch.spectrum
        power = self._heatmaps.beamformed(spectrum, self.row, self._steering).numpy()
        frames = zip(spectrum.numpy(), power, batch.aliases, strict=True)
        found = [self.solve(self._echoes(*frame)) for frame in frames]
        velocity, covariance, inliers = map(np.array, zip(*found, strict=True))
        seen = (np.linalg.eigvalsh(covariance)[:, -1] < _DETERMINED**2) & (inliers >= _ECHOES)
        doubt = 1 + (self.settings.few / inliers[seen]) ** 4
        covariance[seen] = doubt[:, None, None] * covariance[seen] + self._shared(velocity[seen])
        return Velocities(velocity, covariance, inliers, seen)

    def _shared(self, velocity: Float[np.ndarray, "frame 2"]) -> Float[np.ndarray, "frame 2 2"]:
        """Covariance of the errors that all echoes of a frame have in common: none of the fit's residuals tells."""
        s = self.settings
        across = np.stack([-velocity[:, 1], velocity[:, 0]], axis=1)
        along, side = (v[:, :, None] * v[:, None] for v in (velocity, across))
        scale, course = (noise**2 + self._rough**2 for noise in (s.scale_noise, s.course_noise))
        return scale * along + course * side + s.floor**2 * np.eye(2)

    def echoes(self, spectrum: Complex64[torch.Tensor, "range doppler antenna"]) -> Float[np.ndarray, "echo 6"]:
        """Peaks of one frame: range bin, closing speed (m/s), u_y, u_z and its variance, power over the median."""
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
        """Velocity (2,) m/s, its covariance (2, 2) and the number of agreeing echoes, by a frame's `echoes`."""
        s = self.settings
        # Without elevation pairs no echo tells of the climb.
        climb = s.climb if self.pairs is not None else 1e-3
        noise = np.array([s.speed_noise, s.power_noise, s.azimuth_noise, s.elevation, climb])
        # Of a single echo, too, in the layout that the loop is compiled for.
        seen = np.ascontiguousarray(echoes[:, 1:])
        velocity, covariance, inliers = _fit(seen, self._draws, noise, s.inlier, 2 * self.config.max_velocity)
        if inliers and np.hypot(*velocity) < s.still and np.median(np.abs(echoes[:, 1])) < 2 * s.still:
            if velocity @ np.linalg.solve(covariance, velocity) < _SIGMAS**2:
                velocity = np.zeros(2)
        return velocity, covariance, inliers


class _Array(NamedTuple):
    """What `_refine` knows of the radar: direction cosines of beams and speeds of bins, with the bins' width (m/s);
    antennas of the elevation pairs and their height / wavelength; per antenna y / wavelength and TDM phase per speed
    (rad s/m)."""

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


#: m/s, what nobody walks: keeps the fit regular where all echoes come from one direction.
UNKNOWN_SPEED = 10.0
#: Fewer echoes than these determine no velocity; nor do those that leave a standard deviation, m/s, as large as that.
_ECHOES, _DETERMINED = 4, 0.3
#: Standard deviations from which a velocity is not zero: a walk that sets in is slow, but its speed is well known.
_SIGMAS = 3.0
#: A weaker peak beside a stronger one of the same range and Doppler may be its sidelobe (-25 dB, and mismatch).
SIDELOBE = 0.1


@njit(cache=True)
def _peaks(power, threshold, first):
    """Local maxima of the cube (range, doppler cyclic, beam) above a threshold, as index triples."""
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
def _between(left, middle, right):
    """Offset in bins of a peak, by three powers."""
    return vertex(np.log(left + 1e-30), np.log(middle + 1e-30), np.log(right + 1e-30))


@njit(cache=True)
def _refine(found, power, cells, array, beam):
    """Echoes between bins: (range bin, speed, u_y, u_z, variance of u_z, power)."""
    u, velocities, bin_width, pairs, height, y, tdm = array
    echoes = np.empty((len(found), 6))
    bins = power.shape[1]
    for i in range(len(found)):
        r, d, b = found[i]
        p = power[r, d, b]
        speed_offset = bin_width * _between(power[r, (d - 1) % bins, b], p, power[r, (d + 1) % bins, b])
        u_y = u[b] + (u[1] - u[0]) * _between(power[r, d, b - 1], p, power[r, d, b + 1])
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
            # Echoes spread by s in u_z keep a coherence of exp(-(2 pi height s)^2 / 2) between the two heights; what
            # differs in power does not belong together either.
            coherence = min(max(2 * abs(upper * lower) / (len(pairs) * total), 1e-6), 1 - 1e-6)
            apart = -2 * np.log(coherence) / (2 * np.pi * height) ** 2
            spread = apart * beam**2 / (apart + beam**2)
        limit = 0.98 * np.sqrt(max(1 - u_y * u_y, 0.0))
        u_z = min(max(u_z, -limit), limit)
        echoes[i, 0], echoes[i, 4], echoes[i, 5] = r, spread, p
        echoes[i, 1], echoes[i, 2], echoes[i, 3] = velocities[d] + speed_offset, u_y, u_z
    return echoes


@njit(cache=True)
def _wrap(residual, span):
    return residual - span * np.rint(residual / span)


@njit(cache=True)
def _fit(echoes, draws, noise, inlier, span):
    """RANSAC over pairs of echoes, then iteratively reweighted least squares for (vx, vy, vz)."""
    count = len(echoes)
    unknown = np.array([[1.0, 0.0], [0.0, 1.0]])
    if count < _ECHOES:
        return np.zeros(2), unknown, 0
    speed, spread, power = echoes[:, 0], echoes[:, 3], echoes[:, 4]
    speed_noise, power_noise, azimuth_noise, elevation, climb = noise
    u = np.empty((count, 3))
    u[:, 1], u[:, 2] = echoes[:, 1], echoes[:, 2] * elevation**2 / (elevation**2 + spread)
    u[:, 0] = np.sqrt(np.maximum(1 - u[:, 1] ** 2 - u[:, 2] ** 2 - spread, 0.02))

    limit = max(1.5 * span / 2, 1.2 * np.abs(speed).max())
    best, score = np.zeros(2), -1.0
    for h in range(len(draws) + 1):
        v = np.zeros(2)  # the first hypothesis is standing still
        if h:
            i, j = int(draws[h - 1, 0] * count), int(draws[h - 1, 1] * count)
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
        # RANSAC's result is rough: weights sharpen step by step, or a few strong echoes would hold the fit there.
        rough = (0.5 * inlier * 0.5**iteration) ** 2
        for k in range(count):
            # u_x is not measured but follows from u_y and u_z, and so do their errors. The reading of u_z is a mean
            # over the elevation pairs; what it leaves of u_z^2 is distributed like the square of a Gaussian.
            by_y = v[1] - v[0] * u[k, 1] / u[k, 0]
            by_z = v[2] - v[0] * u[k, 2] / u[k, 0]
            variance = rough + speed_noise**2 + power_noise**2 / power[k] + (by_y * azimuth_noise) ** 2
            variance += 0.5 * spread[k] * (by_z**2 + spread[k] * (v[0] / u[k, 0]) ** 2)
            predicted = v[0] * u[k, 0] + v[1] * u[k, 1] + v[2] * u[k, 2]
            e = _wrap(speed[k] - predicted, span)
            z = e * e / variance
            w = 1 / (1 + z / 9) ** 2  # Geman-McClure: an outlier loses all say
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
    # Few agreeing echoes, or few of all: the fit may be to something else altogether.
    share = inliers / count
    covariance *= 1 + (0.5 / max(share, 0.05)) ** 4 + (8 / max(inliers, 1)) ** 4
    return v[:2].copy(), covariance.copy(), inliers
