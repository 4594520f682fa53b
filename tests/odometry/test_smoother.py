"""Filter and fixed-lag smoother, compared with least squares over all measurements (float64)."""

import numpy as np
import pytest

from radarize.odometry.smoother import FixedLagSmoother, Gaussian, random_walk_covariance


def test_against_least_squares():
    """Compared with the information form; a removed state is marginalised at the end."""
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

    filter_.add(1, np.array([1.0, -2.0]), 0.7, 0.2)  # c = a - 2 b + 0.7 + noise, inserted between a and b
    joint = np.zeros((3, 3))  # information of a, c, b
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


def test_cross_covariance_with_a_remembered_error():
    """Compared with many samples of the errors: of a state when it is remembered, and of all states after later
    updates."""
    rng, draws = np.random.default_rng(2), 200_000
    half = np.array([[1.0, 0.0], [0.6, 0.8]])
    filter_ = Gaussian(np.ones(2))
    filter_.covariance = half @ half.T
    errors = rng.normal(size=(draws, 2)) @ half.T  # estimate minus truth
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
    # The true value of the new state is the sum plus noise; its estimate is the sum.
    errors = np.column_stack([errors[:, 0], errors @ row - np.sqrt(0.2) * rng.normal(size=draws), errors[:, 1]])
    update(np.array([0.0, 1.0, 1.0]), 0.1)
    filter_.replace(2, np.array([0.5, 0.0, 0.5]))
    errors[:, 2] = (errors[:, 0] + errors[:, 2]) / 2
    filter_.keep([2, 0])
    errors = errors[:, [2, 0]]
    assert filter_.covariance == pytest.approx(np.cov(errors.T), abs=0.01)
    assert filter_.cross_covariance == pytest.approx((errors * was[:, None]).mean(axis=0), abs=0.01)


def test_outliers_are_down_weighted():
    moved = []
    for innovation in (1.0, 3.0, 30.0):
        filter_ = Gaussian(np.array([1.0]))
        filter_.update(np.ones(1), innovation, 0.1)
        moved.append(filter_.mean[0])
    assert moved[0] == pytest.approx(1 / 1.1) and moved[1] == pytest.approx(3 / 1.1, rel=0.1)
    assert moved[2] == pytest.approx(0.3)  # as for a variance of 100


def test_fixed_lag_smoother_is_least_squares_over_all_frames():
    """Newest value and variance equal those of one normal equation for all values and rates, for frames at irregular
    times."""
    rng = np.random.default_rng(0)
    frames, wander, fastest, back, noise = 6, 0.5, 2.0, 3, 0.04
    durations = rng.uniform(0.03, 0.4, frames)
    smoother = FixedLagSmoother(frames, wander, fastest)
    measured = rng.normal(0, 1, frames)
    value, rate = np.eye(2 * frames)[:frames], np.eye(2 * frames)[frames:]
    rows, values, weights = [value[:1], rate[:1]], [[0.0], [0.0]], [np.eye(1) * 1e12, np.eye(1) / fastest**2]
    for k in range(frames):
        smoother.predict(durations[k])
        smoother.add_relative_motion(back, measured[k], noise)
        if k:
            rows.append(np.stack([value[k] - value[k - 1] - durations[k] * rate[k - 1], rate[k] - rate[k - 1]]))
            values.append([0.0, 0.0]), weights.append(np.linalg.inv(random_walk_covariance(wander, durations[k])))
        if k >= back:
            rows.append(value[k : k + 1] - value[k - back]), values.append(measured[k : k + 1])
            weights.append(np.eye(1) / noise)
    normal = np.linalg.inv(sum(row.T @ weight @ row for row, weight in zip(rows, weights, strict=True)))
    right = sum(row.T @ weight @ target for row, weight, target in zip(rows, weights, values, strict=True))
    expected = normal @ right
    assert smoother.values == pytest.approx(expected[:frames], abs=1e-6)
    assert smoother.rate == pytest.approx(expected[-1], abs=1e-6)
    among = [*range(frames), -1]
    assert smoother.covariance == pytest.approx(normal[np.ix_(among, among)], abs=1e-6)
    row = value[-1] - value[-2]
    assert smoother.variance_since(1) == pytest.approx(row @ normal @ row, abs=1e-6)


def test_relative_motions_to_missing_frames_have_no_effect():
    smoother = FixedLagSmoother(4, 1.0, 1.0)
    for _ in range(3):
        smoother.predict(0.1)
        smoother.add_relative_motion(3, 5.0, 0.01)
        assert not smoother.values.any()
    smoother.predict(0.1)
    smoother.add_relative_motion(3, 5.0, 1e-6)
    assert smoother.values[-1] - smoother.values[0] == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("rate", [5, 15, 60])
def test_variance_of_a_prediction_does_not_depend_on_the_frame_rate(rate):
    smoother = FixedLagSmoother(3, 0.8, 1.0)
    for _ in range(rate + 1):
        smoother.predict(1 / rate)
    assert smoother.covariance[-2, -2] == pytest.approx(1.0 + 0.8**2 / 3)


def test_a_gap_is_predicted_with_the_rate():
    """The next frame comes after ten times the period: the prediction uses the rate, not the last difference."""
    smoother = FixedLagSmoother(3, 0.1, 10.0)
    for _ in range(20):
        smoother.predict(0.1)
        smoother.add_relative_motion(1, 0.2, 1e-6)
    before = smoother.values[-1]
    smoother.predict(1.0)
    assert smoother.values[-1] - before == pytest.approx(2.0, rel=0.02)
    assert smoother.variance_since(1) > 0.1**2 / 3
