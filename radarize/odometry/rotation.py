"""Yaw from range-azimuth maps, by matching each frame against a sliding local map of the frames before it.

Pairs of frames force a choice: close together they measure every increment with the noise of one match, far apart they
lose their overlap in turns. A local map that forgets slowly has both spacings at once. Each frame is laid into the map
at a fan of yaws around the predicted one, each at the position to which the velocities then lead; the best correlation
marks its yaw, and the map is renewed there. As long as landmarks stay in view, errors do not accumulate.

What the map says joins what bearings of strong echoes and walls that are met again say (`radarize.odometry.bearings`)
in one filter: of the heading, its rate, the angle at which the map lies, and what of echoes and walls is not known.

Three things decide what a frame looks like to the matcher (`MapRotation.features`):

- A wall's specular flash is no landmark: it follows the foot of the perpendicular as the sensor passes. It is 40 dB
  above the wall's own texture, so the spectrum is limited per range-Doppler cell, and the streaks it leaves over range
  and azimuth are taken out by their medians.
- Capon's ridges are sharper than windowed sums by far, and so is the match.
- u_y = sin(azimuth) cos(elevation): what lies above and below seems nearer to the middle than it is. Elevations
  measured per cell are too unsure to help, and one factor for all sines (`RotationConfig.stretch`) gains nothing in
  furnished rooms.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Complex64, Float, Float32
from torch.nn.functional import avg_pool1d

from radarize.io.plain import Frozen, setting
from radarize.io.pose import compose
from radarize.odometry.bearings import YAW, Bearings
from radarize.odometry.doppler import Velocities
from radarize.odometry.echoes import Echo, Echoes
from radarize.odometry.localmap import LocalMap, View
from radarize.odometry.parabola import vertex
from radarize.odometry.smoother import Gaussian, wandered
from radarize.signal.batch import Batch
from radarize.signal.heatmaps import Heatmaps

#: Range and Doppler bins at most: what a frame takes is bounded for every chirp that the chip can send.
_RANGES, _SPEEDS = 256, 64
#: Half widths of the high-pass over range bins and azimuth columns.
_TEXTURE = (12, 12)
#: Of the predicted yaw's standard deviations, how many are searched to either side.
_SIGMAS = 3.0
#: Cells of a frame that speak independently of the others. Of those that the map knows, a correlation c is so much
#: likelier for a match than by chance: (1 - c^2)^(-cells / 2).
_INDEPENDENT = 50
#: rad; from this standard deviation on, the prediction says nothing of how the frame lies in the map.
_ASTRAY = np.radians(45.0)
#: rad^0.5: what a heading is off by that nothing takes back, for what it has turned: 0.6 degrees a quarter turn. A
#: sensor that stands or goes straight hardly drifts (chosen on the walks of `benchmark.choices.CLAIMS`).
_DRIFT = 0.0086
#: m to either side of a wall's flash, where it hides the rest.
_RING = 0.1
#: See `radarize.odometry.integration.RotationEstimator`, of those that do not know by how much they lag.
LAG = 0.2
#: `Rotations` of the first frame of all.
_FIRST = (0.0, 0.0, True, 1.0, 0.0)
#: Places in the filter of the turning rate, and of the angle at which the map lies.
_RATE, _MAP = 1, 2


@dataclass(frozen=True)
class Rotations:
    """Yaw increments, one per frame, from the burst centre of the frame before to this frame's.

    Their errors are those of `radarize.odometry.uncertainty.ErrorModel`: of the heading, which are corrected later, and
    noise that nothing corrects.

    Attributes:
        yaw: (frame,) rad, positive to the left; zero for the very first frame.
        noise: (frame,) rad^2, variance of what each turn adds.
        seen: (frame,) False where nothing was measured of it: the turn is what went before, or what a network makes of
            next to no echoes, which may be off by all that the sensor turned.
        correlation: (frame,) share of the heading's error before that goes on.
        variance: (frame,) rad^2, of the heading's error at the frame.
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
        """Turns whose errors are independent."""
        return cls(yaw, noise, seen, np.ones(len(yaw)), np.zeros(len(yaw)))


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
        "biases many consecutive matches", "rad", tuned="15 walks of 60 s (of BEARINGS)", gt=0
    )  # fmt: skip
    doubt: float = setting(
        4.0, "factor on the variance of a network's turn", "1",
        tuned="15 walks of 60 s (of BEARINGS), mean heading error 0.9 deg", ge=1
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

    The pose inside the local map is a running one: x, y from the velocities, yaw and turning rate from a filter whose
    rate is a random walk, which the matches correct; or, where another estimator says how far the sensor has turned,
    by that. Yaws are searched as far as the filter is unsure of its own; where it knows nothing, the map starts anew.

    Args:
        prior: estimator of turns, to start the search from.

    Attributes:
        lag: see `RotationEstimator`.
    """

    def __init__(
        self, heatmaps: Heatmaps, settings: RotationConfig | None = None, prior: "RotationEstimator | None" = None
    ):
        s = self.settings = settings or RotationConfig()
        self._sines = np.linspace(-s.field, s.field, s.columns)
        self._heatmaps = Heatmaps(heatmaps.config, np.arcsin(self._sines), heatmaps.settings)
        self._first = int(np.searchsorted(heatmaps.ranges, s.min_range))
        self._bearing_sines = s.stretch * self._sines  # sines of where the cells lie
        self._ranges = heatmaps.ranges[:_RANGES][self._first :]
        self._map = LocalMap(self._ranges[-1], s.cell)
        self._state = Gaussian(np.array([0.0, s.fastest**2, 0.0]))
        self._echoes, self._bearings = Echoes(heatmaps, self._first), Bearings(heatmaps, self._state, s.right_angles)
        self._noise, self.lag = (s.yaw_noise, LAG) if prior is None else (s.guided_yaw_noise, 0.0)
        self._time: float | None = None
        self._velocity = self._position = np.zeros(2)
        self._start = self._way = np.zeros(3)  # pose before the last step, on its mean heading, and the step
        self._prior = prior

    def features(
        self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]
    ) -> Float32[np.ndarray, "frame r a"]:
        """Contrast of the Capon map, dB over the surroundings."""
        s = self.settings
        limited = self._heatmaps.limited(_essence(spectrum[:, :_RANGES]), s.limit)
        capon = self._heatmaps.range_azimuth_of(limited, "capon")[:, self._first :]
        floor = capon.flatten(1).median(dim=1).values.clamp_min(1e-9)[:, None, None]
        level = 10 * torch.log10((capon / floor).clamp_min(1))
        level = level - level.median(dim=2, keepdim=True).values
        level = level - level.median(dim=1, keepdim=True).values
        level = level.clamp(0, s.contrast)
        surroundings = _box_mean(_box_mean(level, _TEXTURE[1]).mT, _TEXTURE[0]).mT
        return (level - surroundings).contiguous().numpy()

    def echoes(self, spectrum: Complex64[torch.Tensor, "frame range doppler antenna"]) -> list[list[Echo]]:
        """The strongest of each frame."""
        return [self._echoes.of(cells) for cells in spectrum[:, :_RANGES].numpy()]

    def estimate(self, batch: Batch, velocities: Velocities) -> Rotations:
        """Yaw increments of the next frames, given their velocities."""
        told = None if self._prior is None else self._doubted(self._prior.estimate(batch, velocities))
        turns = []
        shown = zip(self.features(batch.spectrum), self.echoes(batch.spectrum), strict=True)
        for i, (feature, echoes) in enumerate(shown):
            view = View(feature, self._ranges, self._bearing_sines)
            time, velocity = float(batch.centers[i]), velocities.velocity[i]
            dt = self.settings.memory if self._time is None else time - self._time
            if self._time is None:
                turns.append(_FIRST)
            else:
                turn = None if told is None else (told.yaw[i], told.noise[i])
                turns.append(self._turn(view, time, dt, velocity, turn, echoes))
            self._join(view, -np.expm1(-dt / self.settings.memory))
            self._time, self._velocity = time, velocity
        yaw, noise, seen, *lasting = np.array(turns, float).reshape(-1, len(_FIRST)).T
        return Rotations(yaw, noise, seen.astype(bool), *lasting)

    def _doubted(self, told: Rotations) -> Rotations:
        """What a network says; where frames are missing none has spoken, but what is known of how turning rates
        wander."""
        return replace(told, noise=np.where(told.seen, self.settings.doubt, 1.0) * told.noise)

    def _turn(
        self,
        view: View,
        time: float,
        dt: float,
        velocity: Float[np.ndarray, "2"],
        told: tuple[float, float] | None,
        echoes: list[Echo],
    ) -> tuple[float, float, bool, float, float]:
        """`Rotations` of a frame `dt` s after the last one."""
        state, mean = self._state, (self._velocity + velocity) / 2
        start, laid, known = state.mean[YAW], self._laid, state.covariance[YAW, YAW]
        state.remember(YAW)
        self._predict(dt, told)
        self._bearings.move(dt, mean)
        seen = self._bearings.see(time, echoes, velocity)
        self._start, self._way = np.array([*self._position, (laid + self._laid) / 2]), np.array([*(dt * mean), 0.0])
        self._position = self._seen_from(0.0)
        seen = self._match(view) or seen
        variance, turned = state.covariance[YAW, YAW], state.mean[YAW] - start
        drift = _DRIFT**2 * abs(turned) if seen else self.settings.unseen**2 * dt
        # The part of this error that the one before explains: regression of the filter's errors on each other.
        correlation = max(state.shared[YAW] / known, 0.0) if known > 0 else 1.0
        return turned, drift, seen, correlation, variance

    @property
    def _laid(self) -> float:
        """Yaw in the map."""
        return float(self._state.mean[YAW] - self._state.mean[_MAP])

    def _predict(self, dt: float, told: tuple[float, float] | None) -> None:
        """Yaw and rate `dt` s later: by the rate, or by what another estimator says of the turn and its variance."""
        state, known = self._state, self._state.covariance[YAW, YAW]
        if told is None:
            state.replace(YAW, state.row({YAW: 1.0, _RATE: dt}))
            state.covariance[: _RATE + 1, : _RATE + 1] += wandered(self.settings.wander, dt)
        else:
            state.mean[YAW] += told[0]
            state.covariance[YAW, YAW] += told[1]
        if state.covariance[YAW, YAW] - known > np.pi**2:  # any heading; larger numbers would only cost digits
            state.covariance[YAW], state.covariance[:, YAW] = 0.0, 0.0
            state.covariance[YAW, YAW] = known + np.pi**2

    def _join(self, view: View, share: float) -> None:
        """A frame joins the map, which then lies as far wrong as its frames do on average."""
        self._position = self._map.follow(self._position)
        self._map.blend(view, self._position, self._laid, share)
        lies = self._state.mean[_MAP]
        self._state.replace(_MAP, self._state.row({YAW: share, _MAP: 1 - share}))
        self._state.mean[_MAP] = lies  # where the frame was laid is no news

    def _match(self, view: View) -> bool:
        """Correct the filter by how the frame lies in the map, and say whether that is known."""
        for flash in self._bearings.flashes:  # no landmarks: they slide along walls as the sensor does
            view.feature[np.abs(self._ranges - flash) < _RING] = 0.0
        row = self._state.row({YAW: 1.0, _MAP: -1.0})
        spread = np.sqrt(max(self._state.variance(row), 0.0))
        if spread > _ASTRAY:
            self._map.forget()
            self._state.replace(_MAP, self._state.row({YAW: 1.0}))
            self._state.replace(_RATE, self._state.row({}))
            self._state.covariance[_RATE, _RATE] = self.settings.fastest**2
            return False
        offset, correlation = self._fit(view, spread)
        if correlation < self.settings.least_correlation:
            return False
        laid = self._laid
        self._state.update(row, offset, (self._noise / correlation) ** 2)
        self._position = self._seen_from(self._laid - laid)
        return True

    def _seen_from(self, offset: float | Float[np.ndarray, "offset"]) -> Float[np.ndarray, "*offset 2"]:
        """Position in the map if the yaw is off by so much: the way there was taken along the mean of the headings at
        both ends."""
        return compose(self._start + np.multiply.outer(offset, [0.0, 0.0, 0.5]), self._way)[..., :2]

    def _fit(self, view: View, spread: float) -> tuple[float, float]:
        """Offset (rad) of the yaw that fits the map best and is likely beforehand, and its correlation; 0 if there is
        none."""
        s = self.settings
        fan = np.clip(_SIGMAS * spread, s.fan, s.widest)

        def correlate(offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return self._map.correlate(view, self._seen_from(offsets), self._laid + offsets)

        coarse = 3 * s.step * np.arange(-np.ceil(fan / (3 * s.step)), np.ceil(fan / (3 * s.step)) + 1)
        correlation, overlap = correlate(coarse)
        odds = -_INDEPENDENT * overlap / 2 * np.log1p(-(np.clip(correlation, 0, 0.999) ** 2))
        fine = coarse[np.argmax(odds - (coarse * _SIGMAS / fan) ** 2 / 2)] + s.step * np.arange(-4, 5)
        correlation, _ = correlate(fine)
        best = int(np.argmax(correlation))
        if not 0 < best < len(fine) - 1:
            return 0.0, 0.0
        left, peak, right = correlation[best - 1 : best + 2]
        return float(fine[best] + s.step * np.clip(vertex(left, peak, right), -1, 1)), float(peak)


def _essence(spectrum: torch.Tensor) -> torch.Tensor:
    """Of so many neighbouring Doppler bins that few enough are left, the strongest at each range."""
    together = -(-spectrum.shape[2] // _SPEEDS)
    if together == 1:
        return spectrum
    count = spectrum.shape[2] // together
    groups = spectrum[:, :, : count * together].unflatten(2, (count, together))
    few = torch.view_as_real(groups[..., :4].contiguous())  # all antennas see much the same power
    strongest = few.square().sum(dim=(-1, -2)).argmax(dim=3)[..., None, None]
    return groups.take_along_dim(strongest, dim=3).squeeze(3)


def _box_mean(values: torch.Tensor, half: int) -> torch.Tensor:
    """Mean over the 2 half + 1 neighbours along the last axis, fewer at the ends."""
    return avg_pool1d(values, 2 * half + 1, stride=1, padding=half, count_include_pad=False)
