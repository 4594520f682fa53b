"""Pictures of a post and of a wall's flash along a known walk."""

import numpy as np
import pytest

pytest.importorskip("radarize.baselines", reason="RadarHD's walks are read by a plug-in")
from benchmarks.parallax import _FAR, followed, row, strong  # noqa: E402
from radarize.signal.polar import AZIMUTHS, RANGES  # noqa: E402


def picture(echoes):
    """Of echoes at ranges (m) and bearings (rad), 25 deg wide."""
    level = np.zeros((len(RANGES), len(AZIMUTHS)))
    for away, bearing in echoes:
        shape = np.exp(-(((RANGES[:, None] - away - _FAR) / 0.06) ** 2) - ((AZIMUTHS - bearing) / np.radians(18)) ** 2)
        level = np.maximum(level, 250 * shape)
    return level.astype(np.uint8)


def test_cells_have_their_places():
    (found,) = strong(picture([(2.0, np.radians(20.5))]))
    assert found == pytest.approx([2.0, np.radians(20.5)], abs=0.025)
    assert not len(strong(np.full((256, 64), 100, np.uint8)))


def test_a_post_moves_by_its_parallax_and_a_flash_does_not():
    """Walking to the left past a wall 3 m ahead and a post, swinging by 20 deg."""
    time = 0.05 * np.arange(100)
    poses = np.stack([np.zeros(100), 0.6 * time, np.radians(20) * np.sin(1.5 * time)], axis=1)
    pictures = [picture([(3.0, -yaw), (np.hypot(2.0, 1.5 - y), np.arctan2(1.5 - y, 2.0) - yaw)]) for _, y, yaw in poses]
    found = list(followed(iter(pictures), poses))
    shares = sorted(each.share() for each in found if np.isfinite(each.share()))
    assert shares == pytest.approx([0.0, 1.0], abs=0.1)
    table = row("two", found)
    assert table["-0.2 to 0.2, %"] + table["0.75 to 1.25, %"] == pytest.approx(100)
    poses[:10] = np.nan  # not known: the rest is as before
    shares = sorted(each.share() for each in followed(iter(pictures), poses) if np.isfinite(each.share()))
    assert shares == pytest.approx([0.0, 1.0], abs=0.1)
