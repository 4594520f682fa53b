"""Ego-velocity from point echoes of a room whose radar moves at a known velocity."""

import numpy as np
import pytest

from radarize.odometry.doppler import DopplerVelocity
from radarize.odometry.mixture import fit_velocity
from radarize.radar.boards import BOARDS
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from tests.batches import batch
from tests.echoes import record
from tests.radars import radar
from tests.rooms import antenna_gain, furnished_room

CONFIG = PRESETS["radarize"]
VELOCITIES = [(1.0, 0.0), (-1.0, 0.0), (0.0, 0.8), (0.0, -0.8), (0.9, 0.5), (1.5, -0.3), (-0.4, -0.6), (0.2, 0.1)]


@pytest.fixture(scope="module")
def room():
    points, amplitudes = furnished_room(np.random.default_rng(4), density=12.0)
    return points, amplitudes


def burst(room, velocity, climb=0.0, turn=0.0, yaw=0.3, config=CONFIG, noise=20.0):
    """A frame in the middle of the room, at a velocity in the sensor frame at the burst's centre."""

    def pose(t):
        heading = yaw + turn * (t - config.burst_center)
        v = np.array([*velocity, climb])
        world = np.array([np.cos(yaw) * v[0] - np.sin(yaw) * v[1], np.sin(yaw) * v[0] + np.cos(yaw) * v[1], v[2]])
        return np.array([3.5, 2.5, 0.0]) + (t - config.burst_center)[..., None] * world, heading

    rng = np.random.default_rng(7)
    return record(config, pose, *room, np.zeros(1), rng, noise, block=16, gain=antenna_gain)


def test_velocity_of_either_sign(room):
    maps = Heatmaps(CONFIG)
    adc = np.concatenate([burst(room, v, yaw=y) for v in VELOCITIES for y in (0.3, 2.1)])
    truth = np.repeat(VELOCITIES, 2, axis=0)
    found = DopplerVelocity(maps).estimate(batch(CONFIG, adc, np.arange(len(adc))))
    error = np.abs(found.velocity - truth)
    assert (np.median(error, axis=0) < 0.015).all()
    assert error.max() < 0.06
    spread = np.sqrt(found.covariance[:, [0, 1], [0, 1]])
    assert 0.3 < ((error / spread) ** 2).mean() < 3
    length = np.hypot(*truth.T)
    assert abs(((found.velocity - truth) * truth).sum() / (length**2).sum()) < 0.005
    assert (found.inliers > 15).all()


def test_turning_and_climbing_do_not_count(room):
    maps = Heatmaps(CONFIG)
    adc = burst(room, (0.8, 0.1), climb=0.15, turn=np.radians(90))
    found = DopplerVelocity(maps).estimate(batch(CONFIG, adc, np.arange(len(adc))))
    np.testing.assert_allclose(found.velocity[0], (0.8, 0.1), atol=0.03)


def test_standing_still_is_exactly_zero(room):
    maps = Heatmaps(CONFIG)
    found = DopplerVelocity(maps).estimate(batch(CONFIG, burst(room, (0.0, 0.0)), np.zeros(1)))
    assert (found.velocity[0] == 0).all()
    assert found.covariance[0].max() < 0.01


def test_a_walk_that_sets_in_is_not_standing(room):
    """15 mm/s are below the threshold of standing still, but many standard deviations."""
    maps = Heatmaps(CONFIG)
    found = DopplerVelocity(maps).estimate(batch(CONFIG, burst(room, (0.015, 0.0)), np.zeros(1)))
    assert found.velocity[0] == pytest.approx([0.015, 0.0], abs=0.006)
    error = found.velocity[0] - [0.015, 0.0]
    assert error @ np.linalg.solve(found.covariance[0], error) < 9


