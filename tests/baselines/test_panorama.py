"""Panoramas, cell by cell."""

import numpy as np
import pytest

from radarize.baselines.milliego.network import COLUMNS, ROWS
from radarize.baselines.milliego.panorama import panoramas, seen
from radarize.io.recording import Recording
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import DENSE, PointClouds
from tests.baselines.walks_known import walk


def point(depth: float, azimuth: float, elevation: float) -> np.ndarray:
    ahead = depth * np.cos(elevation)
    return np.array([ahead * np.cos(azimuth), ahead * np.sin(azimuth), depth * np.sin(elevation), 0, 20, 10])


def test_left_is_right_of_the_middle_and_up_is_above():
    points = np.array([point(2.0, 0.5, 0.3), point(3.0, -0.5, -0.2), point(4.0, 2.0, 0.0)])
    image = panoramas(points, np.array([0, 2, 2]), 3)
    assert image.shape == (3, ROWS, COLUMNS) and not image[1].any()
    for frame, depth, azimuth, elevation in ((0, 2.0, 0.5, 0.3), (2, 3.0, -0.5, -0.2)):
        rows, columns = np.nonzero(image[frame])
        row, column = ROWS * (0.5 - elevation / (np.pi / 2)), COLUMNS * (0.5 + azimuth / np.radians(120))
        assert np.mean(rows) == pytest.approx(row - 0.5, abs=0.6)
        assert np.mean(columns) == pytest.approx(column - 0.5, abs=0.6)
        assert len(rows) == 15 and image[frame][rows, columns] == pytest.approx(depth / 5)  # the third is outside


def test_the_nearest_point_wins():
    points = np.array([point(3.0, 0, 0), point(1.0, 0, 0), point(2.0, 0, 0)])
    image = panoramas(points, np.zeros(3, int), 1)
    assert image[image > 0] == pytest.approx(0.2)


def test_those_of_a_recording(tmp_path):
    with Recording(walk(tmp_path / "a.h5", frames=70)) as recording:
        found = seen(recording, slice(1, 70, 2))
        heatmaps, clouds = Heatmaps(recording.config), PointClouds(recording.config, DENSE)
        for row in (0, 20, 34):
            frame = 1 + 2 * row
            expected = panoramas(*clouds.of(heatmaps, heatmaps.spectrum(recording.adc(frame, frame + 1))), 1)[0]
            assert found[row] == pytest.approx(expected, abs=1e-3)
        assert len(found) == 35 and found.any()
