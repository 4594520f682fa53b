"""Yaw from range-azimuth maps, by matching each frame against a sliding local map of the frames before it.

Pairs of frames force a choice: close together they measure every increment with the noise of one match, far apart they
lose their overlap in turns. A local map that forgets slowly has both spacings at once. Each frame is laid into the map
at the position that the velocities predict, at a fan of yaws around the predicted one; the best correlation
marks its yaw, and the map is renewed there. As long as landmarks stay in view, errors do not accumulate.

Three things decide what a frame looks like to the matcher (`MapRotation.features`):

- A wall's specular flash is no landmark: it follows the foot of the perpendicular as the sensor passes. It is 40 dB
  above the wall's own texture, so the spectrum is limited per range-Doppler cell, and the streaks it leaves over range
  and azimuth are taken out by their medians.
- Capon's ridges are sharper than windowed sums by far, and so is the match.
- u_y = sin(azimuth) cos(elevation): echoes from above and below turn by less than the sensor does. Cells are placed
  by ground range and true azimuth with the elevation that the antenna pairs measure, or turns come out 2-4 % short.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Complex64, Float, Float32
from numba import njit
from torch.nn.functional import avg_pool1d

from radarize.batch import Batch
from radarize.heatmaps import Heatmaps
from radarize.odometry.doppler import Velocities


@dataclass(frozen=True)
class Rotations:
    """Yaw increments, one per frame, from the burst centre of the frame before to this frame's.

    Attributes:
        yaw: (frame,) rad, positive to the left; zero for the very first frame.
        variance: (frame,) rad^2.
        correlation: (frame,) of the match, -1...1; zero for the very first frame.
    """

    yaw: Float[np.ndarray, "frame"]
    variance: Float[np.ndarray, "frame"]
    correlation: Float[np.ndarray, "frame"]


@dataclass(frozen=True)
class RotationSettings:
    """Settings of `MapRotation`.

    Attributes:
        field: largest |sin azimuth| used.
        columns: azimuth columns, uniform in sin azimuth.
        min_range: m; nearer bins are leakage.
        limit: power over the noise floor at which a range-Doppler cell is limited.
        contrast: dB over the surroundings at which a map cell is clipped.
        texture: half widths of the high-pass over range bins and azimuth columns.
        cell: m, side of a map cell.
        memory: frames over which the map forgets.
        fan, step: rad, half width and spacing of the yaws tried around the prediction.
        jerk: rad/s, standard deviation of the change of turning rate from frame to frame.
        yaw_noise: rad, standard deviation of a match at full correlation.
        least_correlation: a match below it is not believed: turning is taken to go on as before, or as the prior says.
        unseen: rad/s^0.5, by how much yaw may wander where no match is believed, beside what the filter or the prior
            says: what is not seen turning is missed for a second or more, and steps are claimed as independent.
    """

    field: float = 0.85
    columns: int = 69
    min_range: float = 0.2
    limit: float = 300.0
    contrast: float = 15.0
    texture: tuple[int, int] = (12, 12)
    cell: float = 0.05
    memory: int = 20
    fan: float = np.radians(5.0)
    step: float = np.radians(0.5)
    jerk: float = np.radians(12.0)
    yaw_noise: float = np.radians(0.3)
    least_correlation: float = 0.15
    unseen: float = np.radians(20.0)


class MapRotation:
    """Rotation estimator with a local map; frames are pushed in order, in batches of any size.

    The pose inside the local map is a running one: x, y from the velocities, yaw and turning rate from a filter with a
    constant rate, which the matches correct; or, where another estimator says how far the sensor has turned, by that.

    Args:
        heatmaps: of the radar.
        settings: of the matcher.
        prior: estimator of turns, to start the search from.
    """

    def __init__(
        self, heatmaps: Heatmaps, settings: RotationSettings | None = None, prior: "RotationEstimator | None" = None
    ):
        s = self.settings = settings or RotationSettings()
        sines = np.linspace(-s.field, s.field, s.columns)
        self._sines = sines
        self._heatmaps = Heatmaps(heatmaps.config, np.arcsin(sines), heatmaps.settings)
        self._first = int(np.searchsorted(heatmaps.ranges, s.min_range))
        self._ranges = heatmaps.ranges[self._first :]
        side = 2 * int((self._ranges[-1] + 2.0) / s.cell)
        self._map = np.zeros((2, side, side), np.float32)  # mean, count
        self._offsets = np.arange(-round(s.fan / s.step), round(s.fan / s.step) + 1) * s.step
        self._state: tuple | None = None  # time, velocity
        self._position = np.zeros(2)
        self._heading = np.zeros(2)  # yaw, rate
        self._spread = np.diag([0.0, 1.0])
        self._prior = prior

    def features(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> tuple[Float32[np.ndarray, "frame r a"], Float32[np.ndarray, "frame r a"]]:
        """Contrast of the Capon map, dB over the surroundings, and u_z (shrunk to the horizon where incoherent)."""
        s = self.settings
        limited = self._heatmaps.limited(spectrum, s.limit)
        capon = self._heatmaps.range_azimuth_of(limited, "capon")[:, self._first :]
        floor = capon.flatten(1).median(dim=1).values.clamp_min(1e-9)[:, None, None]
        level = 10 * torch.log10((capon / floor).clamp_min(1))
        level = level - level.median(dim=2, keepdim=True).values
        level = level - level.median(dim=1, keepdim=True).values
        level = level.clamp(0, s.contrast)
        surroundings = _box_mean(_box_mean(level, s.texture[1]).mT, s.texture[0]).mT
        return (level - surroundings).contiguous().numpy(), self._elevation(spectrum).numpy()

    def _elevation(self, spectrum: torch.Tensor) -> torch.Tensor:
        if self._heatmaps.pairs is None:
            return torch.zeros(len(spectrum), len(self._ranges), self.settings.columns)
        u_z, coherence = self._heatmaps.elevation_of(spectrum[:, self._first :])
        limit = torch.as_tensor(0.9 * np.cos(self._heatmaps.azimuths), dtype=u_z.dtype)
        return torch.clamp(u_z, -limit, limit) * coherence

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations:
        """Yaw increments of the next frames, given their velocities."""
        prior = None if self._prior is None else self._prior.estimate(batch, velocities)
        result = np.zeros((3, len(batch)))
        for i, (feature, u_z) in enumerate(zip(*self.features(batch.spectrum), strict=True)):
            turn = None if prior is None else (prior.yaw[i], prior.variance[i])
            result[:, i] = self._push(feature, u_z, float(batch.centers[i]), velocities.velocity[i], turn)
        return Rotations(*result)

    def _push(
        self,
        feature: np.ndarray,
        u_z: np.ndarray,
        time: float,
        velocity: np.ndarray,
        turn: tuple[float, float] | None,
    ) -> tuple[float, float, float]:
        s = self.settings
        if self._state is None:
            self._renew(feature, u_z, time, velocity)
            return 0.0, 0.0, 0.0
        before, last_velocity = self._state
        dt = time - before
        transition = np.array([[1.0, dt], [0.0, 1.0]])
        start = self._heading[0]
        if turn is None:
            self._heading = transition @ self._heading
            change = (s.jerk * dt / 0.033) ** 2 * np.array([[dt**2 / 4, dt / 2], [dt / 2, 1]])
            self._spread = transition @ self._spread @ transition.T + change
        else:
            self._heading = np.array([start + turn[0], turn[0] / dt])
            self._spread = np.diag([self._spread[0, 0] + turn[1], turn[1] / dt**2])
        middle = (start + self._heading[0]) / 2
        c, d = np.cos(middle), np.sin(middle)
        self._position += dt * np.array([[c, -d], [d, c]]) @ ((last_velocity + velocity) / 2)

        yaws = self._heading[0] + self._offsets
        correlation = _correlate(feature, u_z, self._ranges, self._sines, *self._map, *self._position, yaws, s.cell)
        offset, noise, peak, believed = self._peak(correlation)
        gain = self._spread[:, 0] / (self._spread[0, 0] + noise)
        self._heading = self._heading + gain * offset
        self._spread = self._spread - np.outer(gain, self._spread[0])
        self._renew(feature, u_z, time, velocity)
        # The spread is that of the yaw in the map. Half of it cancels in the sum of steps: the next frame, matched with
        # the same map, takes it back.
        spread = self._spread[0, 0]
        return self._heading[0] - start, spread / 2 if believed else spread + s.unseen**2 * dt, peak

    def _peak(self, correlation: np.ndarray) -> tuple[float, float, float, bool]:
        """Yaw offset (rad) of the best match, its variance and height; if it is not believed, the variance is large."""
        s = self.settings
        best = int(np.argmax(correlation))
        peak = float(correlation[best])
        if not 0 < best < len(correlation) - 1 or peak < s.least_correlation:
            return 0.0, (2 * s.fan) ** 2, peak, False
        left, right = correlation[best - 1], correlation[best + 1]
        bend = left - 2 * peak + right
        slip = 0.5 * (left - right) / bend if bend < -1e-9 else 0.0
        return float(self._offsets[best] + s.step * np.clip(slip, -1, 1)), (s.yaw_noise / peak) ** 2, peak, True

    def _renew(self, feature: np.ndarray, u_z: np.ndarray, time: float, velocity: np.ndarray) -> None:
        """Blend the frame into the map at the current pose, keeping the sensor in the map's middle metre."""
        s = self.settings
        shift = np.rint(self._position / s.cell).astype(int)
        if np.abs(shift).max() * s.cell > 1.0:
            self._map = _shifted(self._map, -shift)
            self._position = self._position - shift * s.cell
        spacing = self._ranges[1] - self._ranges[0]
        pose = (*self._position, self._heading[0])
        if feature.any():  # a frame lost as a whole has nothing to say
            _blend(feature, u_z, self._ranges[0], spacing, s.field, *self._map, *pose, s.cell, 1 / s.memory)
        self._state = (time, np.asarray(velocity, float))


