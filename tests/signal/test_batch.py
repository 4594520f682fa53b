"""Batches: selection of frames, and caching of products."""

import numpy as np
import pytest
import torch

from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from radarize.signal.batch import LEAST_SHARE, Preprocessor, Signal
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import PointClouds
from tests.batches import batch, stream

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 16})
FRAMES = 12


@pytest.fixture(scope="module")
def signal():
    return Signal(CONFIG)


@pytest.fixture(scope="module")
def adc():
    return np.random.default_rng(0).integers(-99, 99, (FRAMES, *CONFIG.frame_shape), dtype=np.int16)


def test_what_is_made_is_made_once(signal, adc, monkeypatch):
    """Each product is computed once per batch; methods of two objects have separate products."""
    asked = []
    for where, name in ((Heatmaps, "spectrum"), (PointClouds, "of")):
        whole = getattr(where, name)
        monkeypatch.setattr(where, name, lambda *of, whole=whole, name=name: asked.append(name) or whole(*of))
    third = batch(signal, adc[:3], np.arange(3))
    assert not asked and third.spectrum is third.spectrum and third.points is third.points
    assert asked == ["spectrum", "of"]
    assert torch.equal(third.spectrum, signal.heatmaps.spectrum(adc[:3]))


def test_losses_are_passed_to_the_spectrum(signal, adc):
    valid = np.ones((3, 16, 3), bool)
    valid[1, 2:] = False
    found = batch(signal, adc[:3], np.arange(3), valid).spectrum
    assert torch.equal(found, signal.heatmaps.spectrum(adc[:3], valid))
    assert not torch.equal(found[1], signal.heatmaps.spectrum(adc[1:2])[0])


@pytest.mark.parametrize("size", [1, 5, FRAMES])
def test_lost_frames_are_left_out(signal, adc, size):
    """Frames without signal, lost, or nearly lost; numbers count them."""
    adc, valid = adc.copy(), np.ones((FRAMES, 16, 3), bool)
    stamps = 10.0 + np.cumsum(np.linspace(0.02, 0.045, FRAMES))
    adc[0] = 0
    valid[4:7] = False
    valid[9].flat[round(48 * LEAST_SHARE) - 1 :] = False
    valid[10].flat[round(48 * LEAST_SHARE) :] = False
    preprocessor = Preprocessor(signal)
    batches = list(stream(preprocessor, adc, stamps, valid, size))
    used = np.array([1, 2, 3, 7, 8, 10, 11])
    assert (preprocessor.taken, preprocessor.lost) == (FRAMES, 5)
    assert [bool(one) for one in batches] == [len(one) > 0 for one in batches]
    numbers, centers = (np.concatenate([getattr(one, name) for one in batches]) for name in ("numbers", "centers"))
    assert numbers.tolist() == used.tolist()
    assert centers == pytest.approx(stamps[used] + CONFIG.burst_center)
    assert np.array_equal(np.concatenate([one.samples for one in batches]), adc[used])
    assert np.array_equal(np.concatenate([one.valid for one in batches]), valid[used])


@pytest.mark.parametrize("size", [1, 2, 5, FRAMES])
def test_every_third_frame(signal, adc, size):
    """The same frames for any batch size, by the radar's own numbers if frames are missing; only lost ones among them
    are counted."""
    valid, numbers = np.ones((FRAMES, 16, 3), bool), np.delete(np.arange(FRAMES + 2), [3, 7])
    valid[[4, 5]] = False  # numbers 5, 6
    for sent, taken, lost, used in ((np.arange(FRAMES), 4, 0, [0, 3, 6, 9]), (numbers, 4, 1, [0, 9, 12])):
        some, stamps = sent is numbers, 1.7e9 + sent * CONFIG.frame_period
        preprocessor = Preprocessor(Signal(CONFIG.every(3)), every=3)
        parts = [slice(start, start + size) for start in range(0, FRAMES, size)]
        kept = [preprocessor.process(adc[at], stamps[at], valid[at] if some else None) for at in parts]
        assert (preprocessor.taken, preprocessor.lost) == (taken, lost)
        assert np.concatenate([one.numbers for one in kept]).tolist() == used
        rows = np.searchsorted(sent, used)
        assert preprocessor.numbering.missing == (2 if some else 0)
        assert np.array_equal(np.concatenate([one.samples for one in kept]), adc[rows])
        assert np.array_equal(np.concatenate([one.stamps for one in kept]), stamps[rows])
    with pytest.raises(InputError, match="every is 0, expected 1"):
        CONFIG.every(0)


def test_batches_keep_their_samples(signal, adc):
    """A reader may use its memory again."""
    lent = adc[:2].copy()
    taken = Preprocessor(signal).process(lent, np.arange(2.0))
    lent[:] = 1
    assert np.array_equal(taken.samples, adc[:2])


def test_maps_alone(signal):
    """A batch of maps returns them unchanged, and raises an error for other products."""
    shown = np.arange(24.0).reshape(2, 3, 4)
    preprocessor = Preprocessor(signal)
    first, second = (
        preprocessor.process_maps({"picture": shown}, CONFIG.frame_period * np.array([k, k + 1])) for k in (5, 7)
    )
    assert np.array_equal(first.maps(("picture",))["picture"], shown) and len(first) == 2
    assert np.array_equal(second.numbers, [2, 3]) and len(second) == 2 and preprocessor.lost == 0
    stamps = CONFIG.frame_period * np.array([5, 6])
    third = Preprocessor(Signal(CONFIG.every(2)), every=2).process_maps({"picture": shown}, stamps)
    assert np.array_equal(third.maps(("picture",))["picture"], shown[:1]) and third.stamps.tolist() == [stamps[0]]
    with pytest.raises(InputError, match=r"frames from 0.233 s on have no samples, only picture"):
        _ = second.spectrum
