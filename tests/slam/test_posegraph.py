"""The pose graph: exact on clean input, and robust against false closures."""

import numpy as np
import pytest

from radarize.io.pose import between, compose
from radarize.slam.posegraph import PoseGraph
from tests.slam.world import SIGMA, ate, lap


@pytest.mark.parametrize("false", [2, 5])
def test_false_closures_do_no_harm(false):
    clean, truth, odometry = lap(0)
    clean.optimise()
    best = ate(truth, np.array(clean.poses))
    assert clean.accepted.sum() >= 9
    graph, *_ = lap(false)
    graph.optimise()
    assert not graph.accepted[10:].any() and graph.accepted[:10].sum() >= 9
    assert best < 0.5 * odometry
    assert ate(truth, np.array(graph.poses)) < 1.05 * best


def test_odometry_alone_is_left_as_it_is():
    graph = PoseGraph()
    graph.add_node(np.zeros(3))
    for k in range(20):
        graph.add_node(compose(graph.poses[-1], np.array([1.0, 0, 0.1])))
        graph.add_motion(k, k + 1, np.array([1.0, 0, 0.1]), np.diag(SIGMA**2))
    before = np.array(graph.poses)
    graph.optimise()
    np.testing.assert_allclose(np.array(graph.poses), before, atol=1e-6)


def test_incremental_updates_agree_with_batch_optimisation():
    graph, truth, odometry = lap(0)
    for closure in range(10):
        graph.accept(closure)
        graph.update()
    on_the_way = np.array(graph.poses)
    graph.optimise()
    assert ate(truth, on_the_way) < 0.5 * odometry
    assert np.abs(on_the_way - graph.poses)[:, :2].max() < 0.05
    graph.add_node(compose(graph.poses[-1], np.array([1.0, 0, 0])))  # the session continues
    graph.add_motion(200, 201, np.array([1.0, 0, 0]), np.diag(SIGMA**2))
    graph.update()
    np.testing.assert_allclose(between(graph.poses[200], graph.poses[201]), [1, 0, 0], atol=1e-3)


def test_a_false_match_is_rejected():
    graph, truth, _ = lap(0)
    graph.add_match(40, 44, between(truth[40], truth[44]) + [1.5, 0.5, 0.2], np.diag([0.02, 0.02, 0.01]) ** 2)
    clean, *_ = lap(0)
    clean.optimise()
    graph.optimise()
    assert ate(truth, np.array(graph.poses)) < 1.05 * ate(truth, np.array(clean.poses))


def test_covariances_grow_from_the_start_and_shrink_with_loops():
    graph, *_ = lap(0)
    graph.optimise()
    covariances = graph.covariances()
    assert covariances.shape == (201, 3, 3)
    assert covariances[0, 0, 0] < 1e-9 < covariances[50, 0, 0]
    loose = PoseGraph()
    loose.add_node(np.zeros(3))
    for k in range(4):
        loose.add_node(np.array([k + 1.0, 0, 0]))
        loose.add_motion(k, k + 1, np.array([1.0, 0, 0]), np.diag([0.01, 0.01, 1e-8]))
    np.testing.assert_allclose(loose.covariances()[:, 0, 0], 0.01 * np.arange(5), atol=1e-6)


def test_correlated_matches_and_closures_count_as_one():
    """Four of each, of variance 0.04 beside a step of 1: with correlated = 4 the variance is 1 / (1 / 1 + 2 / 0.04)."""

    def graph(count):
        found = PoseGraph(correlated=count)
        found.add_node(np.zeros(3))
        found.add_node(np.array([1.0, 0, 0]))
        found.add_motion(0, 1, np.array([1.0, 0, 0]), np.eye(3))
        for k in range(4):
            found.add_match(0, 1, np.array([1.2, 0, 0]), 0.04 * np.eye(3))
            found.add_closure(0, 1, np.array([1.2, 0, 0]), 0.04 * np.eye(3))
            found.accept(k)
        found.optimise()
        return found

    independent, correlated = graph(1), graph(4)
    np.testing.assert_allclose(np.diag(independent.covariances()[1]), 1 / (1 + 8 / 0.04), rtol=1e-3)
    np.testing.assert_allclose(np.diag(correlated.covariances()[1]), 1 / (1 + 2 / 0.04), rtol=1e-3)
    # The poses are those with the weights of all.
    np.testing.assert_allclose(correlated.poses[1], [1 + 0.2 * 200 / 201, 0, 0], atol=1e-6)
    np.testing.assert_array_equal(correlated.poses, independent.poses)


def test_steps_of_very_different_covariance():
    rng, graph = np.random.default_rng(2), PoseGraph()
    graph.add_node(np.zeros(3))
    for k in range(300):
        sigma = np.array([1e-4, 1e-4, 1e-4]) if k % 100 < 90 else np.array([3.0, 3.0, 2.0])
        step = np.array([0.3, 0, 0]) + rng.normal(0, np.minimum(sigma, 0.3))
        graph.add_node(compose(graph.poses[-1], step))
        graph.add_motion(k, k + 1, step, np.diag(sigma**2))
        if k > 40 and k % 4 == 0:
            loop = between(graph.poses[k - 40], graph.poses[k]) + rng.normal(0, 0.5, 3)
            graph.add_closure(k - 40, k, loop, np.diag([600.0, 0.01, 15.0]))
            graph.accept(len(graph.closures) - 1)
            graph.update()
    graph.optimise()
    assert np.isfinite(graph.poses).all() and np.isfinite(graph.covariances()).all()


def chain(known, unknown):
    """Steps of 0.3 m with the variance `known`, one in the middle with `unknown`, and a loop with the same."""
    graph = PoseGraph()
    graph.add_node(np.zeros(3))
    for k in range(5):
        graph.add_node(compose(graph.poses[-1], np.array([0.3, 0, 0])))
        graph.add_motion(k, k + 1, np.array([0.3, 0, 0]), np.eye(3) * (unknown if k == 2 else known))
    graph.add_closure(0, 5, np.array([1.5, 0, 0]), np.eye(3) * unknown)
    graph.accept(0)
    return graph


def test_covariances_beyond_the_precision_of_cholesky():
    """The yaw is observed by the step, the loop, and the position of the end, 0.6 m away."""
    graph = chain(1e-8, 100.0)
    yaw = 1 / (1 / 100 + 1 / 100 + 0.6**2 / (100 + 100))
    np.testing.assert_allclose(graph.covariances()[:, 2, 2], [0, 1e-8, 2e-8, yaw, yaw, yaw], rtol=1e-3, atol=2e-12)
    assert graph.solved


def test_covariances_without_a_solver_are_those_of_odometry():
    graph = chain(1e-16, 1e20)
    found = graph.covariances()
    np.testing.assert_allclose(found[:, 2, 2], [0, 1e-16, 2e-16, 1e20, 1e20, 1e20], rtol=1e-6)
    # A standard deviation s of the yaw adds 0.6 s across at a distance of 0.6 m, and nothing along.
    np.testing.assert_allclose(found[5, :2, :2], np.diag([1e20, 1.36e20]), rtol=1e-6)
    assert not graph.solved


def test_empty_and_single():
    graph = PoseGraph()
    graph.optimise()
    assert graph.covariances().shape == (0, 3, 3)
    graph.add_node(np.array([1.0, 2.0, 3.0]))
    graph.optimise()
    np.testing.assert_allclose(graph.poses[0], [1, 2, 3])
