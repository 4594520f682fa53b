"""The registry: every name makes something that works, and what cannot work says why."""

import numpy as np
import pytest

from radarize.errors import InputError
from radarize.heatmaps import Heatmaps
from radarize.mapping.scans import BEARINGS, HeatmapScans
from radarize.methods.registry import BEST, CLASSICAL, ODOMETRY, SCANS, Inputs, Method, Weights, best_methods
from radarize.pipeline import Pipeline
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"]


@pytest.fixture(scope="module")
def noise():
    """Samples of three frames, and their stamps."""
    adc = np.random.default_rng(0).integers(-100, 100, (3, *CONFIG.frame_shape), dtype=np.int16)
    return adc, np.arange(3) * CONFIG.frame_period


@pytest.mark.parametrize("name", SCANS)
def test_every_scan_has_a_range_for_every_bearing(name, noise):
    inputs = Inputs(CONFIG, scans=name)
    ranges = inputs.scanner().scan(inputs.heatmaps.spectrum(noise[0]))
    assert ranges.shape == (3, len(BEARINGS)) and not np.isnan(ranges).any()
    assert inputs.scanner() is inputs.scanner(name)


def test_scans_are_made_once_a_batch(noise, monkeypatch):
    asked = []

    class Counts:
        def scan(self, spectrum):
            asked.append(spectrum)
            return np.full((len(spectrum), len(BEARINGS)), np.inf)

    monkeypatch.setitem(SCANS, "counts", Method("counts", lambda inputs: Counts()))
    inputs = Inputs(CONFIG, scans="counts")
    odometry, spectrum = inputs.odometry("scan-matching"), inputs.heatmaps.spectrum(noise[0])
    odometry.follow(spectrum, noise[1])
    assert len(inputs.scanner().scan(spectrum)) == 3 and len(asked) == 1
    inputs.scanner().scan(inputs.heatmaps.spectrum(noise[0]))
    assert len(asked) == 2


def test_pipelines_beside_each_other_share_what_they_can(noise, monkeypatch):
    """Odometry moves on once a batch, scan matching once for each method of scans, and lost frames are told alike."""
    spectra, asked = [], []
    whole, scan = Heatmaps.spectrum, HeatmapScans.scan
    monkeypatch.setattr(Heatmaps, "spectrum", lambda *of: spectra.append(1) or whole(*of))
    monkeypatch.setattr(HeatmapScans, "scan", lambda self, of: asked.append(self.method) or scan(self, of))
    pairs = [(o, s) for o in ("doppler", "scan-matching") for s in ("first-echo", "threshold")]
    beside, alone = [], [Pipeline(CONFIG, scans, odometry) for odometry, scans in pairs]
    for odometry, scans in pairs:
        beside.append(Pipeline(CONFIG, scans, odometry, beside=beside[0] if beside else None))
    adc, times = noise
    adc = np.concatenate([adc, 0 * adc[:1]])
    times = np.arange(4) * CONFIG.frame_period
    for k in range(2):
        batch = adc.copy(), times + k
        for pipeline in beside:
            pipeline.push(*batch)
    assert len(spectra) == 2 and sorted(asked) == 2 * ["first-echo"] + 2 * ["threshold"]
    assert beside[0].odometry is beside[1].odometry and beside[2].odometry is not beside[3].odometry
    samples = np.empty_like(adc)
    for pipeline in alone:
        for k in range(2):
            samples[:] = adc  # a pipeline alone may be given the same memory again
            pipeline.push(samples, times + k)
    assert len(spectra) == 2 + 8
    for one, other in zip(beside, alone, strict=True):
        assert one.lost == other.lost == 2 and one.pushed == 8
        assert np.array_equal(np.concatenate(one.poses), np.concatenate(other.poses))
        assert np.array_equal(np.concatenate(one.ranges), np.concatenate(other.ranges))


def test_unknown_names():
    with pytest.raises(InputError, match="odometry is 'wheel', expected one of fused, learned, doppler"):
        Inputs(CONFIG).odometry("wheel")
    with pytest.raises(InputError, match="scans is 'lidar', expected one of segmentation"):
        Inputs(CONFIG, scans="lidar").scanner()


def test_networks_where_they_fit_and_classical_methods_elsewhere(tmp_path):
    assert best_methods(CONFIG) == (BEST, "")
    coarse = CONFIG.model_copy(update={"loops": CONFIG.loops // 2})
    methods, why = best_methods(coarse)
    assert methods == CLASSICAL and "translation.safetensors: does not fit this radar" in why
    with pytest.raises(InputError, match="does not fit this radar"):
        Inputs(coarse).odometry("fused")
    with pytest.raises(InputError, match="translation.safetensors: no such file"):
        Inputs(CONFIG, Weights(tmp_path)).odometry("learned")


def test_every_choice_is_in_the_registry():
    for choice in (BEST, CLASSICAL):
        assert choice["odometry"] in ODOMETRY and choice["scans"] in SCANS
