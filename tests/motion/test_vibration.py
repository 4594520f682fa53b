"""Vibration: level, band and growth with speed against their laws; position, velocity and IMU truth agree."""

import numpy as np
import pytest
from scipy.signal import welch

from radarize.radar.presets import PRESETS
from radarsim.machine.rng import keyed_rng
from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS, Vibration
from radarsim.motion.trajectory import Motion
from radarsim.motion.vibration import vibrating
from radarsim.motion.walk import Walk
from radarsim.propagation.burst import BurstClock, parabola
from radarsim.world.scene import Scene

WHEELS = Vibration((5.0, 20.0), rolling=1e-4)
T = np.arange(2.0, 118.0, 1 / 200)  # off the ends


def straight(speed: float) -> Motion:
    """Motion along x at constant speed (m/s), with knots as in a planned tour."""
    times = np.arange(-1.0, 121.0, 0.02)
    motion = Motion.linear((0, 0, 0), (speed, 0, 0), duration=120.0)
    return Motion(120.0, type(motion.path)(times, np.outer(times, [speed, 0, 0])), motion.attitude)


def shaken(speed: float, vibration: Vibration, seed: int = 0):
    """Displacement of a straight motion by vibration, m."""
    motion = straight(speed)
    return vibrating(motion, vibration, np.random.default_rng(seed)).position(T) - motion.position(T)


@pytest.mark.parametrize("speed", [0.25, 1.0, 1.5])
def test_variance_grows_with_speed(speed):
    """sigma^2 = sigma_1^2 v in each axis; none at rest; a hand's is the same at any speed."""
    assert shaken(speed, WHEELS).std(axis=0) == pytest.approx(np.full(3, 1e-4 * np.sqrt(speed)), rel=0.02)
    assert not shaken(0.0, WHEELS).any()
    assert shaken(speed, PLATFORMS["handheld"].vibration).std(axis=0) == pytest.approx(np.full(3, 6e-5), rel=0.02)


def test_spectrum_is_a_floors():
    """G(f) = sigma^2 / (1 / f1 - 1 / f2) / f^2 within the band (ISO 8608), and less than 1e-4 of the power outside."""
    density = np.mean(
        [welch(shaken(1.0, WHEELS, seed), 200.0, nperseg=800, axis=0)[1].mean(axis=1) for seed in range(12)], axis=0
    )
    f = np.arange(len(density)) * 0.25
    for low, high in ((6, 9), (9, 13), (13, 19)):
        within = (f >= low) & (f < high)
        expected = 1e-8 / (1 / 5 - 1 / 20) * (1 / low - 1 / high)
        assert density[within].sum() * 0.25 == pytest.approx(expected, rel=0.15)
    outside = (f < 3.5) | (f > 22)
    assert density[outside].sum() < 1e-4 * density.sum()


def test_axes_and_seeds_are_independent():
    first, second = shaken(1.0, WHEELS, 1), shaken(1.0, WHEELS, 2)
    assert np.array_equal(first, shaken(1.0, WHEELS, 1))
    correlation = np.corrcoef(np.concatenate([first, second], axis=1).T) - np.eye(6)
    assert np.abs(correlation).max() < 0.15


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_position_velocity_acceleration_agree(platform):
    """Velocity is the derivative of position, acceleration that of velocity; IMU and Doppler depend on it."""
    office = Scene.load("office")
    walk = Walk(platform, duration=20.0).through(office, 3)
    t, step = np.linspace(0.0, 20.0, 2003), 1e-5
    velocity = (walk.position(t + step) - walk.position(t - step)) / (2 * step)
    acceleration = (walk.velocity(t + step) - walk.velocity(t - step)) / (2 * step)
    assert np.abs(walk.velocity(t) - velocity).max() < 1e-5
    assert np.abs(walk.acceleration(t) - acceleration).max() < 1e-2
    # The route is the one without vibration, of the same seed.
    route = plan_motion(office, platform, 20.0, keyed_rng(3, "route"))
    apart = walk.position(t) - route.position(t)
    assert 2e-5 < np.sqrt(np.mean(apart**2)) < 3e-4 and np.abs(apart).max() < 1e-3
    assert np.array_equal(walk.rotation(t).as_quat(), route.rotation(t).as_quat())


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_path_lengths_are_parabolas_over_a_burst(platform):
    """The residual of a vibration beyond the burst's parabola is below 1 degree of two-way phase (RMS)."""
    config = PRESETS["radarize"]
    clock = BurstClock.of(config)
    motion, vibration = straight(PLATFORMS[platform].speed), PLATFORMS[platform].vibration
    moved = vibrating(motion, vibration, np.random.default_rng(0))
    s = np.linspace(-1, 1, 33)
    left = []
    for start in np.arange(2.0, 60.0, 0.31):
        way = 2 * moved.position(start + clock.nodes)[:, 1]
        c0, c1, c2 = parabola.py_func(*way)
        left.append(2 * moved.position(start + clock.middle + clock.half * s)[:, 1] - (c0 + s * (c1 + s * c2)))
    assert 360 * np.sqrt(np.mean(np.square(left))) / config.wavelength < 1.0
