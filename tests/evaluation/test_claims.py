"""Trajectories whose errors are drawn from what they claim."""

import numpy as np
import pytest

from radarize.evaluation.claims import pose_nees
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.pose import compose, inverse
from radarize.io.tum import planar_poses

TIMES = np.arange(0.0, 400.0)


def drawn(rng, scale=1.0):
    """Poses on a circle that start at the truth, their covariances, and the NEES that a brute force gets."""
    truth = np.stack([5 * np.cos(TIMES / 30), 5 * np.sin(TIMES / 30), TIMES / 30 + np.pi / 2], axis=1)
    spread = np.array([0.05, 0.02, 0.01])
    shape = rng.normal(size=(len(TIMES), 3, 3)) * spread[:, None]
    claimed = shape @ shape.transpose(0, 2, 1) + np.diag(spread**2)
    error = scale * np.stack([rng.multivariate_normal(np.zeros(3), each) for each in claimed])
    error[0] = 0
    found = compose(np.array([3.0, -1.0, 0.7]), compose(inverse(truth[0]), compose(truth, error)))  # in its own frame
    late = TIMES > 5
    nees = np.mean([e @ np.linalg.solve(c, e) / 3 for e, c in zip(error[late], claimed[late], strict=True)])
    return truth, found, claimed, nees


def judged(truth, found, claimed):
    errors = evaluate_trajectory(*(trajectory(TIMES, planar_poses(some)) for some in (found, truth)))
    return pose_nees(errors, TIMES, claimed)


@pytest.mark.parametrize("scale", [1.0, 3.0])
def test_honest_and_proud_claims(scale):
    truth, found, claimed, nees = drawn(np.random.default_rng(0), scale)
    assert judged(truth, found, claimed) == pytest.approx(nees, rel=1e-6) == pytest.approx(scale**2, rel=0.1)


def test_no_claims():
    truth, found, claimed, _ = drawn(np.random.default_rng(0))
    for wrong in (claimed[:-1], claimed * np.nan, claimed * 0):
        assert np.isnan(judged(truth, found, wrong))
