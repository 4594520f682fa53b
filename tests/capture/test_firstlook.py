"""Check of a stream's first seconds."""

import numpy as np

from radarize.capture import firstlook
from radarize.capture.firstlook import FirstLook
from radarize.radar.presets import PRESETS

RADAR = PRESETS["radarize"]


def looked(frames: int) -> FirstLook:
    look = FirstLook(RADAR)
    rng = np.random.default_rng(0)
    for k in range(frames):
        adc = rng.integers(-100, 100, (1, *RADAR.frame_shape)).astype(np.int16)
        look.add(adc, np.array([k * RADAR.frame_period]), np.ones((1, *RADAR.frame_shape[:2]), bool))
    look.finish()
    return look


def test_noise_is_named_once_the_stream_ends():
    assert any("noise" in words for words in looked(12).warnings())


def test_a_failing_check_is_reported(monkeypatch):
    def fails(evidence):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(firstlook, "check_evidence", fails)
    assert looked(3).warnings() == ["the first seconds could not be checked (division by zero)"]


def test_without_frames_there_is_no_remark():
    assert looked(0).warnings() == []
