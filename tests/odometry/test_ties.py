"""Differences between a few frames, against least squares over all of them."""

import numpy as np
import pytest

from radarize.odometry.ties import Ties, wandered


def test_it_is_least_squares_over_everything():
    """The filter's newest value and variance are those of one normal equation for all values and rates, whenever the
    frames came."""
    rng = np.random.default_rng(0)
    frames, wander, fastest, back, noise = 6, 0.5, 2.0, 3, 0.04
    durations = rng.uniform(0.03, 0.4, frames)
    ties = Ties(frames, wander, fastest)
    measured = rng.normal(0, 1, frames)
    value, rate = np.eye(2 * frames)[:frames], np.eye(2 * frames)[frames:]
    rows, values, weights = [value[:1], rate[:1]], [[0.0], [0.0]], [np.eye(1) * 1e12, np.eye(1) / fastest**2]
    for k in range(frames):
        ties.predict(durations[k])
        ties.tie(back, measured[k], noise)
        if k:
            rows.append(np.stack([value[k] - value[k - 1] - durations[k] * rate[k - 1], rate[k] - rate[k - 1]]))
            values.append([0.0, 0.0]), weights.append(np.linalg.inv(wandered(wander, durations[k])))
        if k >= back:
            rows.append(value[k : k + 1] - value[k - back]), values.append(measured[k : k + 1])
            weights.append(np.eye(1) / noise)
    normal = np.linalg.inv(sum(row.T @ weight @ row for row, weight in zip(rows, weights, strict=True)))
    asked = sum(row.T @ weight @ told for row, weight, told in zip(rows, weights, values, strict=True))
    expected = normal @ asked
    assert ties.values == pytest.approx(expected[:frames], abs=1e-6)
    assert ties.rate == pytest.approx(expected[-1], abs=1e-6)
    among = [*range(frames), -1]
    assert ties.covariance == pytest.approx(normal[np.ix_(among, among)], abs=1e-6)
    row = value[-1] - value[-2]
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


@pytest.mark.parametrize("rate", [5, 15, 60])
def test_what_is_unknown_after_a_second_does_not_depend_on_the_frame_rate(rate):
    ties = Ties(3, 0.8, 1.0)
    for _ in range(rate + 1):
        ties.predict(1 / rate)
    assert ties.covariance[-2, -2] == pytest.approx(1.0 + 0.8**2 / 3)


def test_a_gap_is_crossed_at_the_rate_of_before():
    """The last two frames' difference is no rate of the next one's, if that comes thirty times later."""
    ties = Ties(3, 0.1, 10.0)
    for _ in range(20):
        ties.predict(0.1)
        ties.tie(1, 0.2, 1e-6)
    before = ties.values[-1]
    ties.predict(1.0)
    assert ties.values[-1] - before == pytest.approx(2.0, rel=0.02)
    assert ties.variance(1) > 0.1**2 / 3
