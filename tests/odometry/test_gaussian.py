"""The filter of numbers that come and go, against least squares over all that was said (float64)."""

import numpy as np
import pytest

from radarize.odometry.gaussian import Gaussian


def test_against_least_squares():
    """Information form: what is known is a sum of squares, and a number that goes is marginalised at the end."""
    rng = np.random.default_rng(0)
    filter_ = Gaussian(np.array([2.0, 0.5]))
    information, vector = np.diag([0.5, 2.0]), np.zeros(2)
    measured = []
    for _ in range(3):
        row, variance = rng.normal(size=2), 0.3
        measured.append((row, float(row @ filter_.mean) + 0.1, variance))
        filter_.update(row, 0.1, variance)
    for row, value, variance in measured:
        information, vector = information + np.outer(row, row) / variance, vector + row * value / variance
    assert filter_.covariance == pytest.approx(np.linalg.inv(information))
    assert filter_.mean == pytest.approx(np.linalg.solve(information, vector))

    filter_.add(1, np.array([1.0, -2.0]), 0.7, 0.2)  # c = a - 2 b + 0.7 + noise, between the two
    joint = np.zeros((3, 3))  # of a, c, b
    joint[np.ix_([0, 2], [0, 2])] = information
    joint += np.outer([1, -1, -2], [1, -1, -2]) / 0.2
    linear = np.array([vector[0], 0, vector[1]]) + np.array([1, -1, -2]) * -0.7 / 0.2
    value = float(np.array([0.5, 1.0, 0.0]) @ filter_.mean) - 0.05
    filter_.update(np.array([0.5, 1.0, 0.0]), -0.05, 0.1)
    joint, linear = joint + np.outer([0.5, 1, 0], [0.5, 1, 0]) / 0.1, linear + np.array([0.5, 1, 0]) * value / 0.1
    assert filter_.covariance == pytest.approx(np.linalg.inv(joint))
    assert filter_.mean == pytest.approx(np.linalg.solve(joint, linear))

    filter_.keep([0, 1])
    assert filter_.covariance == pytest.approx(np.linalg.inv(joint)[:2, :2])
    before = filter_.mean.copy(), filter_.covariance.copy()
    filter_.replace(1, np.array([0.25, 0.75]))
    matrix = np.array([[1, 0], [0.25, 0.75]])
    assert filter_.mean == pytest.approx(matrix @ before[0])
    assert filter_.covariance == pytest.approx(matrix @ before[1] @ matrix.T)
    assert filter_.variance(filter_.row({0: 1.0, 1: -1.0})) == pytest.approx(
        np.array([1, -1]) @ filter_.covariance @ np.array([1, -1])
    )


def test_what_errors_share_with_one_as_it_was():
    """Against many draws of the errors: of a number when it was remembered, and of all after what came since."""
    rng, draws = np.random.default_rng(2), 200_000
    half = np.array([[1.0, 0.0], [0.6, 0.8]])
    filter_ = Gaussian(np.ones(2))
    filter_.covariance = half @ half.T
    errors = rng.normal(size=(draws, 2)) @ half.T  # estimates less what is true
    was = errors[:, 0]
    filter_.remember(0)

    def update(row: np.ndarray, variance: float) -> None:
        nonlocal errors
        gain = filter_.covariance @ row / (row @ filter_.covariance @ row + variance)
        off = np.sqrt(variance) * rng.normal(size=draws) - errors @ row
        errors = errors + off[:, None] * gain
        filter_.update(row, 0.0, variance)

    update(np.array([1.0, -0.5]), 0.3)
    row = np.array([0.4, 0.5])
    filter_.add(1, row, 0.0, 0.2)
    # What is added is truly the sum and noise, and estimated by the sum.
    errors = np.column_stack([errors[:, 0], errors @ row - np.sqrt(0.2) * rng.normal(size=draws), errors[:, 1]])
    update(np.array([0.0, 1.0, 1.0]), 0.1)
    filter_.replace(2, np.array([0.5, 0.0, 0.5]))
    errors[:, 2] = (errors[:, 0] + errors[:, 2]) / 2
    filter_.keep([2, 0])
    errors = errors[:, [2, 0]]
    assert filter_.covariance == pytest.approx(np.cov(errors.T), abs=0.01)
    assert filter_.shared == pytest.approx((errors * was[:, None]).mean(axis=0), abs=0.01)


def test_what_is_far_off_moves_little():
    moved = []
    for innovation in (1.0, 3.0, 30.0):
        filter_ = Gaussian(np.array([1.0]))
        filter_.update(np.ones(1), innovation, 0.1)
        moved.append(filter_.mean[0])
    assert moved[0] == pytest.approx(1 / 1.1) and moved[1] == pytest.approx(3 / 1.1, rel=0.1)
    assert moved[2] == pytest.approx(0.3)  # as if of a variance of 100
