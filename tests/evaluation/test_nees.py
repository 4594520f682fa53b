"""NEES of trajectories whose errors are drawn from their covariances."""

import numpy as np
import pytest

from radarize.evaluation.metrics import evaluate_trajectory
from radarize.evaluation.nees import pose_nees
from radarize.io.alignment import trajectory
from radarize.io.pose import compose, inverse
from radarize.io.tum import planar_poses

TIMES = np.arange(0.0, 400.0)


def drawn(rng, scale=1.0):
    """Return true and estimated poses on a circle, covariances, and the NEES by a sum over poses."""
    truth = np.stack([5 * np.cos(TIMES / 30), 5 * np.sin(TIMES / 30), TIMES / 30 + np.pi / 2], axis=1)
    spread = np.array([0.05, 0.02, 0.01])
    shape = rng.normal(size=(len(TIMES), 3, 3)) * spread[:, None]
    covariances = shape @ shape.transpose(0, 2, 1) + np.diag(spread**2)
    error = scale * np.stack([rng.multivariate_normal(np.zeros(3), each) for each in covariances])
    error[0] = 0
    found = compose(np.array([3.0, -1.0, 0.7]), compose(inverse(truth[0]), compose(truth, error)))  # in its own frame
    late = TIMES > 5
    nees = np.mean([e @ np.linalg.solve(c, e) / 3 for e, c in zip(error[late], covariances[late], strict=True)])
    return truth, found, covariances, nees


def nees_of(truth, found, covariances):
    errors = evaluate_trajectory(*(trajectory(TIMES, planar_poses(some)) for some in (found, truth)))
    return pose_nees(errors, TIMES, covariances)


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_nees_of_consistent_and_of_too_small_covariances(scale):
    truth, found, covariances, nees = drawn(np.random.default_rng(0), scale)
    assert nees_of(truth, found, covariances) == pytest.approx(nees, rel=1e-6) == pytest.approx(scale**2, rel=0.1)


def test_nees_is_nan_without_covariances():
    truth, found, covariances, _ = drawn(np.random.default_rng(0))
    for wrong in (covariances[:-1], covariances * np.nan, covariances * 0):
        assert np.isnan(nees_of(truth, found, wrong))