def _box_mean(values: torch.Tensor, half: int) -> torch.Tensor:
    """Mean over the 2 half + 1 neighbours along the last axis, fewer at the ends."""
    return avg_pool1d(values, 2 * half + 1, stride=1, padding=half, count_include_pad=False)


def _shifted(grid: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """Grid moved by whole cells, zeros coming in."""
    moved = np.zeros_like(grid)
    source, target = [slice(None)], [slice(None)]
    for step, size in zip(shift, grid.shape[1:], strict=True):
        source.append(slice(max(-step, 0), size - max(step, 0)))
        target.append(slice(max(step, 0), size - max(-step, 0)))
    moved[tuple(target)] = grid[tuple(source)]
    return moved


@njit(cache=True, fastmath=True)
def _correlate(feature, u_z, ranges, sines, mean, count, x, y, yaws, cell):
    """Normalised correlation of a polar map with the grid map, seen from (x, y) at each yaw; cells weigh by area."""
    side = mean.shape[0]
    result = np.zeros(len(yaws))
    origin_x, origin_y = x / cell + side / 2, y / cell + side / 2
    ahead, left = np.empty(feature.shape, np.float32), np.empty(feature.shape, np.float32)
    for i in range(len(ranges)):
        for j in range(len(sines)):
            ahead[i, j] = ranges[i] / cell * np.sqrt(max(1 - sines[j] ** 2 - u_z[i, j] ** 2, 0.0))
            left[i, j] = ranges[i] / cell * sines[j]
    for k in range(len(yaws)):
        c, s = np.cos(yaws[k]), np.sin(yaws[k])
        n = sum_f = sum_m = sum_ff = sum_mm = sum_fm = 0.0
        for i in range(len(ranges)):
            w = ranges[i]
            for j in range(len(sines)):
                at_x, at_y = origin_x + c * ahead[i, j] - s * left[i, j], origin_y + s * ahead[i, j] + c * left[i, j]
                ix, iy = int(at_x), int(at_y)
                if ix < 0 or iy < 0 or ix >= side - 1 or iy >= side - 1:
                    continue
                if min(count[ix, iy], count[ix + 1, iy], count[ix, iy + 1], count[ix + 1, iy + 1]) <= 0:
                    continue
                u, v = at_x - ix, at_y - iy
                m = (mean[ix, iy] * (1 - u) + mean[ix + 1, iy] * u) * (1 - v)
                m += (mean[ix, iy + 1] * (1 - u) + mean[ix + 1, iy + 1] * u) * v
                f = feature[i, j]
                n += w
                sum_f += w * f
                sum_m += w * m
                sum_ff += w * f * f
                sum_mm += w * m * m
                sum_fm += w * f * m
        if n > 0:
            f_var, m_var = sum_ff - sum_f * sum_f / n, sum_mm - sum_m * sum_m / n
            result[k] = (sum_fm - sum_f * sum_m / n) / np.sqrt(max(f_var * m_var, 1e-12))
    return result


@njit(cache=True, fastmath=True)
def _blend(feature, u_z, nearest, spacing, field, mean, count, x, y, yaw, cell, least):
    """Running mean of polar maps on the grid; a cell's newest value weighs 1/count, but no less than `least`."""
    side, (rows, columns) = mean.shape[0], feature.shape
    c, s = np.cos(yaw), np.sin(yaw)
    reach = int((nearest + spacing * rows) / cell) + 1
    middle_x, middle_y = int(x / cell + side / 2), int(y / cell + side / 2)
    for ix in range(max(0, middle_x - reach), min(side, middle_x + reach)):
        for iy in range(max(0, middle_y - reach), min(side, middle_y + reach)):
            dx, dy = (ix - side / 2) * cell - x, (iy - side / 2) * cell - y
            ahead, left = c * dx + s * dy, c * dy - s * dx
            ground = np.sqrt(dx * dx + dy * dy)
            if ahead <= 0:
                continue
            # Which polar cell lies over this spot depends on its elevation: look at the horizon first, then there.
            flat = 1.0
            for look in range(2):
                i = (ground / flat - nearest) / spacing
                j = (left / ground * flat + field) / (2 * field) * (columns - 1)
                if i < 0 or j < 0 or i >= rows - 1 or j >= columns - 1:
                    break
                if look == 0:
                    flat = np.sqrt(1 - u_z[int(i + 0.5), int(j + 0.5)] ** 2)
            else:
                a, b = int(i), int(j)
                u, v = i - a, j - b
                f = (feature[a, b] * (1 - v) + feature[a, b + 1] * v) * (1 - u)
                f += (feature[a + 1, b] * (1 - v) + feature[a + 1, b + 1] * v) * u
                count[ix, iy] += 1
                mean[ix, iy] += max(1 / count[ix, iy], least) * (f - mean[ix, iy])
