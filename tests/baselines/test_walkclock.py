"""Estimation of the clock between a radar and a lidar on the same rig."""

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
    """The error is within two frames at either end; frames of equal index are up to 48 frames apart in time."""
    walk = MadeUp(Path(), 7, FRAMES, first, rate)
    clock = Clock.of(walk)
    ends = np.array([0, FRAMES - 1])
    assert clock.lidar(ends) == pytest.approx(first + rate * ends, abs=2)
    assert (
        clock.estimated
        and clock.halves_differ < 4
        and clock.correlation > 0.3
        and clock.correlation >= clock.correlation_by_index
    )


def test_clock_is_not_estimated_without_motion_or_from_few_frames():
    """Frames are then matched by index."""
    for walk in (MadeUp(Path(), 7, FRAMES, -48.0, 1.08, speed=0.0), MadeUp(Path(), 7, 200, -48.0, 1.08)):
        clock = Clock.of(walk)
        assert (clock.first, clock.rate) == (0.0, 1.0) and not clock.estimated


def test_clock_is_not_estimated_from_uncorrelated_pictures():
    """The lidar's pictures are random."""

    class Strangers(MadeUp):
        def lidar(self, frame: int) -> np.ndarray:
            return np.random.default_rng(frame).random((polar.ROWS, polar.BEAMS)) < 0.002

    clock = Clock.of(Strangers(Path(), 7, FRAMES))
    assert (clock.first, clock.rate) == (0.0, 1.0) and clock.correlation < 0.1


def test_predictions_that_unpack_to_too_many_bytes_are_refused(tmp_path, monkeypatch):
    from radarize.baselines.walks import walks

    monkeypatch.setattr(walks, "_LARGEST", 1 << 23)
    (tmp_path / "1.npz.xz").write_bytes(lzma.compress(bytes(1 << 24), preset=0))
    with pytest.raises(InputError, match="more than"):
        walks._packed(tmp_path / "1.npz.xz")
