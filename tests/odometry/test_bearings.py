"""Turns by echoes whose bearings are known, of walls and posts, beside an estimator that errs."""

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
#: Numbers of the filter that are others'.
OWN = 3
#: rad a frame that an estimator of turns claims to err by.
CLAIM = np.radians(0.3)


class World:
    """Vertical walls, as lines n . p = d whose flash stands at the foot of the perpendicular, and posts."""

    def __init__(self, walls=(), posts=()):
        self.walls, self.posts = walls, posts

    def seen(self, place, yaw, velocity, rng):
        """Echoes within 60 deg and 6 m, off by 0.1 deg and a millimetre, the nearest first."""
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


def track(world, places, yaws, told, seed=1, blind=(0.0, 0.0), right_angles=True):
    """Heading by `told` and the bearings, its claim, and the `BearingTracker`; nothing is seen between two instants, s."""
    rng, state = np.random.default_rng(seed), Gaussian(np.zeros(OWN))
    bearings, found, claims = BearingTracker(MAPS, state, right_angles), np.zeros(len(yaws)), np.zeros(len(yaws))
    velocities = np.gradient(places, DT, axis=0)
    cos, sin = np.cos(yaws), np.sin(yaws)
    velocities = np.stack(
        [cos * velocities[:, 0] + sin * velocities[:, 1], cos * velocities[:, 1] - sin * velocities[:, 0]], 1
    )
    for k, (place, yaw, velocity) in enumerate(zip(places, yaws, velocities, strict=True)):
        if k:
            state.mean[YAW] += told[k - 1]
            state.covariance[YAW, YAW] += CLAIM**2
            bearings.predict(DT, (velocity + velocities[k - 1]) / 2)
        echoes = world.seen(place, yaw, velocity, rng)
        bearings.update(k * DT, [] if blind[0] <= k * DT < blind[1] else echoes, velocity)
        found[k], claims[k] = state.mean[YAW], np.sqrt(state.covariance[YAW, YAW])
    return found, claims, bearings


def slide():
    """Places and yaws of a walk past a wall 1.3 m ahead, at 0.7 m/s, which begins slowly; swinging by 15 deg."""
    time = DT * np.arange(COUNT)
    along = np.cumsum(0.7 * np.clip(time - 0.5, 0, 1)) * DT
    return np.stack([np.zeros(COUNT), along], axis=1), np.radians(15) * np.sin(time)


def wrong(places, yaw):
    """Turns of an estimator that is right at first, and takes a third of a slide for turning later on."""
    late = np.clip(DT * np.arange(1, COUNT) - 2.5, 0, 1)
    return np.diff(yaw) + late * np.diff(places[:, 1]) / 1.3 / 3


@pytest.mark.parametrize("kind", [0, 1])
def test_an_echo_remains_what_it_was(kind):
    """A single wall, or a single post: what it is shows while the other estimator is right, and holds when it errs."""
    places, yaw = slide()
    world = World(posts=[(1.3, 1.0)]) if kind else World(walls=[(normal(0), 1.3)])
    told = wrong(places, yaw)
    found, claims, bearings = track(world, places, yaw, told)
    assert abs(told.sum() - (yaw[-1] - yaw[0])) > np.radians(15)
    # How far a post is, and so by what it moves, is known to a few percent alone.
    assert np.abs(found - yaw).max() < np.radians((2, 6)[kind])
    assert abs(found[-1] - yaw[-1]) < 3 * claims[-1] and claims[-1] < np.radians(4)
    assert [each.kind for each in bearings._tracked] == [kind]
    assert bool(bearings.specular_ranges) == (kind == 0)


@pytest.mark.parametrize("seed", range(5))
def test_several_echoes_tell_turns_by_themselves(seed):
    """Three posts and a wall, an estimator that knows nothing but that nobody turns faster than 9 deg/s or so."""
    time = DT * np.arange(COUNT)
    places, yaw = np.stack([0.5 * time, np.zeros(COUNT)], axis=1), np.radians(20) * np.sin(0.8 * time)
    world = World([(normal(20), 5.0)], [(3.5, -0.7), (4.0, 0.5), (4.5, 1.4)])
    found, _, bearings = track(world, places, yaw, np.zeros(COUNT - 1), seed)
    assert np.abs(np.diff(yaw)).max() > CLAIM
    assert np.sqrt(np.mean((found - yaw) ** 2)) < np.radians(1.5)
    assert {each.kind for each in bearings._tracked} <= {0, 1, None}


def there_and_back(turn):
    """Along a wall, seen for 2.5 s; a turn by so much in 1.5 s; along the next wall for 2.5 s; places and yaws."""
    yaw = np.radians(turn) * np.clip((DT * np.arange(195) - 2.5) / 1.5, 0, 1)
    pace = 0.5 * np.stack([-np.sin(yaw), np.cos(yaw)], axis=1)  # to the left
    return np.cumsum(pace * DT, axis=0) - pace[0] * DT, yaw


