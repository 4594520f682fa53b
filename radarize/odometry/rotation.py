"""Yaw from range-azimuth maps: each frame is matched with a local map that accumulates the previous frames.

Matching pairs of frames forces a choice of their spacing: pairs of consecutive frames add the noise of one match per
frame, and pairs far apart lose their overlap in turns. A local map with exponential forgetting has the advantages of
both. Each frame is correlated with the map at a fan of yaws around the prediction. The position for each yaw follows
from the velocities. The frame is blended into the map at the yaw with the highest correlation. As long as landmarks
stay in view, errors do not accumulate.

One filter fuses this match with the bearings of strong echoes and with wall directions that are observed again
(`radarize.odometry.bearings`). Its states are the heading, the yaw rate, the yaw error of the map, and the unknowns of
tracked echoes and walls.

`MapRotation.features` computes the input of the match:

- A wall's specular reflection is no landmark: it is at the foot of the perpendicular, which moves along the wall with
  the sensor. It is 40 dB above the wall's texture, so the power per range-Doppler cell is limited, and the streaks that
  it leaves over range and azimuth are removed by subtracting medians.
- Capon's beamformer has a narrower main lobe than the windowed sum, and yields sharper matches.
- As u_y = sin(azimuth) cos(elevation), echoes from above and below appear nearer to boresight. Measured elevations per
  cell are too noisy to correct this. A common factor for all sines (`RotationConfig.stretch`) gains nothing in
  furnished rooms.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Float32
from torch.nn.functional import avg_pool1d

from radarize.io.plain import Frozen, setting
from radarize.io.pose import compose
from radarize.odometry.bearings import YAW, BearingTracker
from radarize.odometry.doppler import Velocities
from radarize.odometry.echoes import Echo, Echoes
from radarize.odometry.localmap import LocalMap, View
from radarize.odometry.parabola import vertex
from radarize.odometry.smoother import Gaussian, random_walk_covariance
from radarize.signal.batch import Batch
from radarize.signal.heatmaps import Heatmaps

#: Maximum number of range and Doppler bins: it bounds the computing time of a frame for every chirp configuration.
_MAX_RANGES, _MAX_DOPPLER_BINS = 256, 64
#: Half widths of the high-pass filter, in range bins and azimuth columns.
_TEXTURE = (12, 12)
#: Half width of the search, in standard deviations of the predicted yaw.
_SIGMAS = 3.0
#: Number of independent cells of a frame. For those that the map covers, the likelihood ratio of a match with
#: correlation c to a match by chance is (1 - c^2)^(-cells / 2).
_INDEPENDENT_CELLS = 50
#: Maximum standard deviation of the predicted yaw relative to the map, rad; above it the map is discarded.
_MAX_MAP_YAW_STD = np.radians(45.0)
#: Heading drift that is never corrected, rad per root rad of turning (rad^0.5): 0.6 deg per quarter turn. A sensor that
#: stands or goes straight hardly drifts (chosen on the tuning set for covariances,
#: `radarize.evaluation.benchmark.choices`).
_DRIFT = 0.0086
#: Distance from a wall's specular reflection within which it masks other echoes, m.
_SPECULAR_WIDTH = 0.1
#: `RotationEstimator.lag` of estimators that do not estimate it.
LAG = 0.2
#: Fields of `Rotations` for the first frame of a recording.
_FIRST_FRAME = (0.0, 0.0, True, 1.0, 0.0)
#: Indices of the yaw rate and of the yaw error of the map in the state of the filter.
_RATE, _MAP = 1, 2


@dataclass(frozen=True)
class Rotations:
    """Yaw increments, one per frame, from the burst centre of the previous frame to this frame's.

    Their errors follow `radarize.odometry.uncertainty.ErrorModel`: an error of the heading, which later measurements
    correct, and noise that is never corrected.

    Attributes:
        yaw: (frame,) rad, positive to the left; zero for the very first frame.
        noise: (frame,) rad^2, variance of the noise that each increment adds.
        seen: (frame,) False where the yaw increment is unobservable: it is then a prediction, or the output of a
            network without usable input.
        correlation: (frame,) share of the previous heading error that persists.
        variance: (frame,) rad^2, variance of the heading error at the frame.
    """

    yaw: Float[np.ndarray, "frame"]
    noise: Float[np.ndarray, "frame"]
    seen: Bool[np.ndarray, "frame"]
    correlation: Float[np.ndarray, "frame"]
    variance: Float[np.ndarray, "frame"]

    @classmethod
    def independent(
        cls, yaw: Float[np.ndarray, "frame"], noise: Float[np.ndarray, "frame"], seen: Bool[np.ndarray, "frame"]
    ) -> "Rotations":
        """Yaw increments with independent errors."""
        return cls(yaw, noise, seen, np.ones(len(yaw)), np.zeros(len(yaw)))


class RotationEstimator(Protocol):
    """Estimator of the yaw increments from frame to frame, given the filtered velocities.

    Attributes:
        lag: standard deviation of the scale error of a yaw increment, as a share of it. An estimate that lags in a turn
            lags in all of its frames, so these errors add up, to 6 deg in a turn of 90 deg.
    """

    lag: float

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations: ...


class RotationConfig(Frozen):
    """Rotation by matching frames with a local map (`MapRotation`)."""

    field: float = setting(0.85, "maximum |sin azimuth| that is used", "1", gt=0, lt=1)
    columns: int = setting(69, "azimuth columns, uniform in sin azimuth", "columns", ge=8)
    min_range: float = setting(0.2, "minimum range; nearer bins are transmitter leakage", "m", ge=0)
    limit: float = setting(300.0, "power over the noise floor at which a range-Doppler cell is clipped", "1", gt=0)
    stretch: float = setting(
        1.0, "factor applied to measured sin azimuth; `radarize calibrate` measures it where the spacing of the "
        "antennas differs from the board's file", "1", tuned="8 furnished walks of 20 s (seeds 701 to 708): mean "
        "ATE of SLAM is 0.056 m with 1.0 and 0.090 m with 1.025", ge=1, lt=1.1
    )  # fmt: skip
    contrast: float = setting(15.0, "level over the surroundings at which a map cell is clipped", "dB", gt=0)
    cell: float = setting(0.05, "side of a map cell", "m", gt=0)
    memory: float = setting(
        1.6, "time constant with which the map forgets", "s", tuned="7 walks of 20 to 60 s (TURNS)", gt=0
    )
    fan: float = setting(np.radians(5.0), "minimum half-width of the search over yaw", "rad", gt=0)
    widest: float = setting(np.radians(75.0), "maximum half-width of the search over yaw", "rad", gt=0, le=np.pi)
    step: float = setting(
        np.radians(0.5), "step of the search over yaw; the coarse search takes three times that", "rad", gt=0
    )
    wander: float = setting(
        np.radians(66.0), "random-walk density of the turn rate of a handheld radar", "rad/s^1.5", gt=0
    )
    fastest: float = setting(np.radians(60.0), "standard deviation of an unknown turn rate", "rad/s", gt=0)
    yaw_noise: float = setting(
        np.radians(0.3), "standard deviation of the yaw of a match with correlation 1", "rad", gt=0
    )
    guided_yaw_noise: float = setting(
        np.radians(1.6), "the same where a network estimates turns too; larger, because a map that lags in a turn "
        "biases many consecutive matches", "rad", tuned="4 handheld walks of 60 s (of FURNISHED)", gt=0
    )  # fmt: skip
    doubt: float = setting(
        3.0, "factor on the variance of a network's turn", "1",
        tuned="4 handheld walks of 60 s (of FURNISHED), heading error over 10 s of 4.4 deg", ge=1
    )  # fmt: skip
    least_correlation: float = setting(0.15, "minimum correlation of an accepted match", "1", ge=0, lt=1)
    right_angles: bool = setting(
        True, "correct the heading by wall directions, assuming that most walls of a building are at right angles; "
        "false for other buildings"
    )  # fmt: skip
    unseen: float = setting(
        np.radians(40.0), "random-walk density of the yaw where neither matches nor bearings observe it, added to "
        "that of the filter", "rad/s^0.5", ge=0
    )  # fmt: skip


class MapRotation:
    """Rotation estimator with a local map; frames are pushed in order, in batches of any size.

    The position in the map is integrated from the velocities. Yaw and yaw rate are states of a filter: the rate is a
    random walk, and matches are measurements of the yaw. If a prior estimator is given, its yaw increments replace the
    prediction by the rate. The search width follows the covariance of the filter. Where the yaw is unobservable, the
    map is discarded.

    Args:
        prior: estimator of yaw increments, used as the prediction.

    Attributes:
        lag: see `RotationEstimator`.
    """

    def __init__(
        self, heatmaps: Heatmaps, settings: RotationConfig | None = None, prior: RotationEstimator | None = None
    ):
        s = self.settings = settings or RotationConfig()
        self._sines = np.linspace(-s.field, s.field, s.columns)
        self._heatmaps = Heatmaps(heatmaps.config, np.arcsin(self._sines), heatmaps.settings)
        self._first = int(np.searchsorted(heatmaps.ranges, s.min_range))
        self._bearing_sines = s.stretch * self._sines  # true sines of azimuth of the columns
        self._ranges = heatmaps.ranges[:_MAX_RANGES][self._first :]
        self._map = LocalMap(self._ranges[-1], s.cell)
        self._state = Gaussian(np.array([0.0, s.fastest**2, 0.0]))
        self._echoes = Echoes(heatmaps, self._first)
        self._bearings = BearingTracker(heatmaps, self._state, s.right_angles)
        self._noise, self.lag = (s.yaw_noise, LAG) if prior is None else (s.guided_yaw_noise, 0.0)
        self._time: float | None = None
        self._velocity = self._position = np.zeros(2)
        # The last step, and the pose before it, with the mean heading of the step.
        self._step_start = self._step_motion = np.zeros(3)
        self._prior = prior

    def features(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float32[np.ndarray, "frame r a"]:
        """Return the contrast of the Capon map, dB over the surroundings."""
        s = self.settings
        limited = self._heatmaps.limited(_reduce_doppler(spectrum[:, :_MAX_RANGES]), s.limit)
        capon = self._heatmaps.range_azimuth_of(limited, "capon")[:, self._first :]
        floor = capon.flatten(1).median(dim=1).values.clamp_min(1e-9)[:, None, None]
        level = 10 * torch.log10((capon / floor).clamp_min(1))
        level = level - level.median(dim=2, keepdim=True).values
        level = level - level.median(dim=1, keepdim=True).values
        level = level.clamp(0, s.contrast)
        surroundings = _box_mean(_box_mean(level, _TEXTURE[1]).mT, _TEXTURE[0]).mT
        return (level - surroundings).contiguous().numpy()

    def echoes(self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]) -> list[list[Echo]]:
        """Return the strongest echoes of each frame."""
        return [self._echoes.of(cells) for cells in spectrum[:, :_MAX_RANGES].numpy()]

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations:
        """Return the yaw increments of the next frames, given their velocities."""
        prior = None if self._prior is None else self._inflated(self._prior.estimate(batch, velocities))
        turns = []
        shown = zip(self.features(batch.spectrum), self.echoes(batch.spectrum), strict=True)
        for i, (feature, echoes) in enumerate(shown):
            view = View(feature, self._ranges, self._bearing_sines)
            time, velocity = float(batch.centers[i]), velocities.velocity[i]
            dt = self.settings.memory if self._time is None else time - self._time
            if self._time is None:
                turns.append(_FIRST_FRAME)
            else:
                turn = None if prior is None else (prior.yaw[i], prior.noise[i])
                turns.append(self._step(view, time, dt, velocity, turn, echoes))
            self._blend(view, -np.expm1(-dt / self.settings.memory))
            self._time, self._velocity = time, velocity
        yaw, noise, seen, *heading_error = np.array(turns, float).reshape(-1, len(_FIRST_FRAME)).T
        return Rotations(yaw, noise, seen.astype(bool), *heading_error)

    def _inflated(self, prior: Rotations) -> Rotations:
        """Rotations of the network with inflated variance. Frames without network output keep the variance of the
        random walk."""
        return replace(prior, noise=np.where(prior.seen, self.settings.doubt, 1.0) * prior.noise)

    def _step(
        self,
        view: View,
        time: float,
        dt: float,
        velocity: Float[np.ndarray, "2"],
        prior: tuple[float, float] | None,
        echoes: list[Echo],
    ) -> tuple[float, float, bool, float, float]:
        """Fields of `Rotations` for a frame `dt` s after the previous one."""
        state, mean = self._state, (self._velocity + velocity) / 2
        start, previous_yaw, before = state.mean[YAW], self._map_yaw, state.covariance[YAW, YAW]
        state.remember(YAW)
        self._predict(dt, prior)
        self._bearings.predict(dt, mean)
        seen = self._bearings.update(time, echoes, velocity)
        self._step_start = np.array([*self._position, (previous_yaw + self._map_yaw) / 2])
        self._step_motion = np.array([*(dt * mean), 0.0])
        self._position = self._position_at(0.0)
        seen = self._match(view) or seen
        variance, turned = state.covariance[YAW, YAW], state.mean[YAW] - start
        drift = _DRIFT**2 * abs(turned) if seen else self.settings.unseen**2 * dt
        # Share of the heading error that the previous one explains: regression of the errors of the filter.
        correlation = max(state.cross_covariance[YAW] / before, 0.0) if before > 0 else 1.0
        return turned, drift, seen, correlation, variance

    @property
    def _map_yaw(self) -> float:
        """Yaw relative to the map, rad."""
        return float(self._state.mean[YAW] - self._state.mean[_MAP])

    def _predict(self, dt: float, prior: tuple[float, float] | None) -> None:
        """Predict yaw and rate `dt` s later, by the rate or by a prior yaw increment and its variance."""
        state, known = self._state, self._state.covariance[YAW, YAW]
        if prior is None:
            state.replace(YAW, state.row({YAW: 1.0, _RATE: dt}))
            state.covariance[: _RATE + 1, : _RATE + 1] += random_walk_covariance(self.settings.wander, dt)
        else:
            state.mean[YAW] += prior[0]
            state.covariance[YAW, YAW] += prior[1]
        if state.covariance[YAW, YAW] - known > np.pi**2:  # unobservable; a larger variance only loses precision
            state.covariance[YAW], state.covariance[:, YAW] = 0.0, 0.0
            state.covariance[YAW, YAW] = known + np.pi**2

    def _blend(self, view: View, share: float) -> None:
        """Blend a frame into the map. The yaw error of the map becomes the weighted mean of its frames' errors."""
        self._position = self._map.recenter(self._position)
        self._map.blend(view, self._position, self._map_yaw, share)
        map_yaw = self._state.mean[_MAP]
        self._state.replace(_MAP, self._state.row({YAW: share, _MAP: 1 - share}))
        self._state.mean[_MAP] = map_yaw  # blending is no measurement of the map yaw

    def _match(self, view: View) -> bool:
        """Correct the filter by the match of the frame with the map; False if no match is accepted."""
        for distance in self._bearings.specular_ranges:  # no landmarks: they move along walls with the sensor
            view.feature[np.abs(self._ranges - distance) < _SPECULAR_WIDTH] = 0.0
        row = self._state.row({YAW: 1.0, _MAP: -1.0})
        spread = np.sqrt(max(self._state.variance(row), 0.0))
        if spread > _MAX_MAP_YAW_STD:
            self._map.forget()
            self._state.replace(_MAP, self._state.row({YAW: 1.0}))
            self._state.replace(_RATE, self._state.row({}))
            self._state.covariance[_RATE, _RATE] = self.settings.fastest**2
            return False
        offset, correlation = self._fit(view, spread)
        if correlation < self.settings.least_correlation:
            return False
        previous_yaw = self._map_yaw
        self._state.update(row, offset, (self._noise / correlation) ** 2)
        self._position = self._position_at(self._map_yaw - previous_yaw)
        return True

    def _position_at(self, offset: float | Float[np.ndarray, "offset"]) -> Float[np.ndarray, "*offset 2"]:
        """Position in the map if the yaw differs by an offset (rad): the last step was taken along the mean of the
        headings at both ends."""
        return compose(self._step_start + np.multiply.outer(offset, [0.0, 0.0, 0.5]), self._step_motion)[..., :2]

    def _fit(self, view: View, spread: float) -> tuple[float, float]:
        """Yaw offset (rad) with the highest posterior and its correlation; correlation 0 if the search finds no
        peak."""
        s = self.settings
        fan = np.clip(_SIGMAS * spread, s.fan, s.widest)

        def correlate(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self._map.correlate(view, self._position_at(offsets), self._map_yaw + offsets)

        coarse = 3 * s.step * np.arange(-np.ceil(fan / (3 * s.step)), np.ceil(fan / (3 * s.step)) + 1)
        correlation, overlap = correlate(coarse)
        log_likelihood = -_INDEPENDENT_CELLS * overlap / 2 * np.log1p(-(np.clip(correlation, 0, 0.999) ** 2))
        fine = coarse[np.argmax(log_likelihood - (coarse * _SIGMAS / fan) ** 2 / 2)] + s.step * np.arange(-4, 5)
        correlation, _ = correlate(fine)
        best = int(np.argmax(correlation))
        if not 0 < best < len(fine) - 1:
            return 0.0, 0.0
        left, peak, right = correlation[best - 1 : best + 2]
        return float(fine[best] + s.step * np.clip(vertex(left, peak, right), -1, 1)), float(peak)


def _reduce_doppler(spectrum: torch.Tensor) -> torch.Tensor:
    """Reduce the Doppler axis to at most `_MAX_DOPPLER_BINS`: the strongest of each group of neighbouring bins, per
    range."""
    group = -(-spectrum.shape[2] // _MAX_DOPPLER_BINS)
    if group == 1:
        return spectrum
    count = spectrum.shape[2] // group
    groups = spectrum[:, :, : count * group].unflatten(2, (count, group))
    subset = torch.view_as_real(groups[..., :4].contiguous())  # power is nearly equal at all antennas
    strongest = subset.square().sum(dim=(-1, -2)).argmax(dim=3)[..., None, None]
    return groups.take_along_dim(strongest, dim=3).squeeze(3)


def _box_mean(values: torch.Tensor, half: int) -> torch.Tensor:
    """Mean over the 2 half + 1 neighbours along the last axis, fewer at the ends."""
    return avg_pool1d(values, 2 * half + 1, stride=1, padding=half, count_include_pad=False)
