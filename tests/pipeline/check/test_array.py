"""Candidate arrays of a check, for any number of antennas."""

import numpy as np
import pytest

from radarize.pipeline.check.array import _orders, candidates
from radarize.pipeline.check.planewaves import Reading, fit_plane_waves
from radarize.radar.array import virtual_positions
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
