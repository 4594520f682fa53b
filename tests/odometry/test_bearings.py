"""Heading from the bearings of walls and point scatterers, with a prior rotation that has errors."""

import numpy as np
import pytest
import torch

from radarize.odometry.bearings import YAW, BearingTracker
from radarize.odometry.doppler import Velocities
from radarize.odometry.echoes import Echo, Echoes
from radarize.odometry.rotation import MapRotation, RotationConfig, Rotations
from radarize.odometry.smoother import Gaussian
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Signal
from radarize.signal.heatmaps import Heatmaps
from tests.batches import of_spectrum

CONFIG, FIRST = PRESETS["radarize"], 5
DT, COUNT = CONFIG.frame_period, 150
MAPS = Heatmaps(CONFIG)
#: Number of states of the filter that the caller owns.
OWN = 3
#: Standard deviation of the prior yaw increments, rad per frame.
PRIOR_STD = np.radians(0.3)


class World:
    """Vertical walls, as lines n . p = d with the specular reflection at the foot of the perpendicular, and point
    scatterers."""

    def __init__(self, walls=(), posts=()):
        self.walls, self.posts = walls, posts

    def seen(self, place, yaw, velocity, rng):
        """Echoes within 60 deg and 6 m, with errors of 0.1 deg and 1 mm, nearest first."""
        ways = [(distance - np.dot(normal, place)) * np.asarray(normal) for normal, distance in self.walls]
        ways += [np.asarray(post) - place for post in self.posts]
        found = []
        for way in ways:
            away, bearing = np.hypot(*way), np.arctan2(way[1], way[0]) - yaw
            bearing = (bearing + np.pi) % (2 * np.pi) - np.pi + rng.normal(0, np.radians(0.1))
            closing = velocity[0] * np.cos(bearing) + velocity[1] * np.sin(bearing)
            if abs(bearing) < np.radians(60) and away < 6:
                found.append(Echo(away + rng.normal(0, 0.001), closing, bearing))
        return sorted(found)


def normal(degrees):
    return np.cos(np.radians(degrees)), np.sin(np.radians(degrees))


def track(world, places, yaws, increments, seed=1, gap=(0.0, 0.0), right_angles=True):
    """Return the heading by the prior increments and the bearings, its standard deviation, and the `BearingTracker`;
    there are no echoes between the times `gap`, s."""
    rng, state = np.random.default_rng(seed), Gaussian(np.zeros(OWN))
    bearings, found, deviations = BearingTracker(MAPS, state, right_angles), np.zeros(len(yaws)), np.zeros(len(yaws))
    velocities = np.gradient(places, DT, axis=0)
    cos, sin = np.cos(yaws), np.sin(yaws)
    velocities = np.stack(
        [cos * velocities[:, 0] + sin * velocities[:, 1], cos * velocities[:, 1] - sin * velocities[:, 0]], 1
    )
    for k, (place, yaw, velocity) in enumerate(zip(places, yaws, velocities, strict=True)):
        if k:
            state.mean[YAW] += increments[k - 1]
            state.covariance[YAW, YAW] += PRIOR_STD**2
            bearings.predict(DT, (velocity + velocities[k - 1]) / 2)
        echoes = world.seen(place, yaw, velocity, rng)
        bearings.update(k * DT, [] if gap[0] <= k * DT < gap[1] else echoes, velocity)
        found[k], deviations[k] = state.mean[YAW], np.sqrt(state.covariance[YAW, YAW])
    return found, deviations, bearings


def slide():
    """Poses of a walk along a wall 1.3 m ahead, at 0.7 m/s with a slow start; the heading oscillates by 15 deg."""
    time = DT * np.arange(COUNT)
    along = np.cumsum(0.7 * np.clip(time - 0.5, 0, 1)) * DT
    return np.stack([np.zeros(COUNT), along], axis=1), np.radians(15) * np.sin(time)


def wrong(places, yaw):
    """Yaw increments that are correct at first, and later take a third of the translation for rotation."""
    late = np.clip(DT * np.arange(1, COUNT) - 2.5, 0, 1)
    return np.diff(yaw) + late * np.diff(places[:, 1]) / 1.3 / 3


