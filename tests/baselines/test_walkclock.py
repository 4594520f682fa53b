"""Clocks of a radar and a lidar beside it."""

import lzma
from pathlib import Path

import numpy as np
import pytest

from radarize.baselines.walks.clock import Clock
from radarize.io.errors import InputError
from radarize.signal import polar
from tests.baselines.twoclocks import MadeUp

FRAMES = 400


@pytest.mark.parametrize(("first", "rate"), [(0.0, 1.0), (-48.0, 1.08), (5.0, 1.025), (20.0, 0.95)])
def test_a_line_is_found(first, rate):
    """Within two frames at either end, where pictures of one number are up to 48 frames apart."""
    walk = MadeUp(Path(), 7, FRAMES, first, rate)
    clock = Clock.of(walk)
    ends = np.array([0, FRAMES - 1])
    assert clock.lidar(ends) == pytest.approx(first + rate * ends, abs=2)
    assert clock.told and clock.doubt < 4 and clock.alike > 0.3 and clock.alike >= clock.paired


def test_who_stands_or_hardly_walked_tells_no_clock():
    """Pictures are then taken as they are numbered."""
    for walk in (MadeUp(Path(), 7, FRAMES, -48.0, 1.08, speed=0.0), MadeUp(Path(), 7, 200, -48.0, 1.08)):
        clock = Clock.of(walk)
        assert (clock.first, clock.rate) == (0.0, 1.0) and not clock.told


def test_worlds_that_differ_tell_no_clock():
    """A lidar's pictures of another walk."""

    class Strangers(MadeUp):
        def lidar(self, frame: int) -> np.ndarray:
            return np.random.default_rng(frame).random((polar.ROWS, polar.BEAMS)) < 0.002

    clock = Clock.of(Strangers(Path(), 7, FRAMES))
    assert (clock.first, clock.rate) == (0.0, 1.0) and clock.alike < 0.1


def test_predictions_that_unpack_without_end(tmp_path, monkeypatch):
    from radarize.baselines.walks import walks

    monkeypatch.setattr(walks, "_LARGEST", 1 << 23)
    (tmp_path / "1.npz.xz").write_bytes(lzma.compress(bytes(1 << 24), preset=0))
    with pytest.raises(InputError, match="more than"):
        walks._packed(tmp_path / "1.npz.xz")
