"""Wrong returns by path types of a recording; missed surfaces."""

import h5py
import numpy as np
import pytest

from radarize.evaluation.scans import true_ranges
from radarize.evaluation.stress import SOURCES, missed, sources
from radarize.io.recording import Product, RecordingWriter, Stream
from radarize.pipeline.runfolder.reader import Scans
from radarize.radar.presets import PRESETS
from tests.evaluation.fake_run import write_run

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 2, "samples": 8})
LABELS = ("direct", "floor_ceiling", "through_slab", "ghost", "moving", "leakage")
#: Of recordings of release 1.0.
OLD_LABELS = ("direct", "floor_ceiling", "ghost_1", "ghost_2", "ghost_3", "through_slab", "moving", "leakage")
BEARINGS = np.radians(np.arange(-44.0, 44.0))


def test_a_surface_is_missed_without_a_return_at_it_or_in_front_of_it():
    true = np.array([[2.0, 2.0, 2.0, 2.0, 2.0, np.inf]])
    #                     at it  before  ghost  none   zero  none there
    measured = np.array([[2.09, 1.0, 2.5, np.inf, 0.0, 3.0]])
    assert missed(measured, true) == pytest.approx(3 / 5)
    assert np.isnan(missed(measured, np.full((1, 6), np.inf)))


def record(path, times, cause, labels=LABELS):
    """Write a recording, in each frame of which one whole bearing has one path type."""
    streams = {"truth/cause": Stream(cause.shape[1:], "u1", "", "strongest cause", labels=labels)}
    axes = {"ranges": 0.0446 * np.arange(cause.shape[1]), "azimuths": BEARINGS}
    products = {f"truth/cause_{name}": Product(axis, "", "") for name, axis in axes.items()}
    with RecordingWriter(path, CONFIG, streams=streams, products=products) as writer:
        rows = {"truth/cause": cause}
        writer.append(np.zeros((len(times), *CONFIG.frame_shape), np.int16), times, rows=rows)
    return path


@pytest.mark.parametrize("labels", [LABELS, OLD_LABELS])
def test_sources_of_wrong_returns(tmp_path, labels):
    """Path types are stored per frame, and the run lacks some frames: each scan must be compared with its own frame."""
    run = write_run(tmp_path / "run")
    with h5py.File(run / "scans.h5", "r+") as file:
        file["ranges"][::3] = file["ranges"][::3] + 0.3
    scans = Scans(run / "scans.h5")
    # Every second frame of the recording is in the run, whose instants are in the middle of the bursts.
    times = np.repeat(scans["time"], 2) - 0.01
    times[1::2] += 1 / 30
    rng = np.random.default_rng(0)
    causes = rng.integers(0, len(labels) + 1, (len(scans["time"]), 1, len(BEARINGS)))
    cause = np.full((len(times), 96, len(BEARINGS)), labels.index("leakage"), np.uint8)
    cause[::2] = np.where(causes == len(labels), 255, causes)
    true = true_ranges(scans["azimuths"], scans["truth/scan"], scans["truth/scan_azimuths"])
    found = sources(scans, true, record(tmp_path / "a.h5", times, cause, labels))
    assert set(found) == set(SOURCES)
    returned = np.isfinite(scans["ranges"])
    wrong = returned & ~(np.abs(np.where(returned, scans["ranges"], 0) - true) <= 0.1)
    assert 0.3 < wrong.sum() / returned.sum() < 0.4
    for name, some in SOURCES.items():
        numbers = [(*labels, "noise").index(label) for label in some if label in (*labels, "noise")]
        assert found[name] == pytest.approx(np.mean(np.isin(causes[:, 0][returned], numbers) & wrong[returned])), name
    # Three in ten bearings are left out, and of the others every third is behind.
    assert 0.5 < missed(scans["ranges"], true) < 0.56


def test_a_recording_without_path_types(tmp_path):
    scans = Scans(write_run(tmp_path / "run") / "scans.h5")
    times = scans["time"] - 0.01
    path = record(tmp_path / "a.h5", times, np.zeros((len(times), 96, len(BEARINGS)), np.uint8), labels=())
    assert sources(scans, scans["ranges"], path) == {}
