"""The occupancy label of depth pictures against closed forms."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarize.signal.depthlabel import AZIMUTHS, FREE, SURFACE, UNKNOWN, occupancy

CONFIG = PRESETS["radarize"].model_copy(update={"range_bias": 0.1})
FX, FY, CX, CY = PINHOLE = np.array([423.993, 423.993, 432.966, 50.938])


def wall(x: float, y_from: float) -> np.ndarray:
    """Picture of a wall square to the boresight at `x` m, left of `y_from` m (left positive), as high as the view."""
    column = np.arange(848)
    left = -(column - CX) / FX * x
    depth = np.where(left >= y_from, x * 1000, 0)
    return np.tile(depth, (1, 100, 1)).astype(np.uint16)


def test_a_wall_stands_at_its_distance_on_the_bearings_where_it_is():
    label = occupancy(wall(2.0, 0.3), PINHOLE, CONFIG)[0]
    end = np.arctan(0.3 / 2.0)
    for k, azimuth in enumerate(AZIMUTHS[:-1]):  # the last column lies half outside the picture
        if azimuth < end - np.radians(1.0):
            assert (label[:, k] == UNKNOWN).all()
        elif azimuth > end + np.radians(1.0):
            cells = np.flatnonzero(label[:, k] == SURFACE)
            expected = (2.0 / np.cos(azimuth) + CONFIG.range_bias) / CONFIG.range_resolution
            assert np.abs(cells - expected).max() <= 1.0, (k, cells, expected)
            assert (label[: cells[0], k] == FREE).all() and (label[cells[-1] + 1 :, k] == UNKNOWN).all()


def test_points_off_the_axis_are_left_out():
    """A box on the floor, 10 cm below the axis, hides no wall; noise of single pixels neither."""
    picture = wall(2.0, -9.0)
    picture[:, 90:] = 600  # (90 - 51) / 424 * 0.6 m = 5.5 cm below
    picture[:, 48, ::3] = 700
    label = occupancy(picture, PINHOLE, CONFIG)[0]
    assert np.flatnonzero(label[:, 44] == SURFACE) == pytest.approx([47], abs=1)


def test_beyond_the_last_bin_all_is_free():
    assert (occupancy(wall(6.0, -9.0), PINHOLE, CONFIG)[0][:, 10:80] == FREE).all()


def test_no_value_is_unknown():
    assert (occupancy(np.zeros((2, 100, 848), np.uint16), PINHOLE, CONFIG) == UNKNOWN).all()
