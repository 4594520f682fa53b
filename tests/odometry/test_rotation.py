"""Yaw from a local map, in a world with a known texture: the features of a frame are computed without a radar."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from radarize.io.pose import wrap
from radarize.odometry.bearings import YAW
from radarize.odometry.doppler import Velocities
from radarize.odometry.localmap import LocalMap, View
from radarize.odometry.rotation import MapRotation, RotationConfig, Rotations
from radarize.odometry.uncertainty import ErrorModel
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Signal
from tests.batches import of_spectrum

CONFIG = PRESETS["radarize"]
SIGNAL = Signal(CONFIG)
CELL = 0.05
#: Ratio of true to measured sines of azimuth.
SHORT = 1.025
WORLD = gaussian_filter(np.random.default_rng(0).normal(size=(400, 400)), 2.5, mode="wrap")
WORLD = np.clip(WORLD / WORLD.std() - 1, 0, None)


def see(rotation: MapRotation, poses: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Features of frames at poses (x, y, yaw), half of them noise, for an array that measures sines too small."""
    bearing = np.arcsin(SHORT * rotation._sines) + poses[:, None, None, 2]
    x = poses[:, None, None, 0] + rotation._ranges[:, None] * np.cos(bearing)
    y = poses[:, None, None, 1] + rotation._ranges[:, None] * np.sin(bearing)
    seen = map_coordinates(WORLD, [x / CELL + 200, y / CELL + 200], order=1, mode="grid-wrap")
    noise = gaussian_filter(rng.normal(size=seen.shape), (0, 1, 1))
    seen = seen + noise * WORLD.std() / noise.std()
    return (seen - seen.mean()).astype(np.float32)


def follow(times: np.ndarray, poses: np.ndarray, prior=None, settings=None) -> Rotations:
    """Rotations that `MapRotation` estimates for frames at true poses, given the true velocities."""
    rotation = MapRotation(SIGNAL.heatmaps, settings or RotationConfig(stretch=SHORT), prior)
    rotation.features = lambda poses: see(rotation, poses, np.random.default_rng(1))
    rotation.echoes = lambda poses: [[]] * len(poses)
    velocity = np.gradient(poses[:, :2], times, axis=0)
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    velocity = np.stack([cos * velocity[:, 0] + sin * velocity[:, 1], cos * velocity[:, 1] - sin * velocity[:, 0]], 1)
    count = len(times)
    known = Velocities(velocity, np.tile(1e-4 * np.eye(2), (count, 1, 1)), np.full(count, 50), np.ones(count, bool))
    return rotation.estimate(of_spectrum(SIGNAL, poses, times - CONFIG.burst_center), known)


def sightless(settings=None, prior=None) -> MapRotation:
    """`MapRotation` whose frames are empty."""
    rotation = MapRotation(SIGNAL.heatmaps, settings, prior)
    shape = len(rotation._ranges), len(rotation._sines)
    rotation.features = lambda frames: np.zeros((len(frames), *shape), np.float32)
    rotation.echoes = lambda frames: [[]] * len(frames)
    return rotation


def standing(frames: int) -> Velocities:
    """Velocities of a sensor that is known not to move."""
    return Velocities(
        np.zeros((frames, 2)), np.tile(1e-4 * np.eye(2), (frames, 1, 1)), np.full(frames, 50), np.ones(frames, bool)
    )


@pytest.mark.parametrize("rate", [5, 10, 15, 30])
def test_swinging_to_and_fro_at_any_frame_rate(rate):
    """40 deg to either side at 0.4 Hz: up to 20 deg between frames at 5 Hz, and up to 100 deg/s."""
    times = np.arange(0, 7.5, 1 / rate)
    yaw = np.radians(40) * np.sin(2 * np.pi * 0.4 * times)
    poses = np.stack([0.3 * times, np.zeros(len(times)), yaw], axis=1)
    found = follow(times, poses)
    error = np.cumsum(found.yaw) - (yaw - yaw[0])
    assert np.degrees(np.sqrt((error**2).mean())) < 1.5
    assert found.seen.mean() > 0.95


def test_an_array_that_reads_bearings_too_small_turns_as_far():
    times = np.arange(0, 6, 1 / 30)
    yaw = np.radians(60) * times
    poses = np.stack([np.zeros(len(times)), np.zeros(len(times)), yaw], axis=1)
    turned = [follow(times, poses, settings=RotationConfig(stretch=s)).yaw.sum() / yaw[-1] for s in (SHORT, 1.0)]
    assert turned[0] == pytest.approx(1, abs=0.004) and turned[1] < 0.987


