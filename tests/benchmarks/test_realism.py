"""Statistics of pictures, and the discriminator of real and simulated pictures."""

import numpy as np
import pytest

from benchmarks.likeness import discriminator, statistics
from benchmarks.likeness.pictures import CONFIG, TIMES, buildings
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.signal import polar


def test_the_chirps_are_those_of_the_walks():
    assert SPEED_OF_LIGHT / 2 / CONFIG.slope * CONFIG.sample_rate == pytest.approx(21.59, abs=0.01)


def test_shares():
    kept = np.zeros((2, 256, 64), bool)
    kept[0, 10, :16] = kept[1, 20, :32] = True
    assert statistics.shares(kept) == pytest.approx((48 / 2 / 256 / 64, 1 / 256, 24 / 64))


def dots(rows, columns, greys):
    """A picture of single cells."""
    picture = np.zeros((polar.ROWS, polar.COLUMNS), np.uint8)
    picture[rows, columns] = greys
    return picture


def test_peaks_and_their_change():
    """Three points: one decreases by 51 grey levels (5.2 dB), one moves by a row, and one vanishes."""
    first, later = dots([50, 100, 200], [10, 30, 50], [255, 153, 204]), dots([50, 101], [10, 30], [255, 102])
    bursts = np.stack([[first, *[later] * 4]])
    found = statistics.of(bursts)
    assert found["peaks within 10 dB"] == pytest.approx((2 + 4 * 1) / 5)  # -5.2 dB is one, -10.4 dB none
    assert found["peaks within 26 dB"] == pytest.approx((3 + 4 * 2) / 5)
    assert found[f"found after {TIMES[1]:.2g} s %"] == pytest.approx(100 * 2 / 3)
    assert found[f"change in {TIMES[1]:.2g} s dB"] == pytest.approx(statistics.DEPTH * 0.2 / np.sqrt(2), rel=0.01)
    assert found["cells kept %"] == pytest.approx(100 * 11 / 5 / polar.ROWS / polar.COLUMNS)


@pytest.mark.parametrize(("fewer", "accuracy"), [(0, (0.2, 0.8)), (40, (0.95, 1.0))])
def test_the_discriminator(monkeypatch, fewer, accuracy):
    """On test walks, pictures of 60 points are distinguished from those of 20 points, but not from others of 60
    points."""
    monkeypatch.setattr(discriminator, "EPOCHS", 8)
    rng = np.random.default_rng(0)

    def walk(count):
        pictures = np.zeros((16, 1, 64 * 32), np.uint8)
        for picture in pictures:
            picture[0, rng.choice(64 * 32, count, replace=False)] = 255
        return pictures.reshape(16, 1, 64, 32)

    judged = discriminator.judge([walk(60) for _ in range(10)], [walk(60 - fewer) for _ in range(10)], 1)
    assert accuracy[0] <= judged.accuracy.mean() <= accuracy[1]
    assert len(judged.real) == len(judged.simulated) == 10 and all(len(each) == 16 for each in judged.simulated)


def test_every_building_is_another():
    names = [about["name"] for about in buildings(25, 4000)]
    assert len(set(names)) == 25 and {name.split()[1] for name in names} == set("ABCD")
