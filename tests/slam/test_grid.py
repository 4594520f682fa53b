"""Occupancy grids compared with brute force and an independent reader."""

import numpy as np
import pytest
import yaml
from matplotlib import pyplot

from radarize.io.errors import InputError
from radarize.pipeline.runfolder import OccupancyMap
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid, cross

CONFIG = GridConfig()


def brute_force(start, end):
    """Cells of a densely sampled segment."""
    points = start + np.linspace(0, 1, 40_001)[:, None] * (end - start)
    return {(int(r), int(c)) for c, r in np.unique(np.floor(points).astype(int), axis=0)}


def test_ray_crosses_the_cells_that_dense_sampling_finds():
    rng = np.random.default_rng(1)
    for _ in range(50):
        start, end = rng.uniform(-20, 20, (2, 2))
        out = np.empty((200, 2), np.int64)
        count = cross(*start, *end, out)
        cells = {tuple(c) for c in out[:count].tolist()}
        assert len(cells) == count
        assert tuple(out[0]) == tuple(np.floor(start)[::-1]) and tuple(out[count - 1]) == tuple(np.floor(end)[::-1])
        sampled = brute_force(start, end)
        assert sampled <= cells
        assert len(cells - sampled) <= 2  # a corner clipped by less than the sampling step


@pytest.mark.parametrize("end", [(5.5, 0.5), (-5.5, 0.5), (0.5, 5.5), (0.5, -5.5), (5.5, 5.5), (0.5, 0.5), (3.0, 3.0)])
def test_ray_along_axes_and_diagonals(end):
    out = np.empty((50, 2), np.int64)
    count = cross(0.5, 0.5, *end, out)
    steps = np.abs(np.diff(out[:count], axis=0)).sum(axis=1)
    assert (steps == 1).all()
    assert tuple(out[count - 1]) == (np.floor(end[1]), np.floor(end[0]))


def test_odds_multiply_once_per_cell_and_insertion():
    grid = OccupancyGrid.empty(0.1)
    origins, ends = np.zeros((3, 2)), np.array([[1.03, 0.04], [1.04, 0.05], [2.05, 0.05]])
    hits = np.array([True, True, True])

    def at(x, y):
        row, column = grid.cells(np.array([[x, y]]))[0]
        return grid.probability[row, column]

    grid.insert(origins, ends, hits, CONFIG)
    assert at(1.05, 0.05) == pytest.approx(0.7)  # two hits and a miss in one insertion are one hit
    assert at(0.55, 0.05) == pytest.approx(0.45)
    assert at(0.55, 0.95) == 0
    grid.insert(origins, ends, hits, CONFIG)
    assert at(1.05, 0.05) == pytest.approx(0.49 / (0.49 + 0.09))
    assert at(0.55, 0.05) == pytest.approx(0.45**2 / (0.45**2 + 0.55**2))
    for _ in range(50):
        grid.insert(origins, ends, hits, CONFIG)
    assert at(1.05, 0.05) == pytest.approx(CONFIG.highest) and at(0.55, 0.05) == pytest.approx(CONFIG.lowest)


def test_growing_keeps_what_is_known():
    grid = OccupancyGrid.empty(0.05)
    rng = np.random.default_rng(2)
    ends = rng.uniform(-1, 1, (20, 2))
    grid.insert(np.zeros((20, 2)), ends, np.ones(20, bool), CONFIG)
    before = grid.crop()
    rows, columns = before.probability.shape
    far = np.array([[-30.0, 25.0]])
    grid.insert(far, far + 0.01, np.ones(1, bool), CONFIG)
    corner = grid.cells(before.origin[None] + 1e-9)[0]
    inner = grid.probability[corner[0] : corner[0] + rows, corner[1] : corner[1] + columns]
    np.testing.assert_array_equal(inner, before.probability)


@pytest.mark.parametrize("spread", [False, True])
def test_hits_on_the_edge_of_the_grid(spread):
    # Rays of increasing length end in every last row and column before the grid grows.
    grid = OccupancyGrid.empty(0.1)
    for reach in np.arange(0.5, 9.0, 0.07):
        for direction in np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [0.7, 0.7], [-0.7, -0.7]]):
            grid.insert(np.zeros((1, 2)), reach * direction[None], np.ones(1, bool), CONFIG, spread=spread)
            rows, columns = np.nonzero(grid.probability > 0)
            reached = np.concatenate([columns * 0.1 + grid.origin[0], rows * 0.1 + grid.origin[1]]) + 0.05
            assert np.abs(reached).max() < reach + 0.16  # nothing wraps around


def test_map_files_have_y_up_and_unknown_cells(tmp_path):
    grid = OccupancyGrid.empty(0.1)
    # A wall to the north-east, seen from the origin: lower left free, upper right occupied.
    for _ in range(5):
        grid.insert(np.zeros((1, 2)), np.array([[2.0, 1.0]]), np.ones(1, bool), CONFIG)
    grid = grid.crop(margin=3)
    OccupancyMap.of(grid).save(tmp_path / "map.yaml")
    picture = pyplot.imread(tmp_path / "map.pgm")  # Pillow reads it
    about = yaml.safe_load((tmp_path / "map.yaml").read_text())
    assert about["image"] == "map.pgm" and about["negate"] == 0 and about["resolution"] == 0.1
    assert picture.shape == grid.probability.shape
    # map_server: the origin is the lower left pixel's outer corner, picture row 0 is the largest y.
    ((row, column),) = np.argwhere(picture == 0)
    x = about["origin"][0] + (column + 0.5) * about["resolution"]
    y = about["origin"][1] + (picture.shape[0] - row - 0.5) * about["resolution"]
    assert (x, y) == (pytest.approx(2.0, abs=0.06), pytest.approx(1.0, abs=0.06))
    assert row < picture.shape[0] / 2 and column > picture.shape[1] / 2
    assert set(np.unique(picture)) == {0, 205, 254} and (picture[:3] == 205).all()
    # As map_server thresholds (255 - v) / 255: free, unknown and occupied stay apart.
    level = (255 - np.array([254.0, 205.0, 0.0])) / 255
    assert level[0] < about["free_thresh"] < level[1] < about["occupied_thresh"] < level[2]


def test_an_empty_map_can_be_saved_and_a_bad_place_is_named(tmp_path):
    empty = OccupancyMap.of(OccupancyGrid.empty(0.05).crop(margin=4))
    empty.save(tmp_path / "map.yaml")
    assert (pyplot.imread(tmp_path / "map.pgm") == 205).all()
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(InputError, match="file/map.pgm: cannot be written"):
        empty.save(tmp_path / "file" / "map.yaml")