@pytest.mark.parametrize(("turn", "second"), [(90, 90), (90.3, 90), (-90, -90), (180, 180)])
def test_a_wall_met_again_takes_back_what_the_heading_drifted(turn, second):
    """By 3 deg, in a turn in which nothing is seen; walls at right angles, or the same one from the other side."""
    places, yaw = there_and_back(turn)
    centre = places[-1]
    world = World([(normal(0), 2.0), (normal(second), float(np.dot(normal(second), centre)) + 2.0)])
    told = np.diff(yaw) * (1 + 3 / abs(turn))
    found, claims, bearings = track(world, places, yaw, told, blind=(2.4, 4.0))
    assert abs(found[119] - yaw[119]) > np.radians(2.5)
    assert abs(found[-1] - yaw[-1]) < np.radians(1.0) and claims[-1] < np.radians(1.0)
    assert len(bearings._walls) == 1 and bearings._walls[0] > 1


def test_a_wall_at_no_right_angle_is_another_direction():
    places, yaw = there_and_back(60)
    world = World([(normal(0), 2.0), (normal(60), float(np.dot(normal(60), places[-1])) + 2.0)])
    found, claims, bearings = track(world, places, yaw, np.diff(yaw), blind=(2.4, 4.0))
    assert np.abs(found - yaw).max() < np.radians(1.5)
    assert len(bearings._walls) == 2


def test_what_moves_or_jumps_is_not_followed():
    still, wall = np.zeros(2), Echo(2.0, 0.0, 0.1)
    for other in (wall._replace(speed=0.6), wall._replace(range=2.3), wall._replace(bearing=0.3)):
        state = Gaussian(np.zeros(OWN))
        bearings = BearingTracker(MAPS, state)
        bearings.update(0.0, [wall], still)
        state.covariance[YAW, YAW] += CLAIM**2
        bearings.update(DT, [other], still)
        assert state.mean[YAW] == 0 and bearings._tracked[0].frames == 1


def test_an_echo_out_of_sight_is_forgotten():
    state = Gaussian(np.zeros(OWN))
    bearings = BearingTracker(MAPS, state)
    for time in (0.0, 0.1, 0.5):
        bearings.update(time, [Echo(2.0, 0.0, 0.1)] if time < 0.5 else [], np.zeros(2))
    assert not bearings._tracked and len(state.mean) == OWN


def test_right_angles_can_be_switched_off():
    places, yaw = slide()
    world, told = World(walls=[(normal(0), 1.3)]), np.diff(yaw)
    walls = [len(track(world, places, yaw, told, right_angles=on)[2]._walls) for on in (True, False)]
    assert walls == [1, 0]
    assert not MapRotation(MAPS, RotationConfig(right_angles=False))._bearings._right_angles


def spectra(ranges, speeds, bearings, rng, second=0.0):
    """Of one plane wave in a cell of noise; `second`, of another one 40 deg aside, as a share of its amplitude."""
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


def test_echoes_have_their_places():
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


class Astray:
    """Rotation estimator of turns at hand, which it claims to know well."""

    def __init__(self, turns):
        self.turns = turns

    def estimate(self, batch, velocities):
        count = len(batch)
        return Rotations.independent(self.turns, np.full(count, np.radians(0.1) ** 2), np.ones(count, bool))


def test_sliding_along_a_bare_wall_is_no_turn():
    """The local map sees nothing but the flash, and what turns the network tells is off by 30 deg."""
    places, yaw = slide()
    told = np.append(0.0, wrong(places, yaw))
    pace = np.gradient(places[:, 1], DT)
    velocity = pace[:, None] * np.stack([np.sin(yaw), np.cos(yaw)], axis=1)
    ranges, angles = np.full(COUNT, 1.3), -yaw
    closing = (velocity * np.stack([np.cos(angles), np.sin(angles)], axis=1)).sum(axis=1)
    spectrum = spectra(ranges, closing, angles, np.random.default_rng(2))
    signal = Signal(CONFIG)
    velocities = Velocities(
        velocity, np.tile(1e-4 * np.eye(2), (COUNT, 1, 1)), np.full(COUNT, 20), np.ones(COUNT, bool)
    )
    found = MapRotation(signal.heatmaps, prior=Astray(told)).estimate(
        of_spectrum(signal, spectrum, DT * np.arange(COUNT)), velocities
    )
    error, claimed = found.yaw.sum() - (yaw[-1] - yaw[0]), np.sqrt(found.variance[1:].sum())
    assert abs(told.sum() - (yaw[-1] - yaw[0])) > np.radians(15)
    assert abs(error) < np.radians(4) and abs(error) < 3 * claimed
