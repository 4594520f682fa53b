"""Windows equal those of scipy.signal."""

import numpy as np
import pytest
from scipy.signal import windows as reference

from radarize.radar.windows import periodic, taylor


@pytest.mark.parametrize("count", [1, 3, 4, 8, 12, 32, 96, 255])
def test_windows_are_those_of_scipy(count):
    for found, wanted in (
        (np.hanning(count), reference.hann(count)),
        (periodic(np.hanning, count), reference.hann(count, sym=False)),
        (np.hamming(count), reference.hamming(count)),
        (periodic(np.blackman, count), reference.blackman(count, sym=False)),
        (taylor(count), reference.taylor(count, nbar=4, sll=25)),
        (taylor(count, 6, 40.0), reference.taylor(count, nbar=6, sll=40)),
    ):
        assert found.shape == (count,)
        assert np.abs(found - wanted).max() < 1e-14


def test_one_or_two_antennas_have_no_sidelobes():
    assert taylor(1).tolist() == [1.0] and taylor(2).tolist() == [1.0, 1.0]
