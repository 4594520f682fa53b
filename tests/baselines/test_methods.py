"""The registry of methods: every name makes a working method, results are cached, and errors state their reason."""

from dataclasses import replace

import numpy as np
import pytest

from radarize.io.errors import InputError
from radarize.learning.task import TASKS, find_task
from radarize.odometry.doppler import DopplerVelocity, Velocities
from radarize.odometry.fused import FusedVelocity
from radarize.pipeline.method import Inputs, Method, Weights
from radarize.pipeline.methods import (
    BEST,
    CLASSICAL,
    ODOMETRY,
    PICTURED,
    SCANS,
    best_methods,
    make_odometry,
    make_pipeline,
    make_scans,
    pace,
)
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor
from radarize.signal.bearings import BEARINGS
from radarize.signal.heatmaps import Heatmaps
from tests.batches import batch

CONFIG = PRESETS["radarize"]


@pytest.fixture(scope="module")
def noise():
    """Samples of three frames, and their stamps."""
    adc = np.random.default_rng(0).integers(-100, 100, (3, *CONFIG.frame_shape), dtype=np.int16)
    return adc, np.arange(3) * CONFIG.frame_period


@pytest.mark.parametrize("name", [name for name in SCANS if name != "published"])  # which has no weights
def test_every_scan_has_a_range_for_every_bearing(name, noise):
    inputs = Inputs(CONFIG)
    ranges = make_scans(inputs, name).extract(batch(inputs.signal, *noise))
    assert ranges.shape == (3, len(BEARINGS)) and not np.isnan(ranges).any()


def test_scans_are_made_once_a_batch(noise, monkeypatch):
    """Though the odometry asks for them, too."""
    asked = []

    class Counts:
        def extract(self, batch):
            asked.append(batch)
            return np.full((len(batch), len(BEARINGS)), np.inf)

    monkeypatch.setitem(SCANS, "counts", Method("counts", lambda inputs: Counts()))
    inputs = Inputs(CONFIG)
    pipeline = make_pipeline(inputs, "scan-matching", "counts")
    first, second = batch(inputs.signal, *noise), batch(inputs.signal, noise[0], noise[1] + 1)
    assert len(pipeline.push(first).ranges) == 3 and asked == [first]
    pipeline.push(second)
    assert asked == [first, second]


def test_pipelines_of_one_batch_do_not_disturb_each_other(noise, monkeypatch):
    """Spectra of a batch are made once, and what comes out of each pipeline is what it gives alone."""
    spectra, whole = [], Heatmaps.spectrum
    monkeypatch.setattr(Heatmaps, "spectrum", lambda *of: spectra.append(1) or whole(*of))
    pairs = [(o, s) for o in ("doppler", "scan-matching") for s in ("first-echo", "threshold")]
    inputs = Inputs(CONFIG)
    preprocessor = Preprocessor(inputs.signal)
    shared = [make_pipeline(inputs, *pair) for pair in pairs]
    adc = np.concatenate([noise[0], 0 * noise[0][:1]])
    times = np.arange(4) * CONFIG.frame_period
    together = [[] for _ in pairs]
    for k in range(2):
        taken = preprocessor.process(adc, times + 4 * k * CONFIG.frame_period)
        for pipeline, results in zip(shared, together, strict=True):
            results.append(pipeline.push(taken))
    assert len(spectra) == 2 and preprocessor.lost == 2 and preprocessor.taken == 8
    samples = np.empty_like(adc)
    for pair, pipeline, results in zip(pairs, shared, together, strict=True):
        own = Inputs(CONFIG)
        alone, preprocessor = make_pipeline(own, *pair), Preprocessor(own.signal)
        for k, result in enumerate(results):
            samples[:] = adc  # a reader may use the same memory again
            other = alone.push(preprocessor.process(samples, times + 4 * k * CONFIG.frame_period))
            assert np.array_equal(result.frames, other.frames) and list(other.frames) == [4 * k, 4 * k + 1, 4 * k + 2]
            assert np.array_equal(result.ranges, other.ranges)
            here, there = (vars(each.track) | vars(each.track.errors) for each in (result, other))
            for name in here.keys() - {"errors"}:
                assert np.array_equal(here[name], there[name]), name
        assert np.array_equal(pipeline.slam.trajectory()[1], alone.slam.trajectory()[1])


