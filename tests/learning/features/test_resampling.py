"""Maps of any chirp on the grid of networks: positions, and rows that the radar does not cover."""

import numpy as np
import pytest
import torch

from radarize.learning.features.grid import MapGrid, Resampling
from radarize.learning.features.occupancy import on_grid
from radarize.radar.presets import PRESETS
from radarize.signal.depthlabel import FREE, SURFACE, UNKNOWN
from radarize.signal.maps import AZIMUTHS, MAPS, MapMaker
from tests.echoes import record

KNOWN = PRESETS["radarize"]
OTHERS = {
    "long-range": PRESETS["long-range"],
    "two-tx": PRESETS["two-tx"],
    "radarhd": PRESETS["radarhd"],
    "60 GHz": KNOWN.model_copy(update={"board": "iwr6843isk", "start_frequency": 60e9}),
    "few loops": KNOWN.model_copy(update={"loops": 24}),
}


def grid(rows: int, step: float) -> MapGrid:
    return MapGrid(rows=rows, step=step, azimuths=80, field=1.0, frame_period=0.1)


@pytest.mark.parametrize("own", [grid(60, 0.5), grid(60, 1.0), grid(90, 1.7), grid(400, 0.13)])
@pytest.mark.parametrize("centred", [False, True])
def test_rows_are_means_of_what_is_near(own, centred):
    """Compared with loops in float64; rows that the radar does not cover have the minimum of their column."""
    known = grid(40, 1.0)
    power = np.random.default_rng(0).gamma(2.0, size=(own.rows, 3))
    found = Resampling(known, own, centred)(torch.tensor(10 * np.log10(power)).float()[None, None])[0, 0]
    wide = max(known.step, own.step)
    for row in range(known.rows):
        here = (row - 20 * centred) * known.step
        total, weight = np.zeros(3), 0.0
        for k in range(own.rows):
            near = 1 - abs((k - own.rows // 2 * centred) * own.step - here) / wide
            if near > 0:
                total, weight = total + near * power[k], weight + near
        if weight < 0.5 * wide / own.step:
            total, weight = power.min(axis=0), 1.0
        np.testing.assert_allclose(10 ** (found[row] / 10), total / weight, rtol=1e-4)


def test_the_same_rows_are_left_alone():
    assert Resampling.between(grid(40, 1.0), grid(40, 1.0), False) is None
    assert Resampling.between(grid(40, 1.0), grid(40, 1.005), False) is not None
    assert Resampling.between(grid(40, 1.0), grid(41, 1.0), True) is not None


@pytest.mark.parametrize("name", OTHERS)
def test_an_echo_is_in_the_same_cell_for_every_radar(name):
    """A point at 2.4 m, 20 deg to the left, that the radar approaches at 0.8 m/s, in each map of a radar."""
    azimuth, distance, speed = np.radians(20), 2.4, 0.8
    point = np.array([[distance * np.cos(azimuth), distance * np.sin(azimuth), 0.0]])
    cells = {}
    for each in (KNOWN, OTHERS[name]):
        centre = each.burst_center

        def pose(times, centre=centre):
            place = np.zeros((*np.shape(times), 3))
            place[..., 0] = speed * (times - centre)
            return place, np.zeros(np.shape(times))

        rng = np.random.default_rng(0)
        maps = MapMaker(each)(
            record(each, pose, point, np.array([400.0]), np.zeros(1), rng, noise=5.0), names=tuple(MAPS)
        )
        for which, made in maps.items():
            resampling = Resampling.between(
                MapGrid.of(KNOWN, which), MapGrid.of(each, which), which.startswith("doppler")
            )
            shown = torch.from_numpy(made).float()[:, None]
            shown = shown if resampling is None else resampling(shown)
            assert shown.shape[2:] == MapMaker(KNOWN).shape(which)
            cells.setdefault(which, []).append(np.unravel_index(int(shown[0, 0].argmax()), shown.shape[2:]))
    for which, (own, other) in cells.items():
        # Within a step of the coarser radar: 2 rows of range, or of Doppler; pairs of antennas see a wide beam.
        assert abs(own[0] - other[0]) <= 1, which
        assert abs(AZIMUTHS[own[1]] - AZIMUTHS[other[1]]) < np.radians(4.0 if "aware" in which else 2.0), which
        expected = (
            distance / 0.0446
            if "range" in which or which == "elevation_aware"
            else 16 + speed * np.cos(azimuth) / 0.1146
        )
        assert abs(own[0] - expected) < 1.1, which


def test_what_a_radar_lacks():
    known = grid(40, 1.0)
    for fits in (grid(30, 1.0), grid(1000, 0.1), grid(20, 1.9)):
        assert known.lack(fits, "m") is None
    assert known.lack(grid(30, 2.1), "m") == "bins of 2.1 m, expected at most 2 m"
    assert known.lack(grid(19, 1.0), "m/s") == "a reach of 19 m/s, expected at least 20 m/s"


@pytest.mark.parametrize("own", [grid(60, 1.0), grid(30, 1.9), grid(90, 0.6), grid(200, 0.31)])
def test_labels_of_another_radar(own):
    """Compared with loops: each cell is the nearest one's, and every surface within the range is kept."""
    known = grid(40, 1.0)
    rng = np.random.default_rng(0)
    first = rng.integers(0, own.rows, 50)
    rows = np.arange(own.rows)
    cells = np.where(rows < first[:, None], FREE, np.where(rows == first[:, None], SURFACE, UNKNOWN)).astype(np.uint8)
    found = on_grid(cells[:, :, None], own, known)[:, :, 0]
    for label, surface in zip(found, first, strict=True):
        here = round(surface * own.step / known.step)
        for row in range(known.rows):
            nearest = round(row * known.step / own.step)
            if row == here:
                assert label[row] == SURFACE
            elif nearest >= own.rows:
                assert label[row] == UNKNOWN
            else:
                assert label[row] == (FREE if nearest < surface else SURFACE if nearest == surface else UNKNOWN)
