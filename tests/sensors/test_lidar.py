"""Lidar beside the radar against closed forms: a wall, a post to the left, objects outside its slab."""

import numpy as np
import pytest

from radarize.signal import polar
from radarsim.motion.trajectory import Motion
from radarsim.sensors.lidar import Lidar
from tests.sensors.mounting import beside, box, rows

WALL = box("wall", [2.0, -20, 0], [2.2, 20, 3])


def picture(motion: Motion, *objects) -> np.ndarray:
    found = rows(Lidar(beside(motion, *objects)), 0, 1)["truth/lidar"][0]
    return np.unpackbits(found, axis=1).astype(bool)


@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (0.15, -0.2)])
def test_a_wall_is_where_it_is(pitch, roll):
    """On every azimuth at the correct distance, at any tilt of the sensor, and never behind the wall."""
    found = picture(Motion.still((0, 0, 1), pitch=pitch, roll=roll), WALL)
    for column, azimuth in enumerate(polar.BEAM_AZIMUTHS):
        rows = np.flatnonzero(found[:, column])
        expected = 2.0 / max(np.cos(azimuth), 1e-9)
        # Beams that go up and down meet it a little farther off; a column's beams lie up to a pixel's width before it.
        slack = 0.05 + expected * np.tan(abs(azimuth)) * np.radians(0.36) + 0.3**2 / 2 / expected
        if expected < 9:
            assert len(rows) and abs(polar.RANGES[rows] - expected).max() < slack + 0.05
        elif expected > 11:
            assert not len(rows)


def test_left_is_in_later_columns_and_the_slab_is_thin():
    low = box("box", [1.5, -0.5, 0], [1.7, 0.5, 0.6])  # 0.4 m below the lidar
    found = picture(Motion.still((0, 0, 1)), box("post", [1.9, 0.6, 0], [2.1, 0.8, 3]), low)
    rows, columns = np.nonzero(found)
    assert len(rows) and np.all(np.degrees(polar.BEAM_AZIMUTHS[columns]) > 14)
    assert np.all(polar.RANGES[rows] > 1.9)
