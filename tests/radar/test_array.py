import numpy as np
import pytest

from radarize.radar.array import azimuth_row, elevation_pairs, rows, virtual_positions
from radarize.radar.boards import BOARDS
from radarize.radar.presets import PRESETS

BASE = PRESETS["radarize"]


def _grid(board: str) -> np.ndarray:
    """Virtual antennas as (left, up) in half wavelengths."""
    config = BASE.model_copy(update={"board": board})
    half = 299792458 / BOARDS[board].design_frequency / 2
    return virtual_positions(config).reshape(-1, 3)[:, 1:] / half


def test_the_1843_has_eight_antennas_in_a_row_and_four_above():
    grid = _grid("iwr1843boost")
    assert grid[azimuth_row(BASE)] == pytest.approx(np.c_[np.arange(8), np.zeros(8)])
    assert grid[4:8] == pytest.approx(np.c_[np.arange(2, 6), np.ones(4)])
    pairs = elevation_pairs(BASE)
    assert len(pairs) == 4
    assert grid[pairs[:, 1]] - grid[pairs[:, 0]] == pytest.approx(np.tile([0, 1], (4, 1)))


# TI's people-counting configurations, antGeometry0 (to the right) and antGeometry1 (up), TX1 x RX1..4, TX2 ..., TX3 ...
TI = {
    "iwr6843isk": ("0 -1 -2 -3 -2 -3 -4 -5 -4 -5 -6 -7", "-1 -1 -1 -1 0 0 0 0 -1 -1 -1 -1"),
    "iwr6843ods": ("0 0 -1 -1 -2 -2 -3 -3 -2 -2 -3 -3", "0 -1 -1 0 0 -1 -1 0 -2 -3 -3 -2"),
    "iwr6843aop": ("-1 -1 0 0 -3 -3 -2 -2 -1 -1 0 0", "-1 0 -1 0 -3 -2 -3 -2 -3 -2 -3 -2"),
}


@pytest.mark.parametrize("board", TI)
def test_layouts_agree_with_tis_configurations(board):
    right, up = (np.array(text.split(), float) for text in TI[board])
    grid, expected = _grid(board), np.c_[-right, up]
    assert grid - grid[0] == pytest.approx(expected - expected[0])


@pytest.mark.parametrize("board", ["iwr6843ods", "iwr6843aop"])
def test_planar_arrays_have_rows_of_equal_height(board):
    config = BASE.model_copy(update={"board": board})
    grid = _grid(board)
    for height, members in rows(config).items():
        assert (np.rint(grid[members, 1]) == height).all()
        assert (np.diff(grid[members, 0]) > 0).all()
    pairs = elevation_pairs(config)
    assert grid[pairs[:, 1]] - grid[pairs[:, 0]] == pytest.approx(np.tile([0, 1], (len(pairs), 1)))
