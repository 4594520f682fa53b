"""How far point clouds are apart."""

import numpy as np
import pytest

from radarize.baselines.walks.clouds import Apart


def test_measures_of_points():
    """Against brute force; and a cloud that is 0.3 m off is 0.3 m off."""
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0, 5, (40, 2)), rng.uniform(0, 5, (70, 2))
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    found = Apart.of(a, b)
    assert found.chamfer == pytest.approx((apart.min(axis=1).mean() + apart.min(axis=0).mean()) / 2)
    assert found.hausdorff == pytest.approx(max(np.median(apart.min(axis=1)), np.median(apart.min(axis=0))))
    line = np.stack([np.zeros(50), np.linspace(0, 5, 50)], axis=1)
    moved = Apart.of(line, line + [0.3, 0])
    assert moved.chamfer == pytest.approx(0.3) and moved.hausdorff == pytest.approx(0.3)
    assert np.isnan(Apart.of(line[:0], line).chamfer)
