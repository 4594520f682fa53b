"""The pictures by which simulated rooms are held against real ones."""

import numpy as np
import pytest

from benchmarks.realism import CONFIG, picture, shares
from radarize.radar.config import SPEED_OF_LIGHT
from radarsim.physics.antenna import ISOTROPIC
from radarsim.physics.finder import EchoFinder
from radarsim.physics.scatterers import Scatterers
from tests.physics.rigs import Rig, burst


def samples(*targets):
    """Counts of one frame with targets of a range (m), sine of azimuth and radar cross section (m^2) each."""
    places = np.array([[r * np.sqrt(1 - s * s), r * s, 0.0] for r, s, _ in targets])
    things = Scatterers.points(places, np.array([size for *_, size in targets]))
    echoes = EchoFinder(None, things, None, CONFIG, antenna=ISOTROPIC)(np.zeros(3), np.eye(3))
    signal = burst(CONFIG, echoes, Rig())
    counts = 2000 * signal / np.abs(signal).max()
    return np.stack([counts.real, counts.imag], axis=-1).round().astype(np.int16)


def test_the_chirps_are_those_of_the_walks():
    assert SPEED_OF_LIGHT / 2 / CONFIG.slope * CONFIG.sample_rate == pytest.approx(21.59, abs=0.01)


def test_an_echo_lights_its_cell():
    """And all azimuths of its range by sidelobes, no range two metres off."""
    kept = picture(samples((4.0, 0.0, 1.0)))
    ranges, azimuths = np.linspace(0, 10.8, 256), np.linspace(-90, 90, 64)
    at, ahead = np.argmin(np.abs(ranges - 4.0)), np.argmin(np.abs(azimuths))
    assert kept[at - 1 : at + 2, ahead - 1 : ahead + 2].any()
    assert not kept[np.abs(ranges - 4.0) > 2].any()
    assert not kept[:, np.abs(azimuths) > 72].any()


@pytest.mark.parametrize(("below", "seen"), [(20, True), (35, False)])
def test_cells_down_to_26_dB_are_kept(below, seen):
    far = (2**4) * 10 ** (-below / 10)  # twice as far: 12 dB
    kept = picture(samples((3.0, 0.0, 1.0), (6.0, 0.0, far)))
    assert kept[np.abs(np.linspace(0, 10.8, 256) - 6.0) < 0.1].any() == seen


def test_echoes_in_the_first_bins_count_for_nothing():
    kept = picture(samples((0.12, 0.0, 1.0), (3.0, 0.0, 1.0)))
    assert not kept[:6].any()


def test_shares():
    kept = np.zeros((2, 256, 64), bool)
    kept[0, 10, :16] = kept[1, 20, :32] = True
    assert shares(kept) == pytest.approx((48 / 2 / 256 / 64, 1 / 256, 24 / 64))
