"""Level axes, windows and labels, on a walk in a circle that is known in closed form."""

import numpy as np
import pytest

from radarize.baselines.rnin.training import displacement
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.odometry.inertial import GRAVITY, PERIOD, Imu, instants
from tests.baselines.walks_known import RATE, attitude, imu, pose, walk


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    with Recording(walk(tmp_path_factory.mktemp("walk") / "a.h5")) as found:
        yield found


def test_level_axes_follow_the_sensor(recording):
    found = Imu.of(recording)
    assert np.diff(found.time) == pytest.approx(PERIOD)
    true = attitude(found.time).as_matrix()
    up = np.arccos(np.clip((found.attitude[:, 2] * true[:, 2]).sum(axis=1), -1, 1))
    assert up.max() < np.radians(2.5)  # walking in a circle feels like a slope of 1.9 deg
    turned = found.yaw(found.time[-1:]) - found.yaw(found.time[:1])
    assert turned == pytest.approx(RATE * (found.time[-1] - found.time[0]), abs=0.01)
    level = found.levelled(found.time[-1:], 100)[0]
    assert level[:, 5] == pytest.approx(RATE, abs=0.01) and np.abs(level[:, 2]).max() < 0.05
    assert np.hypot(level[:, 0], level[:, 1]) == pytest.approx(2 * RATE**2, abs=0.25)


def test_samples_are_means_since_the_last_tick(recording):
    """The latest of them end at the instant asked for; before the first one all is as it was then."""
    found = Imu.of(recording)
    times = np.array([1.0, 2.0])
    latest = found.latest(times, 20)
    assert latest.shape == (2, 20, 6)
    force, turn = imu(1.0 - PERIOD / 2 - PERIOD * np.arange(19, -1, -1))
    assert latest[0] == pytest.approx(np.hstack([force, turn]), abs=1e-3)
    assert np.linalg.norm(latest[0, :, :3], axis=1).max() == pytest.approx(GRAVITY, abs=0.05)
    assert found.latest(np.array([0.05]), 20)[0, :15] == pytest.approx(np.tile(found.samples[0], (15, 1)), abs=1e-3)


def test_displacements_lie_on_level_axes(recording):
    """Turned by what the true heading and that of the level axes differ by; here 1 rad from the start on."""
    ends = instants(recording)
    found = displacement(recording, slice(None))
    moved = pose(ends)[:, :3] - pose(ends - 1)[:, :3]
    late = ends > 1.1
    cos, sin = np.cos(-1.0), np.sin(-1.0)
    expected = moved @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    assert found[late] == pytest.approx(expected[late], abs=0.02)
    assert np.linalg.norm(found[0]) == pytest.approx(0, abs=1e-6)  # nothing is known of before


def test_rows_of_frames(recording):
    some = displacement(recording, slice(3, 50, 2))
    assert some == pytest.approx(displacement(recording, slice(None))[3:50:2])


def test_what_is_no_imu_is_named(tmp_path):
    with Recording(walk(tmp_path / "a.h5", frames=4, with_imu=False)) as without:
        with pytest.raises(InputError, match="a.h5: has no /imu/time, expected an IMU"):
            Imu.of(without)
    with Recording(walk(tmp_path / "b.h5", frames=1)) as short:
        assert len(Imu.of(short).time) == 3
