"""Candidate arrays of a check, for any number of antennas."""

import numpy as np
import pytest

from radarize.pipeline.check.array import _orders, band, candidates
from radarize.pipeline.check.evidence import Evidence
from radarize.pipeline.check.planewaves import Reading, fit_plane_waves
from radarize.radar.array import virtual_positions
from radarize.radar.boards import BOARDS
from radarize.radar.presets import PRESETS
from radarize.signal.snapshots import Snapshots

RADAR = PRESETS["radarize"]


@pytest.mark.parametrize("order", [((0, 2), 1), ((0, 1), 2, 0), (0, 2, 1)])
def test_transmitters_at_once_stand_in_the_middle(order):
    """Waves over the positions of `virtual_positions` are plane, also where transmitters fire at once."""
    config = RADAR.changed("radar", tx_order=order)
    rng = np.random.default_rng(0)
    directions, speed = rng.uniform(-0.5, 0.5, (300, 2)), rng.uniform(-1, 1, 300)
    reading = Reading.of(config)
    way = virtual_positions(config)[..., 1:] @ directions.T  # (tx, rx, cell)
    late = np.asarray(config.slot)[:, None] * config.chirp_time * speed
    phase = 2 * np.pi / config.wavelength * (-way - 2 * late[:, None])
    channels = np.moveaxis(np.exp(1j * phase) / reading.sign[..., None], -1, 0).astype(np.complex64)
    cells = Snapshots(np.zeros(300, int), np.ones(300), speed, np.ones(300), channels)
    assert np.median(fit_plane_waves(cells, reading).purity) > 0.97
    assert all(np.isfinite(each.reading.places).all() for each in candidates(config))


def test_of_many_antennas_not_every_order_is_tried():
    assert sum(each.kind == "receiver order" for each in candidates(RADAR)) == 23
    many = _orders(12)
    assert len(many) == len(set(many)) == 12 * 11 // 2 + 1 and all(sorted(each) == [*range(12)] for each in many)


def test_boards_with_the_same_antennas_are_named_together():
    """The likeliest one first; the boards of the other band are none of them."""
    config = RADAR.changed("radar", board="awr1843aop")
    remedies = [each.remedy for each in candidates(config) if each.kind == "board"]
    assert remedies[0] == "import it with --board iwr1843boost (the same antennas: awr2243boost, iwr1443boost)"
    assert not any("iwr6843" in remedy for remedy in remedies)
    assert len({board for remedy in remedies for board in BOARDS if board in remedy}) >= 3
    assert not any("1843boost" in each.remedy for each in candidates(RADAR) if each.kind == "board")


def test_a_board_of_another_band_is_found():
    """With the same antennas it is corrected; otherwise all boards of the band are named."""

    def found(board: str, start_frequency: float):
        config = RADAR.changed("radar", board=board, start_frequency=start_frequency)
        none = np.zeros((0, *config.frame_shape), np.int16)
        evidence = Evidence(config, np.zeros(0), np.ones((0, *config.frame_shape[:2]), bool), lambda a, b: none[a:b])
        return list(band(evidence))

    assert not found("iwr1843boost", 77e9) and not found("iwr6843isk", 60e9)
    (same,) = found("iwr6843isk", 77e9)
    assert same.kind == "board" and same.measured.startswith("chirps start at 77 GHz, but the iwr6843isk has 60-64 GHz")
    assert "--board iwr1843boost (the same antennas: awr2243boost, iwr1443boost)" in same.remedy
    assert same.correction.config.board == "iwr1843boost"
    (other,) = found("iwr6843aop", 77e9)
    assert other.correction is None and "such as iwr1843boost, awr1642boost, awr1843aop" in other.remedy
    (low,) = found("iwr1843boost", 60e9)
    assert low.correction.config.board == "iwr6843isk" and low.remedy == "import it with --board iwr6843isk"
