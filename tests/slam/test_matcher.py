"""Matching and correlative search: known offsets of both signs, and agreement with brute force."""

import itertools

import numpy as np
import pytest

from radarize.io.pose import transform, wrap
from radarize.slam.config import GridConfig
from radarize.slam.correlation import Pyramid, scatter, search
from radarize.slam.grid import OccupancyGrid
from radarize.slam.matcher import interpolate, match, thin
from tests.slam.world import box, ring, scan

# Shift off the raster of the grid: rounding decides for a wall exactly between two cells.
SHIFT = np.array([0.03, 0.036])
WALLS = ring() + np.tile(SHIFT, 2)
AZIMUTHS = np.radians(np.arange(-90.0, 90.0, 0.5))
CONFIG = GridConfig()


def hits(pose, walls=None, noise=0.0, rng=None):
    r = np.nan_to_num(scan(WALLS if walls is None else walls, pose, AZIMUTHS, 10.0), posinf=99.0)
    if noise:
        r = r + rng.normal(0, noise, r.shape)
    seen = r < 90
    return (r[:, None] * np.stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS)], axis=-1))[seen]


def submap(poses, walls=None):
    grid = OccupancyGrid.empty(0.05)
    for pose in poses:
        ends = transform(pose, hits(pose, walls))
        grid.insert(np.broadcast_to(pose[:2], ends.shape), ends, np.ones(len(ends), bool), CONFIG, spread=True)
    return grid


POSES = np.array([[1.5 + 0.1 * k, 1.5, 0.05 * k] for k in range(8)])
GRID = submap(POSES)


@pytest.mark.parametrize(
    "offset",
    [*np.diag([0.08, 0.08, 0.04]), *-np.diag([0.08, 0.08, 0.04]), np.array([0.07, -0.06, 0.03])],
)
def test_match_recovers_an_offset(offset):
    truth = np.array([1.83, 1.47, 0.12])
    result = match(GRID, thin(hits(truth), 0.05), truth + offset, sigma=1.0)
    assert np.hypot(*(result.pose - truth)[:2]) < 0.02  # cells are 0.05
    assert abs(wrap(result.pose[2] - truth[2])) < 0.004
    assert result.score > 0.6
    eigenvalues = np.linalg.eigvalsh(result.information)
    assert eigenvalues[0] > 0


def test_gradient_of_the_interpolation():
    rng = np.random.default_rng(3)
    plane = rng.random((12, 9)).astype(np.float64)
    for x, y in rng.uniform(2, 7, (50, 2)):
        h = 1e-6
        value, gx, gy = interpolate(plane, x, y)
        east, west = interpolate(plane, x + h, y)[0], interpolate(plane, x - h, y)[0]
        north, south = interpolate(plane, x, y + h)[0], interpolate(plane, x, y - h)[0]
        assert gx == pytest.approx((east - west) / (2 * h), abs=1e-6)
        assert gy == pytest.approx((north - south) / (2 * h), abs=1e-6)
        assert 0 <= value <= 2 * plane.max() - 1


def test_the_prior_holds_along_a_corridor():
    walls = np.array([[-100.0, -1.01, 100, -1.01], [-100, 1.02, 100, 1.02]])
    grid = submap(np.array([[0.1 * k, 0.0, 0.0] for k in range(8)]), walls)
    points = thin(hits(np.zeros(3), walls), 0.05)
    prior, covariance = np.array([0.3, 0.05, 0.02]), np.diag([0.02, 0.1, 0.1]) ** 2
    result = match(grid, points, prior, sigma=1.0, prior=prior, covariance=covariance)
    assert result.pose[0] == pytest.approx(0.3, abs=0.01)  # along: odometry
    assert abs(result.pose[1]) < 0.015 and abs(result.pose[2]) < 0.005  # across: the walls
    assert result.information[0, 0] < 0.2 * result.information[1, 1]


def test_search_agrees_with_brute_force():
    rng = np.random.default_rng(5)
    truth = np.array([1.9, 1.5, 0.2])
    points = hits(truth, noise=0.03, rng=rng)[::6]
    pyramid = Pyramid.of(GRID, 4, 0.6)
    base = np.rint(255 * GRID.probability).astype(np.uint8)
    for guess in (truth + [0.31, -0.24, 0.1], truth + [-0.42, 0.13, -0.08]):
        for penalty in ((0.0, 0.0), (0.4, 0.6)):
            found = search(pyramid, points, guess, distance=0.6, angle=0.15, min_score=0.2, penalty=penalty)
            step = GRID.resolution / max(np.sort(np.hypot(*points.T))[int(0.9 * (len(points) - 1))], 1.0)
            turns = int(np.ceil(0.15 / step))
            best = 0.0
            for turn, dx, dy in itertools.product(range(-turns, turns + 1), range(-12, 13), range(-12, 13)):
                pose = guess + [0, 0, turn * step]
                cells = np.floor((transform(pose, points) - GRID.origin) / GRID.resolution).astype(int) + [dx, dy]
                inside = ((cells >= 0) & (cells < base.shape[::-1])).all(axis=1)
                score = base[cells[inside, 1], cells[inside, 0]].sum() / 255 / len(points)
                score -= penalty[0] * (dx * dx + dy * dy) * GRID.resolution**2 + penalty[1] * (turn * step) ** 2
                best = max(best, score)
            assert found is not None
            assert found[1] == pytest.approx(best, abs=1e-9)
            if not any(penalty):
                assert np.hypot(*(found[0] - truth)[:2]) < 0.1 and abs(found[0][2] - truth[2]) < 0.03


