"""The whole back end: synthetic loops, real lidar, and invalid input."""

import gc
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.io.pose import between, compose
from radarize.io.tum import planar, read_tum
from radarize.pipeline.log import Log
from radarize.slam.backend import Slam
from radarize.slam.config import PRESETS, SlamConfig
from tests.slam.world import align, ate, box, ring, scan, walk

RADISH = Path(__file__).parents[3] / "shared" / "recordings" / "radish"
LOOP = [(1.5, 1.5), (10.5, 1.5), (10.5, 10.5), (1.5, 10.5), (1.5, 1.5), (6.0, 1.5)]


def drifting(truth, rng, translation, rotation, bias=0.0):
    """Odometry with random errors per root metre and a heading bias per radian turned."""
    poses = [truth[0]]
    for step in between(truth[:-1], truth[1:]):
        distance = np.sqrt(np.hypot(step[0], step[1]))
        step = step + distance * rng.normal(0, [translation, translation, rotation])
        step[2] += bias * abs(step[2])
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def run(config, times, odometry, azimuths, scans):
    slam = Slam(config)
    for time, pose, ranges in zip(times, odometry, scans, strict=True):
        slam.add_odometry(time, pose)
        slam.add_scan(time, azimuths, ranges)
    slam.finish()
    return slam


@pytest.fixture(scope="module")
def lidar_lap():
    rng = np.random.default_rng(11)
    truth = walk(LOOP, 0.5, 0.4)
    azimuths = np.radians(np.arange(-90.0, 90.0, 2.0))
    scans = [scan(ring(), p, azimuths, 12.0) + rng.normal(0, 0.01, len(azimuths)) for p in truth]
    odometry = drifting(truth, rng, 0.03, 0.03, bias=0.05)
    slam = run(SlamConfig.preset("lidar"), np.arange(len(truth)) * 1.0, odometry, azimuths, scans)
    return truth, odometry, slam


def test_loop_with_lidar(lidar_lap):
    truth, odometry, slam = lidar_lap
    times, poses = slam.trajectory()
    assert len(times) == len(truth)
    assert ate(truth, odometry) > 0.4
    assert ate(truth, poses) < 0.1 * ate(truth, odometry)
    assert slam.graph.accepted.any()


def test_map_shows_the_walls_where_they_are(lidar_lap):
    truth, _, slam = lidar_lap
    grid = slam.map()
    rows, columns = np.nonzero(grid.probability > 0.65)
    points = np.stack([columns, rows], axis=-1) * grid.resolution + grid.origin + grid.resolution / 2
    # Only the first pose fixes the map to the world, so the error of its heading is removed first.
    turn, shift = align(truth, slam.trajectory()[1])
    points = points @ turn.T + shift
    walls = ring()
    a, e = walls[None, :, :2], walls[None, :, 2:] - walls[None, :, :2]
    t = np.clip(((points[:, None] - a) * e).sum(-1) / (e**2).sum(-1), 0, 1)
    distance = np.hypot(*np.moveaxis(a + t[..., None] * e - points[:, None], -1, 0)).min(axis=1)
    assert np.mean(distance < 0.1) > 0.9
    free = grid.cells((np.array([[6.0, 1.5], [10.5, 6.0], [1.5, 6.0]]) - shift) @ turn)
    assert (grid.probability[free[:, 0], free[:, 1]] < 0.3).all()
    inside = grid.cells((np.array([[6.0, 6.0]]) - shift) @ turn)[0]
    assert grid.probability[tuple(inside)] == 0  # unknown behind walls


def radar_walk(corners, rng, drop=0.5):
    truth = walk(corners, 0.1, 0.1)
    azimuths = np.radians(np.arange(-44.0, 44.0))
    scans = []
    for pose in truth:
        ranges = scan(ring(), pose, azimuths, 4.28) + rng.normal(0, 0.04, len(azimuths))
        ranges[rng.random(len(azimuths)) < drop] = np.inf
        ghosts = rng.random(len(azimuths)) < 0.03
        ranges[ghosts] = rng.uniform(0.4, 4.2, ghosts.sum())
        scans.append(ranges)
    return truth, azimuths, scans


def test_loop_with_radar():
    rng = np.random.default_rng(3)
    truth, azimuths, scans = radar_walk([*LOOP[:5], (10.5, 1.5), (10.5, 6.0)], rng)
    odometry = drifting(truth, rng, 0.01, 0.02, bias=0.03)
    slam = run(SlamConfig.preset("radar"), np.arange(len(truth)) * 0.1, odometry, azimuths, scans)
    times, poses = slam.trajectory()
    assert len(times) == len(truth) and len(slam.nodes) < len(truth) / 2
    assert ate(truth, poses) < 0.5 * ate(truth, odometry)


