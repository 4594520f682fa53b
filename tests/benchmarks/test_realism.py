"""How much of a picture is filled."""

import numpy as np
import pytest

from benchmarks.realism import CONFIG, shares
from radarize.radar.config import SPEED_OF_LIGHT


def test_the_chirps_are_those_of_the_walks():
    assert SPEED_OF_LIGHT / 2 / CONFIG.slope * CONFIG.sample_rate == pytest.approx(21.59, abs=0.01)


def test_shares():
    kept = np.zeros((2, 256, 64), bool)
    kept[0, 10, :16] = kept[1, 20, :32] = True
    assert shares(kept) == pytest.approx((48 / 2 / 256 / 64, 1 / 256, 24 / 64))
