"""Odometry of a handheld walk through a room of point scatterers, and its parts against closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from radarize.io.errors import InputError
from radarize.io.pose import between, compose, exponential
from radarize.odometry.doppler import DopplerVelocity, Velocities
from radarize.odometry.integration import CORRELATION_TIME, Odometry, Track, VelocityConfig, VelocityFilter
from radarize.odometry.rotation import MapRotation, Rotations
from radarize.odometry.uncertainty import SCALE, ErrorModel
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Signal
from tests.batches import batch, of_spectrum
from tests.echoes import record
from tests.rooms import antenna_gain, furnished_room, walk

CONFIG = PRESETS["radarize"]
SIGNAL = Signal(CONFIG)


def classical(velocity=None, rotation=None) -> Odometry:
    """Odometry by least squares and a local map, or by the given estimators."""
    heatmaps = SIGNAL.heatmaps
    return Odometry(CONFIG, velocity or DopplerVelocity(heatmaps), rotation or MapRotation(heatmaps))


def steps(track: Track) -> np.ndarray:
    """Covariances of the motions from frame to frame."""
    return track.errors.motions(track.pose, np.arange(len(track.pose) - 1), 1)


@pytest.fixture(scope="module")
def walked():
    """A walk of 5 s: adc, stamps, true poses (x, y, yaw) at burst centres in the first one's frame."""
    rng = np.random.default_rng(2)
    points, amplitudes = furnished_room(rng, density=8.0)
    pose = walk(rng, 5.0)
    stamps = np.arange(0, 5.0, CONFIG.frame_period)
    adc = record(CONFIG, pose, points, amplitudes, stamps, rng, noise=20.0, block=16, gain=antenna_gain)
    position, yaw = pose(stamps + CONFIG.burst_center)
    c, s = np.cos(yaw[0]), np.sin(yaw[0])
    x, y = (position[:, :2] - position[0, :2]).T
    return adc, stamps, np.stack([c * x + s * y, c * y - s * x, yaw - yaw[0]], axis=1)


@pytest.fixture(scope="module")
def track(walked):
    adc, stamps, _ = walked
    odometry = classical()
    return [odometry.update(batch(SIGNAL, adc[i : i + 50], stamps[i : i + 50])) for i in range(0, len(adc), 50)]


def test_walk(walked, track):
    truth = walked[2]
    pose = np.concatenate([t.pose for t in track])
    distance = np.linalg.norm(np.diff(truth[:, :2], axis=0), axis=1).sum()
    turned = np.abs(np.diff(truth[:, 2])).sum()
    assert distance > 1.5 and turned > np.radians(50)
    assert np.linalg.norm(pose[:, :2] - truth[:, :2], axis=1).max() < 0.05 * distance
    error = np.degrees(pose[:, 2] - truth[:, 2])
    assert np.abs(error).max() < 5
    over = error[8:] - error[:-8]  # 0.27 s
    assert np.median(np.abs(over)) < 0.75 and np.sqrt((over**2).mean()) < 2


def test_covariance_of_steps(walked, track):
    truth = walked[2]
    step = np.concatenate([t.step for t in track])[1:]
    poses, errors = np.concatenate([t.pose for t in track]), ErrorModel.joined([t.errors for t in track])
    covariance = errors.motions(poses, np.arange(len(step)), 1)
    relative = np.diff(truth, axis=0)
    c, s = np.cos(truth[:-1, 2]), np.sin(truth[:-1, 2])
    x, y = relative[:, 0].copy(), relative[:, 1].copy()
    relative[:, 0], relative[:, 1] = c * x + s * y, c * y - s * x
    ratio = (step - relative) ** 2 / covariance[:, [0, 1, 2], [0, 1, 2]]
    assert (ratio.mean(axis=0) < 4).all()
    assert (ratio.mean(axis=0) > 0.02).all()


def test_batch_size_does_not_matter(walked, track):
    adc, stamps, _ = walked
    odometry = classical()
    parts = [odometry.update(batch(SIGNAL, adc[i : i + 7], stamps[i : i + 7])) for i in range(0, 42, 7)]
    np.testing.assert_allclose(np.concatenate([p.pose for p in parts]), track[0].pose[:42], atol=1e-4)


