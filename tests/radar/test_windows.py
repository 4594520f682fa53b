"""Windows are those of scipy.signal."""

import numpy as np
import pytest
from scipy.signal import windows as reference

from radarize.radar import windows


@pytest.mark.parametrize("count", [1, 3, 4, 8, 12, 32, 96, 255])
def test_windows_are_those_of_scipy(count):
    for found, wanted in (
        (windows.hann(count), reference.hann(count)),
        (windows.hann(count, periodic=True), reference.hann(count, sym=False)),
        (windows.hamming(count), reference.hamming(count)),
        (windows.blackman(count), reference.blackman(count)),
        (windows.blackman(count, periodic=True), reference.blackman(count, sym=False)),
        (windows.taylor(count), reference.taylor(count, nbar=4, sll=25)),
        (windows.taylor(count, 6, 40.0), reference.taylor(count, nbar=6, sll=40)),
    ):
        assert found.shape == (count,)
        assert np.abs(found - wanted).max() < 1e-14


def test_one_or_two_antennas_have_no_sidelobes():
    assert windows.taylor(1).tolist() == [1.0] and windows.taylor(2).tolist() == [1.0, 1.0]