def test_the_other_side_of_a_wall_does_not_match():
    corridor = np.array([[-5.0, -1.01, 5.0, -1.01], [-5.0, 1.01, 5.0, 1.01]])
    left, right = corridor[1:], corridor[:1]
    grid = submap(np.array([[0.2 * k, 0.0, 0.0] for k in range(5)]), right)  # only the right wall was seen
    ends = hits(np.zeros(3), left)
    fronts = ends * (1 - 0.25 / np.linalg.norm(ends, axis=1))[:, None]
    window = {"distance": 2.5, "angle": 0.1, "min_score": 0.5}
    wrong = search(Pyramid.of(grid, 5, 2.5), ends, np.zeros(3), **window)
    assert wrong is not None and wrong[0][1] == pytest.approx(-2.02, abs=0.1)  # it fits, with an error of 2 m
    pyramid = Pyramid.of(grid, 5, 2.5, free=True)
    assert search(pyramid, ends, np.zeros(3), fronts=fronts, **window) is None
    ends = hits(np.zeros(3), right)
    fronts = ends * (1 - 0.25 / np.linalg.norm(ends, axis=1))[:, None]
    found = search(pyramid, ends, np.array([0.1, 0.2, 0.02]), fronts=fronts, **window)
    assert found is not None and abs(found[0][1]) < 0.08 and found[1] > 0.7


def spread(walls, seen, pose, sigma=1.0):
    """Scatter of points (n, 2), seen from the pose, in a submap of walls given as points (n, 2)."""
    grid = OccupancyGrid.empty(0.05)
    for _ in range(4):
        grid.insert(np.zeros_like(walls), walls, np.ones(len(walls), bool), CONFIG, spread=True)
    seen = transform(np.array([0, 0, -pose[2]]), seen - pose[:2])
    return scatter(Pyramid.of(grid, 0, 1.5), seen, pose, distance=1.5, angle=0.25, sigma=sigma)


def test_scatter_is_large_along_a_wall():
    along = np.arange(-4, 4, 0.04)
    wall = np.stack([along, np.full_like(along, 1.02)], axis=-1)
    part = wall[np.abs(along) < 1.5]
    corner = np.concatenate([part, part[:, ::-1] + [-2.0, 0]])
    alone = spread(wall, part, np.array([0, 0, 0.0]))
    turned = spread(wall, part, np.array([0, 0, np.pi / 2]))
    assert alone[0, 0] > 1.5**2  # all poses along the wall fit equally
    assert alone[1, 1] < 0.05**2 and alone[2, 2] < 0.05**2
    np.testing.assert_allclose(turned[[0, 1], [0, 1]], alone[[1, 0], [1, 0]], rtol=1e-6)  # in the scan's frame
    both = spread(np.concatenate([wall, wall[:, ::-1] + [-2.0, 0]]), corner, np.array([0, 0, 0.0]))
    assert np.sqrt(both[[0, 1, 2], [0, 1, 2]]).max() < 0.05


def test_scatter_includes_a_second_mode():
    pillar = np.stack(np.meshgrid(0.025 + 0.05 * np.arange(5), 1.025 + 0.05 * np.arange(5)), axis=-1).reshape(-1, 2)
    walls = np.concatenate([pillar, pillar + [0.9, 0]])
    one, two = spread(pillar, pillar, np.zeros(3), sigma=0.3), spread(walls, pillar, np.zeros(3), sigma=0.3)
    assert one[0, 0] < 0.1**2
    # Half of the weight is 0.9 m away, and the moment is taken about the matched pose.
    assert 0.55 < np.sqrt(two[0, 0]) < 1.0


def test_matching_with_quantised_grids():
    truth = np.array([1.83, 1.47, 0.12])
    points = thin(hits(truth), 0.05)
    small = GRID.quantised()
    assert small.probability.dtype == np.uint8 and small.probability.nbytes * 4 == GRID.probability.nbytes
    fine, coarse = (match(g, points, truth + [0.05, 0.04, 0.02], sigma=1.0) for g in (GRID, small))
    np.testing.assert_allclose(fine.pose, coarse.pose, atol=2e-3)
    assert fine.score == pytest.approx(coarse.score, abs=5e-3)


def test_search_without_a_match():
    elsewhere = hits(np.array([0.0, 0.0, 0.3]), box(-1.3, -0.8, 1.1, 1.0))
    pyramid = Pyramid.of(GRID, 5, 2.0)
    assert search(pyramid, elsewhere, POSES[3], distance=2.0, angle=0.3, min_score=0.6) is None
    assert search(pyramid, np.zeros((0, 2)), POSES[3], distance=2.0, angle=0.3, min_score=0.6) is None


def test_thinning_leaves_one_mean_per_square():
    points = np.array([[0.01, 0.01], [0.03, 0.01], [0.07, 0.01], [-0.01, 0.01]])
    got = thin(points, 0.05)
    assert sorted(map(tuple, got.round(6))) == [(-0.01, 0.01), (0.02, 0.01), (0.07, 0.01)]
    assert thin(np.zeros((0, 2)), 0.05).shape == (0, 2)
