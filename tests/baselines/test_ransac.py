"""Ego-velocity from points whose truth is known."""

import numpy as np
import pytest

from radarize.baselines.ransac.velocity import HYPOTHESES, RansacVelocity


@pytest.fixture(scope="module")
def estimator():
    return RansacVelocity()


def cloud(rng: np.random.Generator, velocity: np.ndarray, count: int = 40, wrong: int = 0) -> np.ndarray:
    """Points of a static world ahead, seen at a velocity; some of them close as they like."""
    direction = np.column_stack([np.ones(count), rng.uniform(-1, 1, count), rng.uniform(-0.5, 0.5, count)])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    speed = direction @ velocity
    speed[:wrong] += rng.choice([-1, 1], wrong) * rng.uniform(0.5, 2, wrong)
    return np.column_stack([rng.uniform(1, 4, (count, 1)) * direction, speed, np.full((count, 2), 20.0)])


def test_exact_points_give_the_exact_velocity(estimator):
    truth = np.array([0.8, -0.3, 0.1])
    velocity, covariance, inliers = estimator.solve(cloud(np.random.default_rng(0), truth))
    assert velocity == pytest.approx(truth[:2], abs=1e-9) and inliers == 40
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_four_in_ten_may_be_wrong(estimator):
    truth = np.array([1.1, 0.2, 0.0])
    for seed in range(20):
        velocity, _, inliers = estimator.solve(cloud(np.random.default_rng(seed), truth, wrong=16))
        assert velocity == pytest.approx(truth[:2], abs=1e-9) and inliers == 24


def test_covariance_is_that_of_the_errors(estimator):
    rng, truth, normalised = np.random.default_rng(1), np.array([0.5, 0.3, 0.0]), []
    for _ in range(300):
        points = cloud(rng, truth)
        points[:, 3] += rng.normal(0, 0.04, len(points))
        velocity, covariance, _ = estimator.solve(points)
        error = velocity - truth[:2]
        normalised.append(error @ np.linalg.solve(covariance, error) / 2)
    assert np.mean(normalised) == pytest.approx(1, abs=0.15)


def test_standing_and_not_knowing(estimator):
    still = cloud(np.random.default_rng(0), np.array([0.02, 0.02, 0]))
    assert not estimator.solve(still)[0].any() and estimator.solve(still)[2] == 40
    for points in (still[:2], np.tile(cloud(np.random.default_rng(0), np.array([1.0, 0, 0]))[:1], (9, 1))):
        velocity, covariance, inliers = estimator.solve(points)
        assert not velocity.any() and inliers == 0 and covariance[0, 0] > 0.5


def test_hypotheses_by_the_textbook():
    """Enough that one of them is right with probability 0.9999, if two in five points are wrong."""
    assert (1 - 0.6**3) ** HYPOTHESES < 1e-4 < (1 - 0.6**3) ** (HYPOTHESES - 1)
