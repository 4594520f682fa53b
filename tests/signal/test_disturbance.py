"""Interference in single chirps of a small simulated walk, and receivers that are broken."""

import numpy as np
import pytest

from radarize.odometry.doppler import DopplerVelocity
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor, Signal
from radarize.signal.disturbance import find_flaws
from tests.batches import stream
from tests.echoes import record
from tests.rooms import antenna_gain, furnished_room, walk

CONFIG, FRAMES = PRESETS["radarize"], 12
STAMPS = np.arange(FRAMES) * CONFIG.frame_period
CENTERS = STAMPS + CONFIG.burst_center
pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def tour():
    """Furnished room with a mirror, and leakage at zero range: samples, and true velocities (frame, 2)."""
    rng = np.random.default_rng(0)
    points, amplitudes = furnished_room(rng, density=8.0, boxes=6)
    pose = walk(rng, 2.0)
    points, amplitudes = np.vstack([points, [6.9, 2.5, 0.0]]), np.append(amplitudes, 3000.0)  # a strong echo
    adc = record(CONFIG, pose, points, amplitudes, STAMPS, rng, 20.0, block=32, gain=antenna_gain)
    leakage = 3000 * np.exp(2j * np.pi * 0.3 * np.arange(CONFIG.samples) / CONFIG.samples)
    adc += np.stack([leakage.real, leakage.imag], axis=-1).astype(np.int16)
    ahead, _ = pose(CENTERS + 1e-3)
    back, _ = pose(CENTERS - 1e-3)
    east, north = ((ahead - back) / 2e-3)[:, :2].T
    c, s = np.cos(pose(CENTERS)[1]), np.sin(pose(CENTERS)[1])
    return adc, np.stack([c * east + s * north, c * north - s * east], axis=1)


def disturb(adc, share, burst, seed=1):
    """Add interference to a fraction of the chirps; returns these, too."""
    rng, adc = np.random.default_rng(seed), adc.copy()
    hit = rng.random(adc.shape[:3]) < share
    hit[0, 3, 1] = True
    for place in np.argwhere(hit):
        start, n = rng.integers(0, CONFIG.samples - 40), np.arange(40 if burst == "sweep" else CONFIG.samples)
        start, bend = (start, 0.02) if burst == "sweep" else (0, 0.0)
        if burst == "noise":
            wave = rng.normal(0, 800, (4, len(n))) + 1j * rng.normal(0, 800, (4, len(n)))
        else:
            wave = 1000 * np.exp(1j * (rng.uniform(0, 6) * n + bend * n**2 + rng.uniform(0, 6, (4, 1))))
        part = (*place, slice(None), slice(start, start + len(n)))
        adc[part] += np.stack([wave.real, wave.imag], axis=-1).astype(np.int16)
    return adc, hit


def speeds(adc):
    preprocessor = Preprocessor(Signal(CONFIG))
    method = DopplerVelocity(preprocessor.signal.heatmaps)
    found = [method.estimate(batch).velocity for batch in stream(preprocessor, adc, STAMPS)]
    return np.concatenate(found), preprocessor


def rms(error):
    return np.sqrt((error**2).mean())


@pytest.mark.parametrize("burst", ["sweep", "tone", "noise"])
@pytest.mark.parametrize("share", [0.01, 0.05])
def test_disturbed_chirps_are_left_out_and_cost_little(tour, share, burst):
    adc, truth = tour
    hurt, hit = disturb(adc, share, burst)
    clean, preprocessor = speeds(adc)
    assert preprocessor.disturbed == 0
    found, preprocessor = speeds(hurt)
    seen = find_flaws(hurt, np.ones(hit.shape, bool)).disturbed
    assert not (seen & ~hit).any() and preprocessor.disturbed == seen.sum()
    assert seen.sum() >= 0.95 * hit.sum()  # a tone at a strong echo's frequency is lost in it
    assert rms(found - truth) < 1.5 * rms(clean - truth) + 0.005


def test_chirps_left_as_they_are_cost_much(tour, monkeypatch):
    """Without the correction the error exceeds the limit of the test above."""
    adc, truth = tour
    monkeypatch.setattr("radarize.signal.disturbance._OFF", np.inf)
    left = speeds(disturb(adc, 0.05, "sweep")[0])[0]
    assert rms(left - truth) > 1.5 * rms(speeds(adc)[0] - truth) + 0.005


def test_lost_chirps_have_no_say(tour):
    adc, _ = tour
    hurt, hit = disturb(adc, 0.05, "sweep")
    valid = np.random.default_rng(2).random(hit.shape) > 0.3
    valid[3], valid[4, :, 1], valid[5, 5:] = False, False, False
    hurt[~valid] = 30000
    expected = hit & valid
    expected[5] = False  # too few are left for an estimate
    assert np.array_equal(find_flaws(hurt, valid).disturbed, expected)


def test_broken_receivers(tour):
    adc, _ = tour
    valid = np.ones(adc.shape[:3], bool)
    flaws = find_flaws(adc, valid)
    assert not flaws.dead.any() and not flaws.saturated.any()
    broken = adc.copy()
    broken[2:, :, :, 1] = np.random.default_rng(3).normal(0, 20, broken[2:, :, :, 1].shape)
    broken[:, :, :, 3] = np.clip(30 * broken[:, :, :, 3].astype(int), -32768, 32767)
    flaws = find_flaws(broken, valid)
    assert np.argwhere(flaws.dead).tolist() == [[k, 1] for k in range(2, FRAMES)]
    assert np.array_equal(flaws.saturated, np.tile([False, False, False, True], (FRAMES, 1)))
