"""Free space of a map against what true beams passed through."""

import numpy as np
import pytest

from radarize.evaluation.mapping import free_space_iou
from radarize.pipeline.runfolder import OccupancyMap
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid

AZIMUTHS = np.radians(np.arange(-180.0, 180.0, 0.5))


def disc(folder, radius):
    """A map of a round room about (0, 0)."""
    grid, ends = OccupancyGrid.empty(0.05), radius * np.stack([np.cos(AZIMUTHS), np.sin(AZIMUTHS)], axis=-1)
    for _ in range(6):
        grid.insert(np.zeros_like(ends), ends, np.ones(len(ends), bool), GridConfig())
    return OccupancyMap.read(OccupancyMap.of(grid).save(folder / "map.yaml"))


@pytest.mark.parametrize("radius, expected", [(2.0, 1.0), (1.5, 0.5625), (2.5, 0.64)])
def test_overlap_of_discs_in_frames_turned_against_each_other(tmp_path, radius, expected):
    angle, shift = 0.7, np.array([4.0, -3.0, 0.0])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    ranges = np.full((1, len(AZIMUTHS)), 2.0)
    iou = free_space_iou(disc(tmp_path, radius), turn, shift, shift[None, :2], np.zeros(1), AZIMUTHS, ranges)
    assert iou == pytest.approx(expected, abs=0.08)  # a cell's width all round


def test_no_overlap_and_nothing_seen(tmp_path):
    grid, away = disc(tmp_path, 2.0), np.array([[9.0, 9.0]])
    ranges = np.full((1, len(AZIMUTHS)), 2.0)
    assert free_space_iou(grid, np.eye(3), np.zeros(3), away, np.zeros(1), AZIMUTHS, ranges) == 0
    nothing = np.full_like(ranges, np.inf)
    assert np.isnan(free_space_iou(grid, np.eye(3), np.zeros(3), away, np.zeros(1), AZIMUTHS, nothing))