def errors_of(found: Rotations) -> ErrorModel:
    """Error model of rotations alone."""
    frames = len(found.yaw)
    yaw, heading = np.diag([0.0, 0.0, 1.0]), np.diag([1.0, 0.0, 0.0])
    noise, variance = found.noise[:, None, None] * yaw, found.variance[:, None, None] * heading
    return ErrorModel(np.full(frames, 1 / 30), noise, np.column_stack([found.correlation, np.zeros(frames)]), variance)


@pytest.mark.parametrize("seconds", [15, 86_400])
def test_a_gap_of_seconds_discards_the_map(seconds):
    """At 1.2 m/s the predicted position is 18 m from a map of 6 m: it is discarded, and the rotation is
    unobservable."""
    times = np.concatenate([np.arange(15), np.arange(15) + 15 + 30 * seconds]) / 30
    found = follow(times, np.stack([1.2 * times, np.zeros(30), np.zeros(30)], axis=1))
    assert not found.seen[15] and np.sqrt(errors_of(found).turns(1)[14]) > np.radians(90)
    after = slice(17, None)
    assert found.seen[after].all()
    assert np.degrees(np.abs(np.cumsum(found.yaw[after]))).max() < 1.5


@pytest.mark.parametrize("rate", np.radians([0, 40, -70]))
def test_a_second_lost_while_turning(rate):
    """The search width in the frame after the gap follows the covariance of the yaw, and the match is found."""
    times = np.concatenate([np.arange(30), np.arange(30) + 60]) / 30
    found = follow(times, np.stack([np.zeros(60), np.zeros(60), rate * times], axis=1))
    turned = found.yaw[30:33].sum()
    assert np.degrees(wrap(turned - rate * (times[32] - times[29]))) == pytest.approx(0, abs=3)


class UncertainPrior:
    """Prior that has no information on the yaw increment of one frame, and is correct for all others."""

    def __init__(self, turns: np.ndarray, lost: int):
        self.turns, self.lost = turns.copy(), lost
        self.turns[lost] = 0.0

    def estimate(self, batch, velocities) -> Rotations:
        at = np.arange(len(batch)) == self.lost
        return Rotations.independent(self.turns, np.where(at, np.radians(20) ** 2, 1e-5), ~at)


def test_the_search_width_follows_the_prior():
    times, turn = np.arange(40) / 30, np.full(40, np.radians(1.0))
    turn[20] = np.radians(35)  # standard deviation of the prior: 20 deg
    yaw = np.cumsum(turn)
    found = follow(times, np.stack([np.zeros(40), np.zeros(40), yaw], axis=1), UncertainPrior(turn, 20))
    assert np.degrees(found.yaw[20]) == pytest.approx(35, abs=1.5)
    assert found.seen[20] and errors_of(found).turns(1)[19] < np.radians(5) ** 2


@pytest.mark.parametrize("off", np.radians([-30, 0, 30]))
def test_a_second_lost_in_a_bend(off):
    """The rotation in the gap is unknown, and so is the direction of travel: 30 deg correspond to 0.26 m. There is no
    network output whose variance would be inflated."""
    times, rate, speed = np.concatenate([np.arange(30), np.arange(30) + 60]) / 30, np.radians(50), 1.0
    yaw = rate * times
    poses = np.stack([speed / rate * np.sin(yaw), speed / rate * (1 - np.cos(yaw)), yaw], axis=1)
    turn, variances, seen = np.diff(yaw, prepend=0.0), np.full(60, 1e-5), np.ones(60, bool)
    turn[30], variances[30], seen[30] = turn[30] + off, np.radians(41) ** 2, False
    found = follow(times, poses, SimpleNamespace(estimate=lambda *_: Rotations.independent(turn, variances, seen)))
    assert np.degrees(found.yaw[30:33].sum() - (yaw[32] - yaw[29])) == pytest.approx(0, abs=2)
    assert found.seen[30] and errors_of(found).turns(1)[29] < np.radians(5) ** 2


@pytest.mark.parametrize("rate", [5, 15, 30])
def test_the_variance_of_an_unobserved_second_does_not_depend_on_the_frame_rate(rate):
    rotation, count = sightless(), rate + 1
    nothing = Velocities(
        np.zeros((count, 2)), np.tile(np.eye(2), (count, 1, 1)), np.zeros(count, int), np.zeros(count, bool)
    )
    rotation._state.covariance[1, 1] = np.radians(5) ** 2
    found = rotation.estimate(of_spectrum(SIGNAL, np.arange(count), np.arange(count) / rate), nothing)
    s = rotation.settings
    assert not found.seen[1:].any()
    (variance,) = errors_of(found).turns(count - 1)
    assert variance == pytest.approx(np.radians(5) ** 2 + s.wander**2 / 3 + s.unseen**2, rel=1e-6)


def test_network_output_for_empty_frames_is_no_observation():
    """Its output for empty frames has a small variance; `seen` is False nevertheless."""
    rotation = sightless(prior=UncertainPrior(np.zeros(31), 0))
    found = rotation.estimate(of_spectrum(SIGNAL, np.arange(31), np.arange(31) / 30), standing(31))
    assert not found.seen[1:].any()
    assert np.sqrt(errors_of(found).turns(30)[0]) > rotation.settings.unseen


