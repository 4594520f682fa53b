"""Statistics of velocity and yaw errors of known size."""

import numpy as np
import pytest

from radarize.evaluation.motion import turn_errors, velocity_errors


def test_errors_bias_and_nees_have_the_known_values():
    rng = np.random.default_rng(0)
    heading = rng.uniform(0, 2 * np.pi, 20000)
    direction = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    root = np.array([[0.04, 0.0], [0.02, 0.03]])
    noise = rng.normal(size=(20000, 2)) @ root.T
    covariance = np.broadcast_to(root @ root.T, (20000, 2, 2))
    found = velocity_errors(direction + noise, direction, covariance)
    assert found["rmse"] == pytest.approx(np.sqrt(np.trace(root @ root.T)), rel=0.02)
    assert found["forward"] == pytest.approx(0.04, rel=0.02)
    assert found["left"] == pytest.approx(np.hypot(0.02, 0.03), rel=0.02)
    assert found["bias"] == pytest.approx(0, abs=1e-3)
    assert found["nees"] == pytest.approx(1, rel=0.02) and found["nees_median"] == pytest.approx(1, rel=0.03)
    # The covariance is a quarter of the true one, and velocities are 10 % too large in any direction.
    assert velocity_errors(direction + noise, direction, covariance / 4)["nees"] == pytest.approx(4, rel=0.02)
    assert velocity_errors(1.1 * direction, direction)["bias"] == pytest.approx(0.1)
    assert velocity_errors(0.9 * direction, direction)["bias"] == pytest.approx(-0.1)


def test_an_outlier_changes_the_mean_nees_but_not_the_median():
    rng = np.random.default_rng(1)
    true, noise = np.zeros((1001, 2)), rng.normal(size=(1001, 2))
    noise[0] = 100
    found = velocity_errors(noise, true, np.broadcast_to(np.eye(2), (1001, 2, 2)))
    assert found["nees"] > 10 and found["nees_median"] == pytest.approx(1, abs=0.15)
    assert np.isnan(found["bias"])  # it never moved


def test_missing_estimates_are_counted():
    estimate = np.array([[1.0, 0.0], [np.nan, 0.0], [1.0, 0.3]])
    errors = velocity_errors(estimate, np.tile([1.0, 0.0], (3, 1)))
    assert errors["missing"] == pytest.approx(1 / 3)
    assert errors["left"] == pytest.approx(0.3 / np.sqrt(2))
    assert np.isnan(velocity_errors(estimate[1:2], np.ones((1, 2)))["median"])


def test_turns_over_windows():
    true = np.array([3.0, 3.1, -3.08, -3.0, -2.9])  # through pi
    steps = np.array([9.0, 0.1, 0.1, 0.1, 0.1])
    one = np.array([0.0, 0.1 - (2 * np.pi - 6.18), 0.02, 0.0])
    np.testing.assert_allclose(turn_errors(steps, true, 1), one, atol=1e-9)
    np.testing.assert_allclose(turn_errors(steps, true, 2), one[:-1] + one[1:], atol=1e-9)
    assert len(turn_errors(steps, true, 4)) == 1
