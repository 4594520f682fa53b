"""Endless sessions: redundant submaps are removed, and all others kept."""

import numpy as np
import pytest

from radarize.io.pose import between, compose
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from tests.slam.world import RATE, box, lap, play, ring, walk

ROOM = np.concatenate([box(0, 0, 6, 5), box(3, 2.2, 3.5, 2.7), box(5.2, 0, 6, 0.6)])


def test_to_and_fro_in_one_room_ends_to_grow():
    """The number of nodes is bounded, and pose and map stay accurate."""
    once = walk([[1, 1], [5, 1], [5, 4], [1, 4], [1, 1]], 0.1, 0.15)
    slam, made, rng = Slam(SlamConfig.preset("radar"), endless=True), [], np.random.default_rng(0)
    add, slam.graph.add_node = slam.graph.add_node, lambda pose: (made.append(pose), add(pose))
    odometry = play(slam, ROOM, np.concatenate([once] * 16), rng, share=0.1)
    assert len(made) > 800 > 600 > len(slam.nodes) > 50
    assert len(slam.nodes) == len(slam.graph.poses) == len(slam._local) == len(slam._drift._sums)
    now = compose(slam.graph.poses[-1], between(slam.odometry.pose(slam.nodes[-1].time), odometry))
    assert np.abs(between(once[-1], now)) == pytest.approx(0, abs=0.2)
    assert np.hypot(*(odometry - once[-1])[:2]) > 0.2  # error of odometry alone
    grid = slam.map()
    walls = np.argwhere(grid.probability > 0.65)[:, ::-1] * grid.resolution + grid.origin
    x, y = np.abs(walls - [3, 2.5]).T
    outside = np.maximum(x - 3, y - 2.5)  # distance outside of the outer walls
    assert np.quantile(outside, 0.95) < 0.33  # six cells


def test_rooms_that_nobody_went_to_again_stay():
    corridor = walk([[1.5, 1.5], [10.5, 1.5], [10.5, 10.5], [1.5, 10.5], [1.5, 1.5]], 0.1, 0.15)
    corner = walk([[1.5, 1.5], [5, 1.5], [1.5, 1.5]], 0.1, 0.15)
    slam, made, rng = Slam(SlamConfig.preset("radar"), endless=True), [], np.random.default_rng(1)
    add, slam.graph.add_node = slam.graph.add_node, lambda pose: (made.append(pose), add(pose))
    play(slam, ring(), np.concatenate([corridor, *[corner] * 15]), rng)
    assert len(made) > len(slam.nodes) + 50
    there = slam.graph.poses[:, :2]
    away = np.hypot(*(there[:, None] - corridor[None, ::20, :2]).transpose(2, 0, 1)).min(axis=0)
    assert away.max() < 1.0  # each place of the lap has a node


def test_standing_takes_no_memory_at_all():
    slam, rng = Slam(SlamConfig.preset("radar"), endless=True), np.random.default_rng(0)
    play(slam, ROOM, np.tile([2.0, 2.0, 0.3], (3000, 1)), rng)
    assert len(slam.nodes) == 1 and len(slam.odometry) < 200 and len(slam._scan_times) == 0
    place = slam.odometry.pose(slam.nodes[0].time)
    assert place == pytest.approx([2, 2, 0.3], abs=0.01)
    spread = slam.odometry.motion(slam.nodes[0].time, 2999 / RATE)[1]
    assert spread[0, 0] == pytest.approx(3000e-10 + 1e-8, rel=0.05)  # the covariances of all steps are included
    slam.finish()
    assert len(slam.trajectory()[0]) == 0


def test_a_graph_without_some_of_its_nodes():
    """The nodes that are kept keep their poses, their closures and, where nodes are removed, the motion between
    them."""
    graph, truth, _ = lap(0)
    for number in range(len(graph.closures)):
        graph.accept(number)
    graph.update()
    before, kept = graph.poses.copy(), [0, 1, 5, 14, 23, *range(100, 201)]
    graph.keep(kept, lambda a, b: np.eye(3) * 1e-4 * (b - a))
    assert graph.poses == pytest.approx(before[kept], abs=0)
    assert graph.closures == [(2, 10), (3, 19), (4, 28)] and graph.accepted.all()
    graph.optimise()
    for (a, b), (of, to) in zip(graph.closures, [(5, 105), (14, 114), (23, 123)], strict=True):
        error = between(between(truth[of], truth[to]), between(graph.poses[a], graph.poses[b]))
        assert np.abs(error) == pytest.approx(0, abs=0.15)
    graph.add_node(graph.poses[-1])
    graph.add_motion(105, 106, np.zeros(3), np.eye(3) * 1e-4)
    graph.update()
    assert graph.poses[-1] == pytest.approx(graph.poses[-2], abs=1e-3)
