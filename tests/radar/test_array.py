import numpy as np
import pytest

from radarize.radar.array import azimuth_row, elevation_pairs, row_beside, rows, virtual_positions
from radarize.radar.boards import BOARDS
from radarize.radar.presets import PRESETS
from tests.radars import radar

BASE = PRESETS["radarize"]


def _grid(board: str) -> np.ndarray:
    """Virtual antennas as (left, up) in half wavelengths."""
    config = radar(board)
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


# antGeometryCfg of TI's configurations: rows, counted downward, and columns of TX1 x RX1, RX2, ..., then TX2, ...; and
# the height of a row in half wavelengths.
ROWS_AND_COLUMNS = {
    "awr2944evm": ("1 0 1 1 1 2 1 3 0 2 0 3 0 4 0 5 1 4 1 5 1 6 1 7 1 8 1 9 1 10 1 11", 1.6),
    "iwrl6432boost": ("0 0 1 1 0 2 0 1 1 2 0 3", 1.0),
}


@pytest.mark.parametrize("board", ROWS_AND_COLUMNS)
def test_layouts_agree_with_rows_and_columns(board):
    text, step = ROWS_AND_COLUMNS[board]
    row, column = np.array(text.split(), float).reshape(-1, 2).T
    grid, expected = _grid(board), np.c_[column, -step * row]
    assert grid - grid[0] == pytest.approx(expected - expected[0])


# antenna_geometry.c of TI's SDK 3: (right or left, down) of TX and RX.
TABLES = {
    "awr1642boost": ([(0, 0), (4, 0)], [(0, 0), (1, 0), (2, 0), (3, 0)]),
    "awr1843aop": ([(0, 0), (0, 1), (0, 2)], [(3, 0), (2, 0), (1, 0), (0, 0)]),
    "iwr6843aop": ([(0, 0), (2, 2), (0, 2)], [(1, 1), (1, 0), (0, 1), (0, 0)]),
    "iwr1443boost": ([(0, 1), (2, 0), (4, 1)], [(0, 0), (1, 0), (2, 0), (3, 0)]),
}


@pytest.mark.parametrize("board", TABLES)
def test_layouts_agree_with_the_sdks_tables(board):
    tx, rx = (np.array(table, float) * (1, -1) for table in TABLES[board])
    expected = (tx[:, None] + rx).reshape(-1, 2)
    assert _grid(board) - _grid(board)[0] == pytest.approx(expected - expected[0])


def test_the_low_power_square_is_full():
    grid = _grid("awrl6844evm")
    assert sorted(map(tuple, np.rint(grid).astype(int))) == [(x, y) for x in range(4) for y in range(-3, 1)]
    assert np.array_equal(BOARDS["awrl6844evm"].signs[:, 0], [1, -1, 1, -1])


def test_channels_of_the_low_power_board_are_reversed_by_turns():
    """As in TI's files: compRangeBiasAndRxChanPhase 0.0 1 0 -1 0 1 0 -1 0 1 0 -1 0."""
    assert BOARDS["iwrl6432boost"].nominal_calibration == ((1, 0), (-1, 0)) * 3


def test_rows_less_than_a_wavelength_apart_resolve_elevation():
    """The AWR2944's rows are 0.8 wavelengths apart; every second row of the AOP's column would be one apart."""
    config = radar("awr2944evm")
    pairs, grid = elevation_pairs(config), _grid("awr2944evm")
    assert grid[pairs[:, 1]] - grid[pairs[:, 0]] == pytest.approx(np.tile([0, 1.6], (4, 1)))
    assert len(azimuth_row(config)) == 12 and row_beside(rows(config), 0.0) == 1.6
    assert row_beside([0.0, 2.0], 0.0) is None and row_beside([-1.0, 0.0, 1.0], 0.0) == 1.0
    column = radar("awr1843aop").model_copy(update={"tx_order": (0, 2)})
    assert elevation_pairs(column) is None


@pytest.mark.parametrize("board", ["iwr6843ods", "iwr6843aop"])
def test_planar_arrays_have_rows_of_equal_height(board):
    config = BASE.model_copy(update={"board": board})
    grid = _grid(board)
    for height, members in rows(config).items():
        assert (np.rint(grid[members, 1]) == height).all()
        assert (np.diff(grid[members, 0]) > 0).all()
    pairs = elevation_pairs(config)
    assert grid[pairs[:, 1]] - grid[pairs[:, 0]] == pytest.approx(np.tile([0, 1], (len(pairs), 1)))
