"""The main job on a short simulated walk: raw I/Q to trajectory, scans and map, against the truth of the simulator."""

import json

import h5py
import numpy as np
import pytest

from radarize.errors import InputError
from radarize.evaluation.evaluate import evaluate
from radarize.pipeline import Pipeline, run
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.recording import Recording, RecordingWriter
from radarize.tum import read_tum
from radarsim.simulate import simulate


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    return simulate("office", tmp_path_factory.mktemp("walk") / "walk.h5", duration=8.0, seed=1)


@pytest.fixture(scope="module")
def finished(walk):
    return run(walk, walk.parent / "run")


def test_writes_everything(finished):
    assert {p.name for p in finished.iterdir()} >= {
        "trajectory.tum", "odometry.tum", "reference.tum", "map.pgm", "map.yaml", "scans.h5", "run.json",
    }  # fmt: skip
    facts = json.loads((finished / "run.json").read_text())
    assert facts["recording_attributes"]["seed"] == 1 and facts["frames"] == 240
    assert set(facts["ms_per_frame"]) == {"spectra", "translation", "rotation", "maps", "scans", "slam"}


def test_odometry_and_slam_follow_the_truth(finished):
    """Better than 5 % of the distance travelled; and the heading turns the way the sensor turned."""
    errors = evaluate(finished)
    assert errors["odometry"]["ate"]["position"]["mean"] < 0.05 * errors["odometry"]["distance"]
    assert errors["slam"]["ate"]["position"]["mean"] < 0.05 * errors["odometry"]["distance"]
    yaw = []
    for name in ("odometry", "reference"):
        _, pose = read_tum(finished / f"{name}.tum")
        turn = np.unwrap(2 * np.arctan2(pose[:, 5], pose[:, 6]))
        yaw.append(turn - turn[0])
    shared = min(map(len, yaw))
    assert np.ptp(yaw[1]) > 0.5
    assert np.corrcoef(yaw[0][:shared], yaw[1][:shared])[0, 1] > 0.99


def test_velocity_against_truth(finished):
    """Both components of the ego-velocity, with their signs."""
    with h5py.File(finished / "scans.h5") as file:
        error = np.abs(file["velocity"][:] - file["truth/velocity"][:, :2])
    assert (np.median(error, axis=0) < 0.03).all()


def test_scans_mostly_end_at_surfaces(finished):
    """Scans are far better than chance: most returns are within 25 cm of the true first surface."""
    with h5py.File(finished / "scans.h5") as file:
        found, truth = file["ranges"][:], file["truth/scan"][:]
    both = np.isfinite(found) & np.isfinite(truth)
    assert both.mean() > 0.3
    assert np.mean(np.abs(found[both] - truth[both]) < 0.25) > 0.6


def test_batches_do_not_matter(walk):
    """Frames one by one or in sixteens: the same trajectory, so a live stream gives what a file gives."""
    ends = []
    for size in (1, 16):
        with Recording(walk) as source:
            pipeline = Pipeline(source.config)
            for start in range(0, 48, size):
                pipeline.push(source.adc(start, start + size), source.times[start : start + size])
        ends.append(np.concatenate(pipeline.poses))
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_lost_chirps_do_no_harm(walk, tmp_path):
    """A fifth of the chirps zeroed and marked: still a trajectory, still finite, still close."""
    rng = np.random.default_rng(0)
    with Recording(walk) as source, RecordingWriter(tmp_path / "lossy.h5", source.config) as writer:
        adc = source.adc(0, 120)
        valid = rng.random(adc.shape[:3]) > 0.2
        adc[~valid] = 0
        writer.append(adc, source.times[:120], valid)
    whole, lossy = Pipeline(PRESETS["radarize"]), Pipeline(PRESETS["radarize"])
    with Recording(walk) as source, Recording(tmp_path / "lossy.h5") as damaged:
        whole.push(source.adc(0, 120), source.times[:120])
        lossy.push(damaged.adc(0, 120), damaged.times, damaged.valid(0, 120))
    assert np.isfinite(lossy.poses[0]).all()
    assert np.linalg.norm(whole.poses[0][-1, :2] - lossy.poses[0][-1, :2]) < 0.15


def test_silence_is_survived(tmp_path):
    """All samples zero (a radar that was never started): no crash, no motion."""
    config = PRESETS["radarize"]
    with RecordingWriter(tmp_path / "silent.h5", config) as writer:
        writer.append(np.zeros((20, *config.frame_shape), np.int16), np.arange(20) / 30)
    out = run(tmp_path / "silent.h5", tmp_path / "run")
    _, pose = read_tum(out / "odometry.tum")
    assert np.allclose(pose[:, :3], 0, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"odometry": "magic"}, "odometry is 'magic', expected one of doppler"),
        ({"scans": "magic"}, "scans is 'magic', expected one of"),
        ({"settings": "magic"}, "settings is 'magic', expected one of corrected"),
    ],
)
def test_unknown_methods(walk, tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        run(walk, tmp_path / "run", **arguments)


def test_an_array_without_elevation(tmp_path):
    """Two transmitters see no elevation: asking for it is refused in a sentence, and first-echo runs."""
    config = RadarConfig(**{**PRESETS["radarize"].model_dump(), "tx_order": (0, 2)})
    rng = np.random.default_rng(0)
    with RecordingWriter(tmp_path / "flat.h5", config) as writer:
        writer.append(rng.integers(-9, 9, (8, *config.frame_shape)).astype(np.int16), np.arange(8) / 30)
    with pytest.raises(InputError, match="first-echo"):
        run(tmp_path / "flat.h5", tmp_path / "run", scans="elevation-aware")
    run(tmp_path / "flat.h5", tmp_path / "run", scans="first-echo")


def test_empty_recording(tmp_path):
    with RecordingWriter(tmp_path / "empty.h5", PRESETS["radarize"]):
        pass
    with pytest.raises(InputError, match="no whole frame"):
        run(tmp_path / "empty.h5", tmp_path / "run")