def test_unknown_names():
    inputs = Inputs(CONFIG)
    with pytest.raises(InputError, match="odometry is 'wheel', expected one of doppler, doppler-ransac, fused"):
        make_odometry(inputs, "wheel")
    with pytest.raises(InputError, match="scans is 'lidar', expected one of cfar, elevation-aware, first-echo"):
        make_scans(inputs, "lidar")
    with pytest.raises(InputError, match="scans is 'lidar', expected one of cfar"):
        make_pipeline(inputs, "scan-matching", "lidar")
    with pytest.raises(InputError, match="task is 'flight', expected one of milliego, .*translation"):
        find_task("flight")


def test_networks_where_they_fit_and_classical_methods_elsewhere(tmp_path):
    assert best_methods(CONFIG) == (BEST, "")
    coarse = CONFIG.model_copy(update={"loops": CONFIG.loops // 3})
    assert best_methods(coarse) == (BEST, "")  # the network of velocities does not fit, and is not needed
    methods, why = best_methods(PRESETS["two-tx"].model_copy(update={"loops": PRESETS["two-tx"].loops // 4}))
    assert methods == {"odometry": CLASSICAL["odometry"], "scans": BEST["scans"]}
    assert "translation.safetensors: does not fit this radar" in why and "segmentation" not in why
    with pytest.raises(InputError, match="does not fit this radar"):
        make_odometry(Inputs(coarse), "learned")
    assert best_methods(CONFIG.model_copy(update={"tx_order": (0,), "rx": (0, 1)}))[0] == CLASSICAL
    assert best_methods(PRESETS["two-tx"]) == best_methods(PRESETS["long-range"]) == (BEST, "")
    with pytest.raises(InputError, match="translation.safetensors: no such file"):
        make_odometry(Inputs(CONFIG, weights=Weights(tmp_path)), "learned")


def test_frames_come_as_often_as_networks_need_them():
    """15 Hz, or the next higher rate that the radar provides; all frames if yaw rates are from the map alone."""
    periods = {1: (1 / 15, 0.1, 1 / 20), 2: (33.333e-3, 1 / 30, 1 / 40), 4: (1 / 60,)}
    for every, many in periods.items():
        assert {pace("fused", CONFIG.model_copy(update={"frame_period": period})) for period in many} == {every}
    assert pace("doppler", CONFIG) == 1
    with pytest.raises(InputError, match="odometry is 'magic', expected one of doppler"):
        pace("magic", CONFIG)


def test_velocities_are_the_networks_too_where_the_array_tells_little(monkeypatch):
    """Without elevation, or in short rows. With a whole array the network is asked where least squares are unsure, and
    not missed where it does not fit."""

    def velocity(config):
        return make_odometry(Inputs(config), "fused").velocity

    aop = CONFIG.model_copy(update={"board": "iwr6843aop", "start_frequency": 60e9})
    assert velocity(PRESETS["two-tx"]).always and velocity(aop).always
    assert isinstance(velocity(CONFIG.model_copy(update={"loops": CONFIG.loops // 3})), DopplerVelocity)
    whole, estimate = velocity(CONFIG), np.zeros((4, 2))
    spread = np.array([0.01, 0.02, 0.2, 0.04])[:, None, None] ** 2 * np.eye(2)
    sure, asked = Velocities(estimate, spread, np.full(4, 9), np.ones(4, bool)), []
    monkeypatch.setattr(whole.doppler, "estimate", lambda batch: sure)
    monkeypatch.setattr(
        whole.learned, "estimate", lambda batch, which: asked.append(which) or replace(sure, seen=which)
    )
    found = whole.estimate(None)
    assert isinstance(whole, FusedVelocity) and asked[0].tolist() == [False, False, True, True]
    before, after = (np.diagonal(each, axis1=1, axis2=2) for each in (spread, found.covariance))
    assert after[:2] == pytest.approx(before[:2], rel=1e-3) and (after[2:] < 0.6 * before[2:]).all()


def test_without_weights_methods_are_classical(tmp_path, monkeypatch):
    monkeypatch.setattr(Weights, "of", lambda self, kind: tmp_path / f"{kind}.safetensors")
    methods, why = best_methods(CONFIG)
    assert methods == CLASSICAL and "rotation.safetensors: no such file" in why


def test_every_choice_is_in_the_registry():
    for choice in (BEST, CLASSICAL, PICTURED):
        assert choice["odometry"] in ODOMETRY and choice["scans"] in SCANS


def test_every_method_loads_and_every_network_has_a_task():
    """Whose weights go by the name that the method asks for."""
    for method in (*ODOMETRY.values(), *SCANS.values()):
        assert callable(method.make) and method.title
        for kind in method.networks:
            assert kind in TASKS
    for name in TASKS:
        network = find_task(name).network
        assert name == network.kind if network.setting == "corrected" else name == f"published-{network.kind}"