@pytest.mark.parametrize("kind", [0, 1])
def test_a_classified_echo_corrects_the_heading(kind):
    """A single wall or point scatterer: it is classified while the prior is correct, and corrects the heading when the
    prior has errors."""
    places, yaw = slide()
    world = World(posts=[(1.3, 1.0)]) if kind else World(walls=[(normal(0), 1.3)])
    increments = wrong(places, yaw)
    found, deviations, bearings = track(world, places, yaw, increments)
    assert abs(increments.sum() - (yaw[-1] - yaw[0])) > np.radians(15)
    # The range of a scatterer, and so its parallax, has an error of a few percent.
    assert np.abs(found - yaw).max() < np.radians((2, 6)[kind])
    assert abs(found[-1] - yaw[-1]) < 3 * deviations[-1] and deviations[-1] < np.radians(4)
    assert [each.kind for each in bearings._tracked] == [kind]
    assert bool(bearings.specular_ranges) == (kind == 0)


@pytest.mark.parametrize("seed", range(5))
def test_several_echoes_observe_the_heading(seed):
    """Three point scatterers and a wall, with a prior of zero rotation and a standard deviation of 9 deg/s."""
    time = DT * np.arange(COUNT)
    places, yaw = np.stack([0.5 * time, np.zeros(COUNT)], axis=1), np.radians(20) * np.sin(0.8 * time)
    world = World([(normal(20), 5.0)], [(3.5, -0.7), (4.0, 0.5), (4.5, 1.4)])
    found, _, bearings = track(world, places, yaw, np.zeros(COUNT - 1), seed)
    assert np.abs(np.diff(yaw)).max() > PRIOR_STD
    assert np.sqrt(np.mean((found - yaw) ** 2)) < np.radians(1.5)
    assert {each.kind for each in bearings._tracked} <= {0, 1, None}


def there_and_back(turn):
    """Poses along a wall, observed for 2.5 s; a turn in 1.5 s; along the next wall for 2.5 s."""
    yaw = np.radians(turn) * np.clip((DT * np.arange(195) - 2.5) / 1.5, 0, 1)
    pace = 0.5 * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)  # to the left
    return np.cumsum(pace * DT, axis=0) - pace[0] * DT, yaw


@pytest.mark.parametrize(("turn", "second"), [(90, 90), (90.3, 90), (-90, -90), (180, 180)])
def test_a_wall_observed_again_corrects_the_drift(turn, second):
    """The drift is 3 deg in a turn without echoes; the walls are at right angles, or it is the same wall from the other
    side."""
    places, yaw = there_and_back(turn)
    centre = places[-1]
    world = World([(normal(0), 2.0), (normal(second), float(np.dot(normal(second), centre)) + 2.0)])
    increments = np.diff(yaw) * (1 + 3 / abs(turn))
    found, deviations, bearings = track(world, places, yaw, increments, gap=(2.4, 4.0))
    assert abs(found[119] - yaw[119]) > np.radians(2.5)
    assert abs(found[-1] - yaw[-1]) < np.radians(1.0) and deviations[-1] < np.radians(1.0)
    assert len(bearings._walls) == 1 and bearings._walls[0] > 1


def test_a_wall_at_another_angle_is_a_new_direction():
    places, yaw = there_and_back(60)
    world = World([(normal(0), 2.0), (normal(60), float(np.dot(normal(60), places[-1])) + 2.0)])
    found, deviations, bearings = track(world, places, yaw, np.diff(yaw), gap=(2.4, 4.0))
    assert np.abs(found - yaw).max() < np.radians(1.5)
    assert len(bearings._walls) == 2


def test_moving_or_jumping_echoes_are_not_tracked():
    still, wall = np.zeros(2), Echo(2.0, 0.0, 0.1)
    for other in (wall._replace(speed=0.6), wall._replace(range=2.3), wall._replace(bearing=0.3)):
        state = Gaussian(np.zeros(OWN))
        bearings = BearingTracker(MAPS, state)
        bearings.update(0.0, [wall], still)
        state.covariance[YAW, YAW] += PRIOR_STD**2
        bearings.update(DT, [other], still)
        assert state.mean[YAW] == 0 and bearings._tracked[0].frames == 1


def test_an_echo_without_detections_is_dropped():
    state = Gaussian(np.zeros(OWN))
    bearings = BearingTracker(MAPS, state)
    for time in (0.0, 0.1, 0.5):
        bearings.update(time, [Echo(2.0, 0.0, 0.1)] if time < 0.5 else [], np.zeros(2))
    assert not bearings._tracked and len(state.mean) == OWN