def test_people_are_outliers(room):
    points, amplitudes = room
    rng = np.random.default_rng(5)
    person = np.array([3.5, 2.5, 0.0]) + [1.6, 0.8, 0.0] + rng.normal(0, 0.1, (30, 3))
    still = burst(room, (0.9, 0.0))
    # A person who runs towards the moving radar closes faster: simulated by the same echoes from a faster radar.
    other = burst((person, 100.0 * np.exp(2j * np.pi * rng.random(30))), (0.9 + 0.7, 0.0), noise=0.0)
    maps = Heatmaps(CONFIG)
    found = DopplerVelocity(maps).estimate(batch(CONFIG, still + other, np.zeros(1)))
    np.testing.assert_allclose(found.velocity[0], (0.9, 0.0), atol=0.03)


def test_without_echoes_the_covariance_is_large():
    maps = Heatmaps(CONFIG)
    noise = np.random.default_rng(2).normal(0, 20, (2, *CONFIG.frame_shape)).astype(np.int16)
    noise[1] = 0
    found = DopplerVelocity(maps).estimate(batch(CONFIG, noise, np.arange(2)))
    assert np.isfinite(found.velocity).all()
    assert (np.linalg.eigvalsh(found.covariance)[:, 0] > 0.2).all()
    assert not found.seen.any()


@pytest.mark.parametrize("velocity", [(2.0, 0.0), (2.4, 0.3), (-2.2, 0.0), (1.6, 1.6), (0.4, 2.1)])
def test_faster_than_the_unambiguous_speed(room, velocity):
    maps = Heatmaps(CONFIG)
    found = DopplerVelocity(maps).estimate(batch(CONFIG, burst(room, velocity), np.zeros(1)))
    np.testing.assert_allclose(found.velocity[0], velocity, atol=0.05)
    error = found.velocity[0] - velocity
    assert error @ np.linalg.solve(found.covariance[0], error) < 14


@pytest.mark.parametrize("speed", [0.8, 1.2, 1.5])
def test_a_radar_whose_limit_is_below_walking_pace(room, speed):
    slow = CONFIG.model_copy(update={"idle_time": CONFIG.idle_time + CONFIG.chirp_time})  # 0.92 m/s
    adc = burst(room, (speed, 0.1), config=slow)
    found = DopplerVelocity(Heatmaps(slow)).estimate(batch(slow, adc, np.zeros(1)))
    np.testing.assert_allclose(found.velocity[0], (speed, 0.1), atol=0.04)


def echoes_about(rng, spread, count=60, speed=1.0):
    """Echoes whose u_z varies by `spread` about the measured one; the sensor moves straight ahead."""
    u_y, read = rng.uniform(-0.8, 0.8, count), rng.normal(0, 0.1, count)
    u_z = read + rng.normal(0, spread, count)
    closing = speed * np.sqrt(1 - u_y**2 - u_z**2) + rng.normal(0, 0.003, count)
    return np.column_stack([closing, u_y, read, np.full(count, spread**2), np.full(count, 1e4)])


@pytest.mark.parametrize("spread", [0.1, 0.15])
def test_unseen_elevation_does_not_shorten(spread):
    # To second order an error of u_z reduces E[u_x] by spread^2 / (2 u_x^2), more where u_x is small.
    rng, noise = np.random.default_rng(6), np.array([0.003, 0.1, 0.005, 1.0, 0.15])
    draws = np.random.default_rng(0).random((200, 2))
    with_spread, without = [], []
    for _ in range(40):
        echoes = echoes_about(rng, spread)
        with_spread.append(fit_velocity(echoes, np.ones(len(echoes)), draws, noise, 0.015, 3.8)[0][0] - 1)
        echoes[:, 3] = 1e-6
        rough = np.array([0.03, *noise[1:]])
        without.append(fit_velocity(echoes, np.ones(len(echoes)), draws, rough, 0.015, 3.8)[0][0] - 1)
    assert np.mean(without) < -0.8 * spread**2 / 2
    # Some overshoot is left, as the residuals are skewed and robust weights prefer their fast side.
    assert abs(np.mean(with_spread)) < 0.5 * spread**2 / 2


