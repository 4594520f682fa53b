"""The IMU: exact physics below its errors, and errors as specified."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarsim.motion.trajectory import Motion
from radarsim.sensors.depth import MOUNT
from radarsim.sensors.imu import ACCELEROMETER, GYROSCOPE, RATE, STANDARD_GRAVITY, Imu, Triad
from tests.sensors.mounting import CONFIG, beside, rows, stream, tumble


def test_samples_come_at_200_hz_without_gaps():
    imu = Imu(beside(Motion.still((0, 0, 1), duration=5)))
    times = np.concatenate([rows(imu, a, b)["imu/time"] for a, b in ((0, 1), (1, 9), (9, 17), (17, 100))])
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, 1 / RATE))
    assert times[0] == 0 and 100 * CONFIG.frame_period - 1 / RATE <= times[-1] < 100 * CONFIG.frame_period


def test_at_rest_it_feels_gravity_upward():
    tilted = Imu(beside(Motion.still((0, 0, 1), pitch=np.deg2rad(30))))
    force, turn = tilted.truth(np.array([0.2]))
    # Nose down by 30 degrees: up is half backward.
    assert force[0] == pytest.approx(STANDARD_GRAVITY * np.array([-0.5, 0, np.sqrt(0.75)]), abs=1e-6)
    assert turn[0] == pytest.approx([0, 0, 0], abs=1e-9)


def test_centripetal_force_at_the_lever_arm():
    rate, arm = 2.0, 0.3
    motion = Motion.linear((0, 0, 1), (0, 0, 0), yaw_rate=rate, lever_arm=(arm, 0, 0))
    force, turn = Imu(beside(motion)).truth(np.array([0.1, 0.4]))
    assert force == pytest.approx(np.tile([-(rate**2) * (arm + MOUNT[0]), 0, STANDARD_GRAVITY], (2, 1)), abs=2e-3)
    assert turn == pytest.approx(np.tile([0, 0, rate], (2, 1)), abs=1e-6)


def integrate(imu: Imu, here: Motion, dt: float, duration: float) -> tuple[float, float]:
    """Strapdown integration of exact samples, from the definitions: final errors, m and rad."""
    times = np.arange(0, duration, dt)
    force, turn = imu.truth(times)
    attitude, position = here.rotation(times[:1])[0], here.position(times[:1])[0]
    velocity = here.velocity(times[:1])[0]
    gravity = np.array([0, 0, -STANDARD_GRAVITY])
    # Second order in the rate, with the coning term of a linearly changing one (Savage 1998).
    a, b = turn[:-1] * dt, turn[1:] * dt
    turns = Rotation.from_rotvec((a + b) / 2 + np.cross(a, b) / 12)
    for k in range(len(times) - 1):
        before = attitude.apply(force[k]) + gravity
        attitude = attitude * turns[k]
        after = attitude.apply(force[k + 1]) + gravity
        position = position + velocity * dt + (2 * before + after) * dt**2 / 6
        velocity = velocity + (before + after) * dt / 2
    end = times[-1:]
    return np.linalg.norm(position - here.position(end)[0]), (attitude.inv() * here.rotation(end)[0]).magnitude()


def test_it_integrates_back_to_the_trajectory():
    """Ten seconds of tumbling: errors of centimetres from 200 samples per second, decreasing with the square of the
    step."""
    motion = tumble(10.0, np.random.default_rng(2))
    imu = Imu(beside(motion))
    way, turn = integrate(imu, motion.mounted(MOUNT), 1 / RATE, 10.0)
    assert way < 0.015 and turn < 1e-3
    finer, finer_turn = integrate(imu, motion.mounted(MOUNT), 1 / (4 * RATE), 10.0)
    assert finer < way / 8 and finer_turn < turn / 8


@pytest.mark.parametrize("errors", [ACCELEROMETER, GYROSCOPE])
def test_allan_deviation_is_as_specified(errors):
    """Noise, instability and random walk each where they dominate, over 27 runs of 15 minutes."""
    size, runs = int(900 * RATE), 27
    averages = (1, 4, 20, 200, 2000, 20000)
    variance = np.zeros(len(averages))
    for run in range(runs):
        value = Triad(errors, np.random.default_rng(run), size).measure(np.zeros((size, 3)), np.arange(size))
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(value, axis=0)])
        for i, m in enumerate(averages):  # overlapping estimate
            step = max(m // 8, 1)
            second = total[2 * m :: step] - 2 * total[m:-m:step] + total[: -2 * m : step]
            variance[i] += np.mean(second**2) / (2 * m**2) / runs
    expected = errors.allan_deviation(np.array(averages) / RATE)
    assert np.sqrt(variance) == pytest.approx(expected, rel=0.06)
    # White noise at the start, and a floor of the instability's size at its end.
    assert expected[1] == pytest.approx(errors.noise / np.sqrt(4 / RATE), rel=0.06)
    assert 0.5 * errors.instability < expected[-1] < 2 * errors.instability


def test_the_bias_is_estimated():
    imu = Imu(beside(Motion.still((0, 0, 1), duration=30)))
    seen = rows(imu, 0, 900)
    found = np.hstack([seen["imu/accelerometer"], seen["imu/gyroscope"]]) - [0, 0, STANDARD_GRAVITY, 0, 0, 0]
    spread = np.r_[[ACCELEROMETER.noise] * 3, [GYROSCOPE.noise] * 3] / np.sqrt(30)
    assert np.all(np.abs((found - seen["imu/bias"]).mean(axis=0)) < 4 * spread)


@pytest.mark.parametrize("name", ["imu/time", "imu/bias", "imu/accelerometer"])
def test_batches_do_not_matter(name):
    imu = Imu(beside(tumble(2.0, np.random.default_rng(0))))
    found = [stream(imu, name, 50, batch) for batch in (1, 8, 50)]
    assert np.array_equal(found[0], found[1]) and np.array_equal(found[1], found[2])


def test_a_longer_motion_begins_with_the_same_errors():
    short, long = (Triad(GYROSCOPE, np.random.default_rng(1), count) for count in (300, 900))
    assert np.array_equal(short.bias, long.bias[:300]) and np.ptp(long.bias[:, 0]) > 0