def test_right_angles_can_be_switched_off():
    places, yaw = slide()
    world, increments = World(walls=[(normal(0), 1.3)]), np.diff(yaw)
    walls = [len(track(world, places, yaw, increments, right_angles=on)[2]._walls) for on in (True, False)]
    assert walls == [1, 0]
    assert not MapRotation(MAPS, RotationConfig(right_angles=False))._bearings._right_angles


def spectra(ranges, speeds, bearings, rng, second=0.0):
    """Spectra of one plane wave in noise; `second`: relative amplitude of another one, 40 deg aside."""
    shape = (len(ranges), CONFIG.samples, CONFIG.loops, 12)
    found = rng.normal(0, 1, shape) + 1j * rng.normal(0, 1, shape)
    step = MAPS.ranges[1] - MAPS.ranges[0]
    bins = (ranges - MAPS.ranges[0]) / step
    d = np.argmin(np.abs(MAPS.velocities - speeds[:, None]), axis=1)
    for k, sine in enumerate(np.sin(bearings)):
        wave = MAPS.steering(np.arange(12), [sine])[:, 0] + second * MAPS.steering(np.arange(12), [sine - 0.65])[:, 0]
        for r in range(int(bins[k]) - 2, int(bins[k]) + 4):
            found[k, r, d[k]] += 1000 * np.exp(-((r - bins[k]) ** 2)) * wave
    return torch.as_tensor(found).to(torch.complex64)


def test_range_speed_and_bearing_of_echoes():
    ranges, speeds = np.array([1.31, 2.5, 3.07]), np.array([0.0, 0.46, -0.46])
    angles = np.radians([-35.0, 0.4, 20.3])
    echoes, rng = Echoes(MAPS, FIRST), np.random.default_rng(0)
    alone = spectra(ranges, speeds, angles, rng).numpy()
    for cells, *true in zip(alone, ranges, speeds, angles, strict=True):
        (echo,) = echoes.of(cells)
        assert echo == pytest.approx(true, abs=0.06)
        assert echo.bearing == pytest.approx(true[2], abs=np.radians(0.3))
        assert echo.range == pytest.approx(true[0], abs=0.005)
    together = echoes.of(0.5 * alone[0] + 2 * alone[1] + alone[2])
    assert [round(echo.range, 1) for echo in together] == [2.5, 3.1, 1.3]  # the strongest first
    double = spectra(ranges, speeds, angles, np.random.default_rng(0), second=0.5).numpy()
    assert not any(echoes.of(cells) for cells in double)
    noise = np.random.default_rng(1).normal(0, 1, (*double.shape[1:], 2)).astype(np.float32).view(np.complex64)[..., 0]
    assert not echoes.of(noise)


class FixedRotation:
    """Rotation estimator with given yaw increments and a small covariance."""

    def __init__(self, turns):
        self.turns = turns

    def estimate(self, batch, velocities):
        count = len(batch)
        return Rotations.independent(self.turns, np.full(count, np.radians(0.1) ** 2), np.ones(count, bool))


def test_translation_along_a_bare_wall_is_no_rotation():
    """The local map observes nothing but the specular reflection, and the error of the network is 30 deg."""
    places, yaw = slide()
    increments = np.append(0.0, wrong(places, yaw))
    pace = np.gradient(places[:, 1], DT)
    velocity = pace[:, None] * np.stack([np.sin(yaw), np.cos(yaw)], axis=1)
    ranges, angles = np.full(COUNT, 1.3), -yaw
    closing = (velocity * np.stack([np.cos(angles), np.sin(angles)], axis=1)).sum(axis=1)
    spectrum = spectra(ranges, closing, angles, np.random.default_rng(2))
    signal = Signal(CONFIG)
    velocities = Velocities(
        velocity, np.tile(1e-4 * np.eye(2), (COUNT, 1, 1)), np.full(COUNT, 20), np.ones(COUNT, bool)
    )
    found = MapRotation(signal.heatmaps, prior=FixedRotation(increments)).estimate(
        of_spectrum(signal, spectrum, DT * np.arange(COUNT)), velocities
    )
    error, deviation = found.yaw.sum() - (yaw[-1] - yaw[0]), np.sqrt(found.variance[1:].sum())
    assert abs(increments.sum() - (yaw[-1] - yaw[0])) > np.radians(15)
    assert abs(error) < np.radians(4) and abs(error) < 3 * deviation
