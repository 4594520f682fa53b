"""Hard conditions of samples and walks, compared with closed forms."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from benchmarks.hardships import CONDITIONS, Samples, corridor, mounted
from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

FLOOR = {"name": "floor", "shape": "rectangle", "size": [9, 9], "facing": [0, 0, 1], "material": "concrete"}


@pytest.fixture
def plain() -> Scenario:
    """A sensor that goes ahead and turns left, 1.2 m high."""
    times = np.arange(-1.0, 4.0, 0.1)
    path = np.column_stack([times, 0 * times, np.full_like(times, 1.2)])
    turns = RotationSpline(times, Rotation.from_euler("z", 0.3 * times[:, None]))
    return Scenario(
        Scene.of({"objects": [FLOOR]}, "field"), Motion(2.0, CubicSpline(times, path), turns), PRESETS["radarize"]
    )


@pytest.mark.parametrize("name, gain_db, degrees", [("phase errors of 10 deg", 0, 10), ("gain errors of 1 dB", 1, 0)])
def test_channel_errors_are_the_same_in_all_frames(name, gain_db, degrees):
    rng = np.random.default_rng(0)
    adc = rng.integers(-20000, 20000, (2, 4, 3, 4, 8, 2)).astype(np.int16)
    hurt = CONDITIONS[name].hurt(Samples(adc, np.arange(2.0), np.ones((2, 4, 3), bool)), rng).adc
    before, after = (values.astype(float).view(complex)[..., 0] for values in (adc, hurt))
    factors = (after * before.conj()).sum(axis=(0, 1, 4)) / (abs(before) ** 2).sum(axis=(0, 1, 4))
    assert np.abs(after - before * factors[:, :, None]).max() < 2  # counts: rounding
    worst = np.abs(20 * np.log10(abs(factors))).max(), np.degrees(np.abs(np.angle(factors))).max()
    for found, most in zip(worst, (gain_db, degrees), strict=True):
        assert 0.6 * most <= found <= 1.01 * most + 0.01


def test_noise_increases_by_six_decibels_in_any_room():
    """Walls at any range, including the largest ones, do not count as noise."""
    rng, shape = np.random.default_rng(0), (2, 32, 3, 4, 96)
    walls = 2000 * np.exp(2j * np.pi * np.outer(rng.uniform(0, 96, 40), np.arange(96)) / 96).sum(axis=0) / 8
    noise = 8.0 * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
    adc = np.rint((walls + noise)[..., None].view(float)).astype(np.int16)
    hurt = CONDITIONS["noise + 6 dB"].hurt(Samples(adc, np.arange(2.0), np.ones(shape[:3], bool)), rng).adc
    assert (hurt.astype(float) - adc).std() == pytest.approx(8.0 * np.sqrt(3), rel=0.05)


def test_a_mounting_tilts_the_sensor_at_any_heading(plain):
    times = np.linspace(0, 2, 7)
    for change, axis in (({"pitch": 10.0}, [1, 0, 0]), ({"roll": 10.0}, [0, 1, 0])):
        tilted = mounted(**change)(plain).motion
        ways = tilted.attitude(times).apply(axis)
        assert np.allclose(np.degrees(np.arcsin(np.abs(ways[:, 2]))), 10.0, atol=0.01)
        assert np.allclose(tilted.path(times), plain.motion.path(times))
    high = mounted(height=0.4)(plain).motion
    assert np.allclose(high.path(times) - plain.motion.path(times), [0, 0, -0.8])


def test_the_corridor_is_walked_to_its_end_and_back(plain):
    scenario = corridor(plain)
    place = scenario.motion.position(np.arange(0, scenario.motion.duration, 0.2))
    assert np.abs(place[:, 1]).max() < 0.8 and place[:, 0].max() > 57 and place[-1, 0] < 4
