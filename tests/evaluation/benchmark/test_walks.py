"""NEES of the relative motions of odometry."""

from functools import partial

import numpy as np
import pytest

from radarize.evaluation.benchmark.walks import motion_nees
from radarize.io.pose import compose
from radarize.odometry.uncertainty import ErrorModel, MotionCovariance

FRAMES, WALKS = 40, 400


def test_nees_of_motions_with_the_covariances_of_steps(monkeypatch):
    """Errors of the steps of a curved walk are drawn from their covariances: the NEES is 1 over windows of any length,
    and 4 with a quarter of the covariances."""
    monkeypatch.setattr("radarize.odometry.uncertainty.MotionCovariance", partial(MotionCovariance, scale=0.0))
    rng = np.random.default_rng(0)
    half = np.array([[0.002, 0.0, 0.0], [0.0006, 0.001, 0.0], [0.0, 0.0004, 0.001]])
    step, steps = np.array([0.1, 0.02, 0.08]), np.broadcast_to(half @ half.T, (FRAMES, 3, 3))
    true, poses = np.zeros((2, FRAMES, WALKS, 3))
    for k in range(1, FRAMES):
        true[k] = compose(true[k - 1], step)
        poses[k] = compose(compose(poses[k - 1], step), rng.normal(size=(WALKS, 3)) @ half.T)
    for length in (5, FRAMES - 1):
        walks = range(WALKS)
        errors = ErrorModel.independent(steps)
        found = [motion_nees(poses[:, walk], true[:, walk], errors, range(1), length) for walk in walks]
        assert np.mean(found) == pytest.approx(1, abs=0.1)
    quarter = motion_nees(poses[:, -1], true[:, -1], ErrorModel.independent(steps / 4), range(1), FRAMES - 1)
    assert quarter == pytest.approx(4 * found[-1])