def test_standing_still_does_not_turn():
    rng = np.random.default_rng(3)
    points, amplitudes = furnished_room(rng, density=10.0)
    stamps = np.arange(20) * CONFIG.frame_period

    def still(t):
        return np.broadcast_to([3.0, 2.0, 0.0], (*t.shape, 3)), np.zeros(t.shape)

    adc = record(CONFIG, still, points, amplitudes, stamps, rng, 20.0, block=16, gain=antenna_gain)
    result = classical().update(batch(SIGNAL, adc, stamps))
    assert np.abs(result.pose[:, :2]).max() < 1e-3
    assert np.abs(np.degrees(result.pose[:, 2])).max() < 0.5  # of a map match; it does not add up


def test_turning_on_the_spot_either_way():
    rng = np.random.default_rng(3)
    points, amplitudes = furnished_room(rng, density=10.0)
    stamps = np.arange(25) * CONFIG.frame_period
    for rate in np.radians([60, -60]):

        def turning(t, rate=rate):
            return np.broadcast_to([3.0, 2.0, 0.0], (*t.shape, 3)), rate * t

        adc = record(CONFIG, turning, points, amplitudes, stamps, rng, 20.0, block=16, gain=antenna_gain)
        result = classical().update(batch(SIGNAL, adc, stamps))
        expected = rate * (stamps[-1] - stamps[0])
        assert result.pose[-1, 2] == pytest.approx(expected, rel=0.06)


def test_lost_frames_are_bridged(walked):
    adc, stamps, truth = walked
    adc, valid = adc[:80].copy(), np.ones((80, *CONFIG.frame_shape[:2]), bool)
    adc[40:43], valid[40:43] = 0, False
    adc[60, 10:20], valid[60, 10:20] = 0, False
    result = classical().update(batch(SIGNAL, adc, stamps[:80], valid))
    assert np.isfinite(result.pose).all() and np.isfinite(steps(result)).all()
    assert np.linalg.norm(result.pose[-1, :2] - truth[79, :2]) < 0.06
    turns = result.errors.turns(1)
    assert turns[39] > 2 * turns[38]  # frames 40 to 42 are no entries


def test_times_must_ascend(walked):
    adc, stamps, _ = walked
    odometry = classical()
    odometry.update(batch(SIGNAL, adc[:2], stamps[:2]))
    with pytest.raises(InputError, match="ascending"):
        odometry.update(batch(SIGNAL, adc[:2], stamps[:2]))


def test_estimators_can_be_swapped(walked):
    adc, stamps, _ = walked

    class Forward:
        lever = 0.0

        def estimate(self, batch):
            n, seen = len(batch), np.ones(len(batch), bool)
            return Velocities(np.tile([1.0, 0.0], (n, 1)), np.tile(1e-4 * np.eye(2), (n, 1, 1)), np.ones(n, int), seen)

    result = classical(velocity=Forward()).update(batch(SIGNAL, adc[:20], stamps[:20]))
    np.testing.assert_allclose(result.velocity[5:], np.tile([1.0, 0.0], (15, 1)), atol=0.02)


def test_a_circle_closes():
    pose, turns = np.zeros(3), 12
    for _ in range(turns):
        pose = compose(pose, exponential(np.array([0.3, 0.0]), 2 * np.pi / turns))
    np.testing.assert_allclose(pose, [0, 0, 0], atol=1e-12)
    radius = 0.3 * turns / (2 * np.pi)
    half = exponential(np.array([0.3 * turns / 2, 0.0]), np.pi)
    np.testing.assert_allclose(half[:2], [0, 2 * radius], atol=1e-12)
    np.testing.assert_allclose(exponential(np.array([0.3, 0.1]), 0.0), [0.3, 0.1, 0.0])


def test_filter_rejects_an_outlier_and_follows_a_step():
    times = np.arange(60) / 30
    truth = np.where(times < 1, 1.0, -0.5)
    velocity = np.stack([truth, np.zeros(60)], axis=1)
    velocity[15] = (-1.5, 2.0)
    measured = Velocities(velocity, np.tile(1e-4 * np.eye(2), (60, 1, 1)), np.full(60, 50), np.ones(60, bool))
    found = VelocityFilter().filter(times, measured).velocity
    assert np.abs(found[15] - velocity[14]).max() < 0.3
    np.testing.assert_allclose(found[-1], velocity[-1], atol=0.02)