@pytest.mark.parametrize("rate", [10, 30])
def test_drift_grows_with_rotation(rate):
    """The uncorrected drift is 0.6 deg per quarter turn and 1.2 deg per whole turn, at any frame rate."""
    times = np.arange(0, 6, 1 / rate)
    drifts = []
    for turning in np.radians([0, 60]):
        found = follow(times, np.stack([np.zeros(len(times)), np.zeros(len(times)), turning * times], axis=1))
        assert found.seen.all()
        drifts.append(np.degrees(np.sqrt(found.noise.sum())))
    assert drifts[0] < 0.3 and drifts[1] == pytest.approx(1.23, rel=0.05)


def test_the_variance_covers_corrections():
    """A wall observes the heading every third of a second. The yaw increment there contains the correction of all drift
    since then; its variance has to cover that."""
    rng, frames, noise = np.random.default_rng(5), 1500, np.radians(0.5)
    settings = RotationConfig(unseen=0)
    drift = np.radians(1.0) * rng.normal(size=frames)
    variances = np.full(frames, np.radians(1.0) ** 2 / settings.doubt)
    prior = SimpleNamespace(estimate=lambda *_: Rotations.independent(drift, variances, np.ones(frames, bool)))
    rotation = sightless(settings, prior)
    state, count = rotation._state, iter(range(1, frames))

    def see(*_) -> bool:
        if there := next(count) % 10 == 0:
            state.update(state.row({YAW: 1.0}), noise * rng.normal() - state.mean[YAW], noise**2)
        return there

    rotation._bearings.update = see
    found = rotation.estimate(of_spectrum(SIGNAL, np.arange(frames), np.arange(frames) / 30), standing(frames))
    observed = found.seen & (np.arange(frames) > 0)  # the radar never turned
    assert observed.sum() == 149
    errors = errors_of(found)
    steps = errors.turns(1)
    assert np.mean(found.yaw[observed] ** 2 / steps[observed[1:]]) == pytest.approx(1, abs=0.25)
    # The error of a rotation over any time is the difference of the heading errors at its ends.
    heading = np.cumsum(found.yaw)
    for length in (1, 5, 40):
        starts = np.arange(100, frames - length)
        variances = errors.turns(length)[starts]
        assert np.mean((heading[starts + length] - heading[starts]) ** 2 / variances) == pytest.approx(1, abs=0.2)
    assert variances.mean() < steps[199:239].sum() / 4


def test_a_map_that_is_left_behind_is_empty():
    rng = np.random.default_rng(3)
    ranges, sines = np.arange(0.2, 4, 0.045), np.linspace(-0.85, 0.85, 69)
    feature = rng.normal(size=(len(ranges), len(sines))).astype(np.float32)
    view = View(feature, ranges, sines)
    grid, yaws = LocalMap(4.0, CELL), np.zeros(1)
    grid.blend(view, np.zeros(2), 0.0, 0.05)
    assert grid.correlate(view, np.zeros((1, 2)), yaws)[0][0] > 0.5
    near = grid.recenter(np.array([1.5, 0.0]))
    assert np.abs(near).max() < CELL
    assert grid.correlate(view, near[None] - [1.5, 0.0], yaws)[0][0] > 0.5
    for far in ([18.0, 0.0], [-6.0, 400.0], [0.0, -11.9]):
        place = grid.recenter(np.array(far))
        assert np.abs(place).max() < CELL
        assert grid.correlate(view, place[None], yaws)[0][0] == 0
        grid.blend(view, place, 0.0, 0.05)
        assert grid.correlate(view, place[None], yaws)[0][0] > 0.5


def test_a_corner_of_the_map_that_fits_by_chance_is_no_match():
    """At an error of half a turn only a few cells overlap: their correlation is not significant."""
    times = np.concatenate([np.arange(30), np.arange(30) + 60]) / 30
    yaw = np.radians(np.concatenate([75 * times[:30], 75 * times[29] + 40 + 20 * (times[30:] - times[30])]))
    found = follow(times, np.stack([np.zeros(60), np.zeros(60), yaw], axis=1))
    assert np.degrees(found.yaw[30]) == pytest.approx(40, abs=3)


def test_what_a_frame_takes_does_not_grow_with_how_far_the_radar_sees():
    """The size of the map is bounded, also for a chirp with a range of 170 m."""
    for reach in (4.3, 170.0, 5000.0):
        side = len(LocalMap(reach, CELL)._grid.mean)
        cell = LocalMap(reach, CELL)._grid.cell
        assert side <= 640 and side * cell / 2 >= reach and (cell == CELL or reach > 10)
