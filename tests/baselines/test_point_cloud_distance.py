"""Chamfer and modified Hausdorff distances of point clouds."""

import numpy as np
import pytest

from radarize.baselines.walks.point_cloud_distance import PointCloudDistance


def test_distances_of_point_clouds():
    """Compare with a brute-force computation, and with a line of points that is shifted by 0.3 m."""
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0, 5, (40, 2)), rng.uniform(0, 5, (70, 2))
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    found = PointCloudDistance.of(a, b)
    assert found.chamfer == pytest.approx((distance.min(axis=1).mean() + distance.min(axis=0).mean()) / 2)
    assert found.hausdorff == pytest.approx(max(np.median(distance.min(axis=1)), np.median(distance.min(axis=0))))
    line = np.stack([np.zeros(50), np.linspace(0, 5, 50)], axis=1)
    moved = PointCloudDistance.of(line, line + [0.3, 0])
    assert moved.chamfer == pytest.approx(0.3) and moved.hausdorff == pytest.approx(0.3)
    assert np.isnan(PointCloudDistance.of(line[:0], line).chamfer)