def test_an_unobserved_turn_has_a_large_covariance():
    rng, stamps = np.random.default_rng(6), np.arange(31) * CONFIG.frame_period

    def nowhere(t):
        return np.zeros((*t.shape, 3)), np.zeros(t.shape)

    class ZeroRotation:
        def estimate(self, batch, velocities):
            return Rotations.independent(np.zeros(len(batch)), np.full(len(batch), 1e-8), np.ones(len(batch), bool))

    adc = record(CONFIG, nowhere, np.array([[2.0, 0.0, 0.0]]), np.zeros(1), stamps, rng, 20.0, block=16)
    result = classical(rotation=MapRotation(SIGNAL.heatmaps, prior=ZeroRotation())).update(batch(SIGNAL, adc, stamps))
    # People turn by 20 deg per second and more; and the input is noise, so some frames match by chance.
    assert np.sqrt(result.errors.turns(30)[0]) > np.radians(15)


class FixedEstimator:
    """Estimators with given results: a velocity straight ahead, a yaw rate."""

    lag = 0.2

    def __init__(self, speed=1.0, rate=0.0, lever=0.0, variance=1e-6):
        self.speed, self.rate, self.lever, self.variance, self.last = speed, rate, lever, variance, 0.0

    def velocity(self) -> "FixedEstimator":
        self.estimate = lambda batch: Velocities(
            np.tile([self.speed, 0.0], (len(batch), 1)),
            np.tile(self.variance * np.eye(2), (len(batch), 1, 1)),
            np.full(len(batch), 50),
            np.ones(len(batch), bool),
        )
        return self

    def rotation(self) -> "FixedEstimator":
        self.estimate = lambda batch, velocities: Rotations.independent(
            self.rate * np.diff(batch.stamps, prepend=batch.stamps[0]),
            np.full(len(batch), 1e-6),
            np.ones(len(batch), bool),
        )
        return self


def test_the_antennas_swing_about_the_origin():
    """Their midpoint is 1 cm to the left: at a yaw rate of 1.5 rad/s to the left it moves backward at 1.5 cm/s."""
    times = np.arange(60) * CONFIG.frame_period
    odometry = Odometry(CONFIG, FixedEstimator(1.0 - 0.015, lever=0.01).velocity(), FixedEstimator(rate=1.5).rotation())
    found = odometry.update(of_spectrum(SIGNAL, times, times))
    assert found.velocity[30:, 0] == pytest.approx(1.0, abs=1e-3)
    antennas = DopplerVelocity(SIGNAL.heatmaps).lever
    # Eight virtual antennas half a wavelength apart; each is the sum of the positions of a transmitter and a receiver.
    assert antennas == pytest.approx(3.5 * CONFIG.wavelength / 2 / 2, rel=0.05)


@pytest.mark.parametrize("period", [1 / 30, 0.1])
def test_correlated_errors_add_up_to_the_covariance(period):
    """Velocity errors of 1 cm/s (RMS) with the modelled correlation: positions over 2 s and more."""
    rng, size, frames = np.random.default_rng(3), 0.01, round(900 / period)
    kept = np.exp(-period / CORRELATION_TIME)
    drawn = np.sqrt(1 - kept**2) * rng.normal(size=(frames, 2))
    wrong = size * lfilter([1.0], [1.0, -kept], drawn, axis=0)
    estimator, heading = FixedEstimator(variance=size**2).velocity(), FixedEstimator().rotation()
    right = estimator.estimate
    estimator.estimate = lambda batch: replace(right(batch), velocity=right(batch).velocity + wrong)
    times = np.arange(frames) * period
    found = Odometry(CONFIG, estimator, heading).update(of_spectrum(SIGNAL, times, times))
    for span in (2.0, 10.0):
        each = round(span / period)
        ends = found.pose[::each, :2] - np.outer(times[::each], [1.0, 0.0])
        along = found.errors.motions(found.pose, np.arange(len(ends) - 1) * each, each)[:, 0, 0]
        along -= (SCALE * span) ** 2  # at 1 m/s; there is no error of scale or heading here
        assert np.mean(np.diff(ends, axis=0) ** 2 / along[:, None]) == pytest.approx(1, abs=0.3)