def test_the_last_node_is_searched():
    """A loop may close with the last node, whatever the number of nodes."""
    rng = np.random.default_rng(3)
    truth, azimuths, scans = radar_walk([*LOOP[:5], (4.5, 1.5)], rng)
    odometry, counts = drifting(truth, rng, 0.01, 0.02, bias=0.03), set()
    for cut in (0, 3, 6, 9):
        stop = len(truth) - cut
        slam = run(SlamConfig.preset("radar"), np.arange(stop) * 0.1, odometry[:stop], azimuths, scans[:stop])
        last = len(slam.nodes) - 1
        assert any(node == last for _, node in slam.graph.closures)
        counts.add(last % (SlamConfig.preset("radar").loop.nodes // 2))
    assert len(counts) > 1


def test_radar_does_no_harm_to_good_odometry():
    rng = np.random.default_rng(4)
    truth, azimuths, scans = radar_walk([(1.5, 1.5), (10.5, 1.5), (10.5, 10.0)], rng)
    odometry = drifting(truth, rng, 0.01, 0.01)
    _, poses = run(SlamConfig.preset("radar"), np.arange(len(truth)) * 0.1, odometry, azimuths, scans).trajectory()
    assert ate(truth, poses) < max(1.05 * ate(truth, odometry), 0.05)


def test_featureless_corridor_keeps_odometry_along_it():
    walls = np.array([[-100.0, -1.01, 100, -1.01], [-100, 1.02, 100, 1.02]])
    truth = walk([(0.0, 0.0), (40.0, 0.0)], 0.1, 0.1)
    azimuths = np.radians(np.arange(-44.0, 44.0))
    rng = np.random.default_rng(5)
    scans = [scan(walls, p, azimuths, 4.28) + rng.normal(0, 0.03, 88) for p in truth]
    odometry = drifting(truth, rng, 0.01, 0.01)
    _, poses = run(SlamConfig.preset("radar"), np.arange(len(truth)) * 0.1, odometry, azimuths, scans).trajectory()
    length = np.hypot(*(poses[-1] - poses[0])[:2])
    assert abs(length - 40.0) < 0.02 * 40.0


@pytest.mark.skipif(not RADISH.is_dir(), reason=f"no real lidar logs at {RADISH}")
def test_real_lidar_log():
    count = 150
    data = np.load(RADISH / "intel.scans.npz")
    ranges = np.where(data["ranges"] >= data["range_max"], np.inf, data["ranges"]).astype(float)[:count]
    azimuths = data["angle_min"] + data["angle_increment"] * np.arange(ranges.shape[1])

    def tum(name):
        rows = np.loadtxt(RADISH / f"intel.{name}.tum")[:count]
        return np.c_[rows[:, 1:3], 2 * np.arctan2(rows[:, 6], rows[:, 7])]

    odometry, truth = tum("odometry"), tum("truth")
    slam = run(SlamConfig(), np.arange(count) * 1.0, odometry, azimuths, ranges)
    assert ate(truth, slam.trajectory()[1]) < ate(truth, odometry) / 5


@pytest.mark.skipif(not RADISH.is_dir(), reason=f"no real lidar logs at {RADISH}")
def test_missed_loops_are_found_at_the_end():
    log = Log.read(RADISH / "csail.scans.npz", RADISH / "csail.odometry.tum")
    count, rng = len(log.times), np.random.default_rng(7)
    rng.permutation(count - 1)
    # A third of the scans is removed, and with them, for this seed, a loop within the search window.
    kept = np.sort(rng.permutation(count)[: 2 * count // 3])
    slam = Slam()
    replace(log, times=log.times[kept], ranges=log.ranges[kept]).feed(slam)
    truth = planar(read_tum(RADISH / "csail.truth.tum")[1])[kept]
    assert ate(truth, slam.trajectory()[1]) < 0.3


# --- invalid input -----------------------------------------------------------------------------------
AZIMUTHS = np.radians(np.arange(-90.0, 90.0, 2.0))


def test_no_input():
    slam = Slam()
    slam.finish()
    times, poses = slam.trajectory()
    assert times.shape == (0,) and poses.shape == (0, 3)
    assert (slam.map().image() == 205).all()


def test_odometry_without_scans():
    slam = Slam()
    slam.add_odometry(0.0, np.zeros(3))
    slam.add_odometry(1.0, np.ones(3))
    slam.finish()
    assert len(slam.trajectory()[0]) == 0


def test_scans_without_odometry_are_matched_to_each_other():
    room = np.concatenate([box(0, 0, 6.03, 4.04), box(4, 3, 4.5, 3.3), box(3, 0.6, 3.4, 0.9)])
    azimuths = np.radians(np.arange(-120.0, 120.0, 1.0))
    truth = np.array([[1.5 + 0.1 * k, 1.5, 0.03 * k] for k in range(12)])
    slam = Slam()
    for k, pose in enumerate(truth):
        slam.add_scan(float(k), azimuths, scan(room, pose, azimuths))
    assert len(slam.trajectory()[0]) == 0  # scans wait for odometry
    slam.finish()
    _, poses = slam.trajectory()
    assert len(poses) == 12
    np.testing.assert_allclose(between(poses[0], poses[-1]), between(truth[0], truth[-1]), atol=0.06)


def test_empty_and_nan_scans_follow_odometry():
    slam = Slam()
    for k in range(8):
        slam.add_odometry(float(k), np.array([k, 0.5 * k, 0.1]))
        slam.add_scan(float(k), AZIMUTHS, np.full(len(AZIMUTHS), np.nan if k % 2 else np.inf))
    slam.add_odometry(8.0, np.array([8, 4, 0.1]))
    slam.add_scan(8.0, np.zeros(0), np.zeros(0))
    slam.finish()
    _, poses = slam.trajectory()
    np.testing.assert_allclose(poses, [[k, 0.5 * k, 0.1] for k in range(9)], atol=1e-6)


def test_late_entries_are_dropped_and_counted():
    slam = Slam()
    for time in (0.0, 1.0, 0.5, 1.0, 2.0):
        slam.add_odometry(time, np.array([time, 0, 0]))
    ranges = scan(ring(), np.array([1.5, 1.5, 0]), AZIMUTHS)
    for time in (0.2, 1.2, 1.1, 1.2, 1.9):
        slam.add_scan(time, AZIMUTHS, ranges)
    slam.finish()
    assert slam.skipped == {"odometry": 2, "scans": 2}
    np.testing.assert_allclose(slam.trajectory()[0], [0.2, 1.2, 1.9])


def test_scans_beyond_odometry_and_a_jump_in_time():
    slam = Slam(SlamConfig(matcher={"enabled": False}, loop={"enabled": False}))
    for time in (10.0, 11.0, 5000.0):
        slam.add_odometry(time, np.array([time - 10, 0, 0]) if time < 100 else np.array([2.0, 0, 0]))
    ranges = scan(ring(), np.array([1.5, 1.5, 0]), AZIMUTHS)
    for time in (9.0, 10.5, 5000.0, 5001.0):
        slam.add_scan(time, AZIMUTHS, ranges)
    slam.finish()
    times, poses = slam.trajectory()
    np.testing.assert_allclose(times, [9, 10.5, 5000, 5001])
    np.testing.assert_allclose(poses[:, 0], [0, 0.5, 2, 2], atol=1e-6)


def test_bad_values_are_named():
    slam = Slam()
    with pytest.raises(InputError, match="pose is"):
        slam.add_odometry(0.0, np.array([0, np.nan, 0]))
    with pytest.raises(InputError, match="covariance is"):
        slam.add_odometry(0.0, np.zeros(3), -np.eye(3))
    with pytest.raises(InputError, match="expected one each"):
        slam.add_scan(0.0, np.zeros(3), np.zeros(4))
    with pytest.raises(InputError, match="time is nan"):
        slam.add_scan(np.nan, np.zeros(3), np.zeros(3))


def test_interleaving_does_not_matter():
    truth = np.array([[1.5 + 0.4 * k, 1.5, 0.0] for k in range(10)])
    scans = [scan(ring(), p, AZIMUTHS, 12.0) for p in truth]
    first, second = Slam(), Slam()
    for k in range(10):
        first.add_odometry(float(k), truth[k])
        first.add_scan(float(k), AZIMUTHS, scans[k])
        second.add_scan(float(k), AZIMUTHS, scans[k])
    for k in range(10):
        second.add_odometry(float(k), truth[k])
    first.finish()
    second.finish()
    np.testing.assert_array_equal(first.trajectory()[1], second.trajectory()[1])


@pytest.mark.parametrize("name", PRESETS)
def test_presets_survive_a_round_trip(name):
    config = SlamConfig.preset(name)
    assert SlamConfig.model_validate_json(config.model_dump_json()) == config


def test_standing_still_takes_no_nodes_and_hardly_any_memory():
    """Less than 20 MB per hour at 30 Hz, by the slope; and the map stays valid for the walk after it."""
    config, rng = SlamConfig.preset("radar"), np.random.default_rng(0)
    azimuths = np.radians(np.linspace(-44, 44, 12))
    wall = 3 / np.cos(azimuths)
    slam, taken, pose = Slam(config), {}, np.zeros(3)

    def push(k, step):
        nonlocal pose
        pose = compose(pose, step)
        slam.add_odometry(k / 30, pose, np.diag([1e-6, 1e-6, 1e-8]))
        slam.add_scan(k / 30, azimuths, wall + rng.normal(0, 0.02, len(wall)))

    tracemalloc.start()
    for k in range(900):
        push(k, rng.normal(0, [1e-4, 1e-4, 1e-5]))
        if k in (300, 899):
            gc.collect()  # free lists are not kept memory
            taken[k] = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert (taken[899] - taken[300]) / 599 * 108_000 < 20e6
    assert len(slam.nodes) == 1
    spread = slam.odometry.motion(slam.nodes[0].time, 899 / 30)[1]
    assert spread[0, 0] == pytest.approx(900e-6, rel=0.1)  # the covariances of all steps are included
    for k in range(900, 960):
        push(k, np.array([0.02, 0, 0]))
    slam.finish()
    times, poses = slam.trajectory()
    assert len(times) == 960 and len(slam.nodes) > 3
    assert poses[-1] == pytest.approx(pose, abs=0.1) and np.abs(poses[:900, :2]).max() < 0.1
