"""Differences between a few frames, against least squares over all of them."""

import numpy as np
import pytest

from radarize.odometry.ties import Ties


def test_it_is_least_squares_over_everything():
    """The filter's newest value and variance are those of one normal equation for all frames."""
    rng = np.random.default_rng(0)
    frames, dt, change, fastest, back, noise = 6, 0.1, 0.5, 2.0, 3, 0.04
    ties = Ties(frames, change, fastest)
    measured = rng.normal(0, 1, frames)
    rows, values, weights = [np.eye(frames)[0]], [0.0], [1e12]  # the first frame is the origin
    for k in range(frames):
        ties.predict(dt)
        ties.tie(back, measured[k], noise)
        unit = np.eye(frames)
        if k == 1:
            rows.append(unit[1] - unit[0]), values.append(0.0), weights.append(1 / (fastest * dt) ** 2)
        elif k > 1:
            rows.append(unit[k] - 2 * unit[k - 1] + unit[k - 2]), values.append(0.0)
            weights.append(1 / (change * dt) ** 2)
        if k >= back:
            rows.append(unit[k] - unit[k - back]), values.append(measured[k]), weights.append(1 / noise)
    design, weights = np.array(rows), np.array(weights)
    normal = np.linalg.inv(design.T @ (weights[:, None] * design))
    expected = normal @ design.T @ (weights * values)
    assert ties.values == pytest.approx(expected, abs=1e-6)
    assert ties.covariance == pytest.approx(normal, abs=1e-6)
    row = np.eye(frames)[-1] - np.eye(frames)[-2]
    assert ties.variance(1) == pytest.approx(row @ normal @ row, abs=1e-6)


def test_frames_that_were_not_there_tie_nothing():
    ties = Ties(4, 1.0, 1.0)
    for _ in range(3):
        ties.predict(0.1)
        ties.tie(3, 5.0, 0.01)
        assert not ties.values.any()
    ties.predict(0.1)
    ties.tie(3, 5.0, 1e-6)
    assert ties.values[-1] - ties.values[0] == pytest.approx(5.0, abs=1e-3)