@pytest.mark.parametrize("gap", [0.2, 0.5, 1.0, 2.0])
def test_the_covariance_of_a_gap_depends_on_its_length(gap):
    """It agrees with the changes of speed of handheld walks; steps outside of the gap have the covariance of their
    velocities."""
    times = np.concatenate([np.arange(10) * CONFIG.frame_period, 9 * CONFIG.frame_period + gap * np.array([1.0])])
    found = Odometry(CONFIG, FixedEstimator().velocity(), FixedEstimator().rotation()).update(
        of_spectrum(SIGNAL, times, times)
    )
    spread = np.sqrt(np.insert(steps(found)[:, 0, 0], 0, 0.0))
    handheld = {0.2: 0.0015, 0.5: 0.018, 1.0: 0.072, 2.0: 0.263}
    assert spread[10] == pytest.approx(handheld[gap], rel=0.25)
    assert (spread[1:10] < 2e-4).all()


def test_an_uncertain_turn_makes_the_direction_uncertain():
    """A turn of 40 deg in a gap of 1 s, with a standard deviation of 6 deg: the covariance grows by the scatter of
    poses with other turns."""
    sigma, turn, draws = np.radians(6), np.radians(40), np.random.default_rng(7).normal(size=4000)
    found = []
    for spread in (0.0, sigma):
        turns = Rotations.independent(np.array([0, turn]), np.array([0, spread**2]), np.ones(2, bool))
        rotation = SimpleNamespace(lag=0.0, estimate=lambda *_, turns=turns: turns)
        times = np.array([0.0, 1.0])
        found.append(Odometry(CONFIG, FixedEstimator().velocity(), rotation).update(of_spectrum(SIGNAL, times, times)))
    otherwise = [exponential(np.array([1.0, 0.0]), turn + sigma * draw) for draw in draws]
    scatter = np.cov(np.stack([between(found[0].step[1], each) for each in otherwise]).T)
    assert np.abs(steps(found[1])[0] - steps(found[0])[0] - scatter).max() < 0.15 * scatter[1, 2]


@pytest.mark.parametrize("rate", [5, 15, 30])
def test_the_random_walk_of_velocity_does_not_depend_on_the_frame_rate(rate):
    count = rate + 1
    unobserved = np.arange(count) > 0
    covariance = np.where(unobserved, 1e9, 1e-6)[:, None, None] * np.eye(2)
    measured = Velocities(np.zeros((count, 2)), covariance, np.where(unobserved, 0, 50), ~unobserved)
    filtered = VelocityFilter().filter(np.arange(count) / rate, measured)
    assert filtered.covariance[-1, 0, 0] == pytest.approx(VelocityConfig().wander ** 2, rel=1e-3)
    assert (filtered.seen == ~unobserved).all()


@pytest.mark.parametrize("fastest", [0.5, 2.0, 6.0])
def test_the_prior_of_velocity_is_the_configured_one(fastest):
    """The first measurement, with the covariance of the prior, halves the variance."""
    measured = Velocities(np.array([[1.0, 0.0]]), fastest**2 * np.eye(2)[None], np.ones(1, int), np.ones(1, bool))
    found = VelocityFilter(VelocityConfig(fastest=fastest)).filter(np.zeros(1), measured)
    assert found.covariance[0] == pytest.approx(fastest**2 / 2 * np.eye(2))
    assert found.velocity[0] == pytest.approx([0.5, 0.0])


def test_rates_are_integrated_to_a_circle():
    """Constant speed and yaw rate over an uneven clock, in batches of any size; errors are those of the last step."""
    rng = np.random.default_rng(0)
    times = 7.0 + np.cumsum(rng.uniform(0.02, 0.05, 40))
    speed, yaw_rate = 0.8, 0.5
    rates, covariance = np.tile([speed, 0.0, yaw_rate], (40, 1)), np.tile(np.diag([0.04, 0.09, 0.01]), (40, 1, 1))
    parts, last = [], None
    for start, stop in ((0, 1), (1, 15), (15, 40)):
        last = Track.from_rates(times[start:stop], rates[start:stop], covariance[start:stop], last)
        parts.append(last)
    pose, turn = np.concatenate([part.pose for part in parts]), yaw_rate * (times - times[0])
    circle = speed / yaw_rate * np.column_stack([np.sin(turn), 1 - np.cos(turn)])
    assert pose == pytest.approx(np.column_stack([circle, turn]), abs=1e-9)
    found = ErrorModel.joined([part.errors for part in parts])
    assert (found.noise[0] == 0).all()
    assert found.noise[1:] == pytest.approx(np.diff(times)[:, None, None] ** 2 * covariance[1:])
    with pytest.raises(InputError, match="expected ascending times"):
        Track.from_rates(times[:5], rates[:5], covariance[:5], last)