def test_elevation_of_one_echo_and_of_two_at_once():
    maps = Heatmaps(CONFIG)
    estimator = DopplerVelocity(maps)

    def strongest(heights, phases):
        points = np.array([[np.sqrt(9 - z * z), 0.6, z] for z in heights])
        amplitudes = 400 * np.exp(1j * np.array(phases))

        def still(t):
            return np.zeros((*t.shape, 3)), np.zeros(t.shape)

        adc = record(CONFIG, still, points, amplitudes, np.zeros(1), np.random.default_rng(1), 5.0)
        echoes = estimator.echoes(maps.spectrum(adc)[0])
        return echoes[np.argmax(echoes[:, 5])]

    range_bin, speed, u_y, u_z, spread, _, purity = strongest([0.9], [0.0])
    assert purity > 0.99
    assert maps.ranges[int(range_bin)] == pytest.approx(3.06, abs=0.05)
    assert (speed, u_y, u_z) == pytest.approx((0, 0.6 / 3.06, 0.9 / 3.06), abs=0.02)
    assert spread < 0.05**2
    # Floor and ceiling in one cell: the spread is large whatever the mean.
    spreads = [strongest([0.9, -0.9], [0.0, phase])[4] for phase in (0.7, 1.5, 2.3)]
    assert np.sqrt(np.median(spreads)) > 0.15


@pytest.mark.parametrize("preset", ["long-range", "two-tx"])
def test_other_configurations(room, preset):
    config = PRESETS[preset]
    maps = Heatmaps(config)
    found = DopplerVelocity(maps).estimate(batch(config, burst(room, (0.8, 0.2), config=config), np.zeros(1)))
    np.testing.assert_allclose(found.velocity[0], (0.8, 0.2), atol=0.08)


@pytest.mark.parametrize("board", ["iwr6843aop", "iwr6843ods"])
def test_four_antennas_in_a_row(room, board):
    """Bearings come from the elevation pairs, after the correction of the receivers' signs: RMSE of 1 cm/s and
    consistent covariances."""
    config = CONFIG.changed("radar", board=board, start_frequency=60e9)
    adc = np.concatenate([burst(room, v, yaw=y, config=config) for v in VELOCITIES[:6] for y in (0.3, 2.1)])
    truth = np.repeat(VELOCITIES[:6], 2, axis=0)
    found = DopplerVelocity(Heatmaps(config)).estimate(batch(config, adc, np.arange(len(adc))))
    error = (found.velocity - truth)[..., None]
    nees = (error.mT @ np.linalg.solve(found.covariance, error)).mean() / 2
    assert found.seen.all() and np.sqrt((error**2).mean()) < 0.012 and nees < 2


@pytest.mark.parametrize("board", BOARDS)
def test_any_board(room, board):
    """Boards with any number of antennas in any number of rows."""
    config = radar(board)
    found = DopplerVelocity(Heatmaps(config)).estimate(
        batch(config, burst(room, (0.6, 0.15), config=config), np.zeros(1))
    )
    assert found.seen.all() and found.velocity[0] == pytest.approx((0.6, 0.15), abs=0.03)


@pytest.mark.parametrize("direction", [(0.0, 0.0), (0.3, 0.1), (0.94, 0.0), (1.0, 0.0)])
def test_echoes_from_one_direction_are_no_singularity(direction):
    """The speed across is unobservable: its covariance is large, and the solution finite."""
    draws = np.random.default_rng(0).random((50, 2))
    echoes = np.tile([0.2, *direction, 0.01, 100.0], (6, 1))
    noise = np.array([0.03, 0.1, 0.03, 0.2, 0.15])
    velocity, covariance, _ = fit_velocity(echoes, np.ones(len(echoes)), draws, noise, 0.015, 3.8)
    assert np.isfinite(velocity).all() and np.linalg.eigvalsh(covariance).max() > 1


