"""Raw captures with missing bytes, or with another frame size after some frames."""

import numpy as np
import pytest

from radarize.io.importers import Given, import_recording
from radarize.io.recording import Recording
from radarize.radar.dca1000 import encode
from tests.io.importers.test_import_bin import CONFIG as SMALL

CONFIG = SMALL.model_copy(update={"loops": 16, "samples": 64})
LOOP = CONFIG.frame_bytes // CONFIG.loops


def walk(count: int, config=CONFIG, seed: int = 0) -> np.ndarray:
    """Frames of a radar that moves: the phases of echoes turn with range rate, by loops and over the pause between
    frames."""
    rng = np.random.default_rng(seed)
    loops, tx, rx, samples, _ = config.frame_shape
    beats, speeds = rng.uniform(0.03, 0.3, 12), rng.uniform(-0.4, 0.4, 12)
    gains = (rng.normal(size=(tx, rx, 12)) + 1j * rng.normal(size=(tx, rx, 12))) * rng.uniform(0.2, 1, 12) * 900
    times = (np.arange(count)[:, None] * config.frame_period + np.arange(loops) * config.loop_time)[..., None]
    turns = np.exp(-4j * np.pi / config.wavelength * times * speeds)
    tones = np.exp(2j * np.pi * np.outer(beats, np.arange(samples)))
    signal = np.einsum("ntk,abk,ks->ntabs", turns, gains, tones)
    signal += 60 * rng.normal(size=(*signal.shape, 2)).view(complex)[..., 0]
    return np.stack([signal.real, signal.imag], -1).round().astype(np.int16)


FRAMES = walk(40)
DATA = encode(FRAMES, CONFIG).tobytes()


def imported(tmp_path, data, config=CONFIG):
    (tmp_path / "a.bin").write_bytes(data)
    return Recording(import_recording(tmp_path / "a.bin", tmp_path / "a.h5", Given(config)))


@pytest.mark.parametrize("missing", [1, 7, 1456, 2912, LOOP // 3, 5 * 1456 + 3, 2 * LOOP + 500])
@pytest.mark.parametrize("place", [0.31, 0.53, 0.777])
def test_what_follows_missing_bytes_is_moved_to_where_it_belongs(tmp_path, missing, place):
    at = int(place * len(DATA))
    with imported(tmp_path, DATA[:at] + DATA[at + missing :]) as recording:
        assert f"{missing} bytes or more are missing in 1 place;" in recording.attributes["warnings"]
        adc, valid = recording.adc(0, 99), recording.valid(0, 99)
    assert len(adc) == 40 and np.array_equal(adc[valid], FRAMES[valid])
    lost = np.flatnonzero(~valid.all(axis=2).reshape(-1))
    assert len(lost) <= 4 + -(-missing // LOOP) and lost[0] <= at // LOOP <= lost[-1]


def test_several_gaps(tmp_path):
    data = DATA
    for at, missing in ((0.8, 2912), (0.6, 1), (0.2, 1456)):
        at = int(at * len(DATA)) + 12345
        data = data[:at] + data[at + missing :]
    with imported(tmp_path, data) as recording:
        assert "4369 bytes or more are missing in 3 places" in recording.attributes["warnings"]
        adc, valid = recording.adc(0, 99), recording.valid(0, 99)
    assert len(adc) == 40 and np.array_equal(adc[valid], FRAMES[valid]) and valid.mean() > 0.98


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_moved_where_nothing_is_missing(tmp_path, seed):
    """Neither lost packets filled with zeros nor a disturbed chirp are taken for missing bytes."""
    frames = walk(12, seed=seed)
    frames[3, 4:7] = 0
    frames[6, 9, 1] = np.random.default_rng(seed).integers(-5000, 5000, frames.shape[3:])
    with imported(tmp_path, encode(frames, CONFIG).tobytes()) as recording:
        assert np.array_equal(recording.adc(0, 99), frames) and recording.attributes["warnings"].startswith("9 of 576 ")


@pytest.mark.parametrize("change", [{"samples": 48}, {"tx_order": (0, 2)}])
def test_frames_of_another_size_end_a_capture(tmp_path, change):
    other = CONFIG.model_copy(update=change)
    with imported(tmp_path, DATA[: 20 * CONFIG.frame_bytes] + encode(walk(30, other), other).tobytes()) as recording:
        assert np.array_equal(recording.adc(0, 99)[:20], FRAMES[:20]) and len(recording) <= 21
        warnings = recording.attributes["warnings"]
        period = len(other.tx) * 4 * other.samples
        assert f"on, samples repeat every {period} and not every 768 as before" in warnings
        assert "bytes are left out" in warnings
