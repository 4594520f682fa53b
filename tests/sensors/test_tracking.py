"""Tracking camera: smooth, level, with slow drift."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarsim.motion.trajectory import Motion
from radarsim.sensors.tracking import HEADING_WALK, JITTER, SCALE_ERROR, TrackingCamera
from tests.sensors.mounting import beside, rows, tumble


def both(motion, count, seed):
    """Tracked poses, true poses and times of a recording."""
    found = rows(TrackingCamera(beside(motion, seed=seed)), 0, count)
    return [found[f"tracking/{name}"] for name in ("pose", "true_pose", "time")]


def test_the_true_pose_is_that_of_the_radar():
    motion = tumble(2.0, np.random.default_rng(0))
    _, truth, time = both(motion, 50, 0)
    assert truth[:, :3] == pytest.approx(motion.position(time))
    assert (Rotation.from_quat(truth[:, 3:]).inv() * motion.rotation(time)).magnitude().max() < 1e-6
    assert np.diff(time) == pytest.approx(np.full(len(time) - 1, 5e-3))


def test_it_keeps_gravity_and_starts_at_the_truth():
    tracked, truth, _ = both(tumble(4.0, np.random.default_rng(1)), 120, 5)
    up, true_up = (Rotation.from_quat(p[:, 3:]).inv().apply([0, 0, 1]) for p in (tracked, truth))
    assert np.linalg.norm(up - true_up, axis=1).max() < 6 * JITTER[1]
    assert tracked[0, :3] == pytest.approx(truth[0, :3], abs=6 * JITTER[0])


def test_drift_grows_as_documented():
    """A straight walk of 20 m in 20 s: along it the scale error, across it the integral of the heading's walk."""
    motion = Motion.linear((0, 0, 1), (1, 0, 0), duration=20)
    errors = np.array([(p[-1] - t[-1])[:3] for p, t, _ in (both(motion, 600, seed) for seed in range(40))])
    along, across = errors.std(axis=0)[:2]
    assert along == pytest.approx(20 * SCALE_ERROR, rel=0.4)
    assert across == pytest.approx(HEADING_WALK * np.sqrt(20**3 / 3), rel=0.4)
    assert np.quantile(np.linalg.norm(errors, axis=1), 0.5) < 0.01 * 20