def test_two_echoes_in_one_cell_are_no_plane_wave():
    """Of power p each at azimuths that the row resolves, one plane wave explains a half: (p / 2 p)."""
    maps = Heatmaps(CONFIG)

    def still(t):
        return np.zeros((*t.shape, 3)), np.zeros(t.shape)

    points = np.array([[3 * np.cos(a), 3 * np.sin(a), 0.0] for a in (-0.4, 0.4)])
    adc = record(CONFIG, still, points, np.full(2, 400.0), np.zeros(1), np.random.default_rng(1), 5.0)
    echoes = DopplerVelocity(maps).echoes(maps.spectrum(adc)[0])
    both = echoes[np.argsort(-echoes[:, 5])[:2]]
    assert sorted(both[:, 2]) == pytest.approx([-np.sin(0.4), np.sin(0.4)], abs=0.02)
    assert both[:, 6] == pytest.approx(0.5, abs=0.08)


def furnished(rng, velocity, direct=14, others=110):
    """Echoes of a furnished room: few direct ones, and many that came over several surfaces and close more slowly."""
    u_y = rng.uniform(-0.8, 0.8, direct + others)
    closing = velocity[0] * np.sqrt(1 - u_y**2) + velocity[1] * u_y
    closing[:direct] += rng.normal(0, 0.003, direct)
    closing[direct:] *= rng.uniform(0.6, 1.0, others)
    spread = np.r_[np.full(direct, 0.03**2), np.full(others, 0.22**2)]
    echoes = np.column_stack([closing, u_y, np.zeros(direct + others), spread, np.full(direct + others, 1e4)])
    return echoes, np.r_[np.full(direct, 5.0), np.full(others, 0.01)]


NOISE = np.array([0.003, 0.1, 0.005, 0.4, 0.15])


def test_few_direct_echoes_outweigh_many_slow_ones():
    """Within 1 cm/s of 1.2 m/s. With equal odds, the many slow ones win and the speed is too small."""
    rng, random = np.random.default_rng(3), np.random.default_rng(0).random((100, 2))
    velocity, errors, equal = np.array([1.2, 0.1]), [], []
    for _ in range(30):
        echoes, odds = furnished(rng, velocity)
        errors.append(fit_velocity(echoes, odds, random, NOISE, 0.015, 3.8)[0] - velocity)
        equal.append(fit_velocity(echoes, np.ones(len(odds)), random, NOISE, 0.015, 3.8)[0] - velocity)
    assert np.sqrt(np.mean(np.square(errors))) < 0.01
    assert np.sqrt(np.mean(np.square(equal))) > 0.03 and np.mean(equal, axis=0)[0] < -0.02


def test_the_fit_is_the_likeliest_velocity():
    """Against the mixture's likelihood on a grid of 1 mm/s, in float64 and without any step of the fit."""
    rng, random = np.random.default_rng(8), np.random.default_rng(0).random((100, 2))
    speed_noise, power_noise, azimuth_noise, elevation, _ = NOISE
    for velocity in ([0.9, -0.2], [0.3, 0.05]):
        echoes, odds = furnished(rng, np.array(velocity))
        found = fit_velocity(echoes, odds, random, NOISE, 0.015, 3.8)[0]
        grid = np.stack(np.meshgrid(*(c + np.arange(-0.04, 0.0401, 0.001) for c in velocity), indexing="ij"), axis=-1)
        closing, u_y, u_z, spread, power = echoes.T
        u_x = np.sqrt(1 - u_y**2 - spread)
        v_x, v_y = grid[..., :1], grid[..., 1:]
        variance = speed_noise**2 + power_noise**2 / power + (azimuth_noise * (v_y - v_x * u_y / u_x)) ** 2
        variance = variance + 0.5 * spread**2 * (v_x / u_x) ** 2
        residual = closing - v_x * u_x - v_y * u_y
        gauss = np.exp(-0.5 * residual**2 / variance) / np.sqrt(2 * np.pi * variance)
        likelihood = np.log(odds * gauss + 1 / 3.8).sum(axis=-1)
        best = grid[np.unravel_index(likelihood.argmax(), likelihood.shape)]
        assert found == pytest.approx(best, abs=0.002)
