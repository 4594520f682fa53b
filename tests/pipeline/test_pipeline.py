"""The main job on a short simulated walk: raw I/Q to trajectory, scans and map, against the truth of the simulator."""

import json

import h5py
import numpy as np
import pytest

from radarize.cli import app
from radarize.evaluation.evaluate import evaluate
from radarize.evaluation.report.run import methods
from radarize.io.console import run as command
from radarize.io.errors import InputError
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.io.tum import read_tum
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.config import Configuration
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import CLASSICAL, make_pipeline
from radarize.pipeline.pipeline import Pipeline, Result
from radarize.pipeline.run import run
from radarize.pipeline.runfolder import RunFolder
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor
from radarsim.recording.simulate import simulate
from tests.batches import stream


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    return simulate("office", tmp_path_factory.mktemp("walk") / "walk.h5", duration=6.0, seed=1)


@pytest.fixture(scope="module")
def finished(walk):
    return run(walk, walk.parent / "run").path


def test_writes_everything(finished):
    assert {p.name for p in finished.iterdir()} >= {
        "trajectory.tum", "odometry.tum", "reference.tum", "map.pgm", "map.yaml", "scans.h5", "run.json",
    }  # fmt: skip
    facts = json.loads((finished / "run.json").read_text())
    assert facts["recording_attributes"]["seed"] == 1 and facts["frames"] == 180
    assert set(facts["ms_per_frame"]) == {"spectra", "translation", "rotation", "maps", "scans", "slam"}


def test_odometry_and_slam_follow_the_truth(finished):
    """The error is below 5 % of the distance travelled, and the heading has the correct sign."""
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
    """Both components of the velocity are correct, with their signs."""
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


def follow(adc, times, valid=None, size=16, config=PRESETS["radarize"]) -> tuple[list[Result], Pipeline, Preprocessor]:
    """Results of the methods without networks, which are fastest."""
    inputs = Inputs(config)
    pipeline, preprocessor = make_pipeline(inputs, **CLASSICAL), Preprocessor(inputs.signal)
    return list(pipeline.run(stream(preprocessor, adc, times, valid, size))), pipeline, preprocessor


def poses(results: list[Result]) -> np.ndarray:
    return np.concatenate([result.track.pose for result in results])


def test_batches_do_not_matter(walk):
    """Frames one by one or in sixteens give the same trajectory and map, so a live stream gives the result of a
    file."""
    with Recording(walk) as source:
        adc, times = source.adc(0, 48), source.times[:48]
    (one, slow, _), (two, _, _), (other, fast, _) = (follow(adc, times, size=size) for size in (1, 2, 16))
    assert len(one) == 48 and len(two) == 24 and len(other) == 3
    assert poses(two) == pytest.approx(poses(other), abs=1e-6)
    # A lone frame is summed in another order: rounding, and where two yaws match as well, which of them is taken.
    assert poses(one) == pytest.approx(poses(other), abs=5e-4)
    assert slow.slam.trajectory()[1] == pytest.approx(fast.slam.trajectory()[1], abs=5e-4)


def test_lost_chirps_do_no_harm(walk, tmp_path):
    """With a fifth of the chirps zeroed and marked, the trajectory is finite and close."""
    rng = np.random.default_rng(0)
    with Recording(walk) as source, RecordingWriter(tmp_path / "lossy.h5", source.config) as writer:
        adc = source.adc(0, 120)
        valid = rng.random(adc.shape[:3]) > 0.2
        adc[~valid] = 0
        writer.append(adc, source.times[:120], valid)
    with Recording(walk) as source, Recording(tmp_path / "lossy.h5") as damaged:
        whole = poses(follow(source.adc(0, 120), source.times[:120], size=120)[0])
        lossy = poses(follow(damaged.adc(0, 120), damaged.times, damaged.valid(0, 120), size=120)[0])
    assert np.isfinite(lossy).all()
    assert np.linalg.norm(whole[-1, :2] - lossy[-1, :2]) < 0.15


def spoil(walk, valid):
    """The first frames of the walk, with the invalid chirps lost."""
    frames = len(valid)
    with Recording(walk) as source:
        adc = source.adc(0, frames)
        adc[~valid] = 0
        return follow(adc, source.times[:frames], valid)


@pytest.fixture(scope="module")
def unspoilt(walk):
    return poses(spoil(walk, np.ones((120, 32, 3), bool))[0])


@pytest.mark.parametrize(
    ("lost", "frames", "tolerance"),
    [
        (np.s_[50:60], 110, 0.15),  # a third of a second, as a whole
        (np.s_[:3], 117, 0.05),
        (np.s_[::4], 90, 0.08),
        (np.s_[::3, 16:], 120, 0.05),  # the later half of a burst
        (np.s_[40:80, :, 1], 120, 0.15),  # a transmitter
        (np.s_[::5, 2:], 96, 0.08),  # too little is left of these
    ],
)
def test_lost_bursts_and_frames_leave_a_gap(walk, unspoilt, lost, frames, tolerance):
    valid = np.ones((120, 32, 3), bool)
    valid[lost] = False
    results, _, preprocessor = spoil(walk, valid)
    numbers, found = np.concatenate([result.frames for result in results]), poses(results)
    assert len(found) == len(numbers) == frames and (preprocessor.taken, preprocessor.lost) == (120, 120 - frames)
    away = np.linalg.norm((found - found[0] - unspoilt[numbers] + unspoilt[numbers[0]])[:, :2], axis=1)
    assert away.max() < tolerance
    errors = ErrorModel.joined([result.track.errors for result in results])
    covariance = errors.motions(found, np.arange(len(found) - 1), 1)
    assert np.isfinite(covariance).all() and (np.linalg.eigvalsh(covariance) > 0).all()
    # A step across a gap is less certain, by the time that it took.
    gaps = np.diff(numbers)
    if gaps.max() > 5:
        assert covariance[gaps.argmax(), 0, 0] > 20 * np.median(covariance[:, 0, 0])


def test_everything_lost(walk, tmp_path):
    """No crash, no scans, no motion; and a run of such a recording is an error."""
    results, pipeline, preprocessor = spoil(walk, np.zeros((40, 32, 3), bool))
    assert results == [] and preprocessor.lost == 40 and not pipeline.slam.nodes
    with Recording(walk) as source, RecordingWriter(tmp_path / "lost.h5", source.config) as writer:
        shape = (20, *source.config.frame_shape)
        writer.append(np.zeros(shape, np.int16), source.times[:20], np.zeros(shape[:3], bool))
    with pytest.raises(InputError, match="all its 20 frames are lost or silent"):
        run(tmp_path / "lost.h5", tmp_path / "run")


def test_a_run_over_lost_frames_keeps_rows_and_truth_together(walk, tmp_path):
    with Recording(walk) as source:
        streams = {"truth/velocity": Stream((6,), "f8", "m/s", "", "radar/time")}
        valid = np.ones((60, 32, 3), bool)
        valid[20:30] = False
        adc, truth = source.adc(0, 60), source.read("truth/velocity")[:60]
        adc[~valid] = 0
        with RecordingWriter(tmp_path / "gap.h5", source.config, streams=streams) as writer:
            writer.append(adc, source.times[:60], valid, rows={"truth/velocity": truth})
    out = run(tmp_path / "gap.h5", tmp_path / "run", odometry="doppler", scans="first-echo").path
    facts = json.loads((out / "run.json").read_text())
    assert facts["frames"] == 60 and facts["frames_lost"] == 10
    with h5py.File(out / "scans.h5") as file:
        assert len(file["time"]) == len(file["ranges"]) == len(file["truth/velocity"]) == 50
        error = np.abs(file["velocity"][:] - file["truth/velocity"][:, :2])
    assert (np.median(error, axis=0) < 0.05).all()


def test_every_second_frame_is_a_radar_of_half_the_rate(walk, tmp_path):
    """The result equals that of a recording without other frames: poses, scans, and truth."""
    with Recording(walk) as source:
        adc, times, truth = source.adc(0, 60), source.times[:60], source.read("truth/velocity")[:60]
    streams = {"truth/velocity": Stream((6,), "f8", "m/s", "", "radar/time")}
    for name, count in (("whole", 1), ("half", 2)):
        with RecordingWriter(tmp_path / f"{name}.h5", PRESETS["radarize"].every(count), streams=streams) as writer:
            writer.append(adc[::count], times[::count], rows={"truth/velocity": truth[::count]})
    with Recording(tmp_path / "whole.h5") as source:
        one = run(source[::2], tmp_path / "one").path
    other = run(tmp_path / "half.h5", tmp_path / "other").path
    facts = json.loads((one / "run.json").read_text())
    assert facts["frames"] == 60 and facts["frames_lost"] == 0
    found, wanted = RunFolder(one), RunFolder(other)
    assert methods(found) == "fused + segmentation + one of 2" and methods(wanted) == "fused + segmentation"
    assert found.scans["frames"].tolist() == list(range(0, 60, 2)) and len(wanted.scans["frames"]) == 30
    for name in ("ranges", "velocity", "truth/velocity"):
        assert found.scans[name] == pytest.approx(wanted.scans[name], abs=1e-3, nan_ok=True)
    for name in ("odometry", "trajectory"):
        assert read_tum(one / f"{name}.tum")[1] == pytest.approx(read_tum(other / f"{name}.tum")[1], abs=1e-3)


def test_silence_is_survived(tmp_path):
    """All samples are zero (a radar that was not started): no crash, no motion, and one sentence."""
    config = PRESETS["radarize"]
    silence, times = np.zeros((20, *config.frame_shape), np.int16), np.arange(20) / 30
    results, _, preprocessor = follow(silence, times)
    assert results == [] and preprocessor.lost == 20
    with RecordingWriter(tmp_path / "silent.h5", config) as writer:
        writer.append(silence, times)
    with pytest.raises(InputError, match="all its 20 frames are lost or silent"):
        run(tmp_path / "silent.h5", tmp_path / "run")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"odometry": "magic"}, "odometry is 'magic', expected one of doppler"),
        ({"scans": "magic"}, "scans is 'magic', expected one of"),
    ],
)
def test_unknown_methods(walk, tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        run(walk, tmp_path / "run", **arguments)


def test_an_array_without_elevation(tmp_path):
    """Two transmitters measure no elevation: requesting it is refused in one sentence, and first-echo runs."""
    config = RadarConfig(**{**PRESETS["radarize"].model_dump(), "tx_order": (0, 2)})
    rng = np.random.default_rng(0)
    with RecordingWriter(tmp_path / "flat.h5", config) as writer:
        writer.append(rng.integers(-9, 9, (8, *config.frame_shape)).astype(np.int16), np.arange(8) / 30)
    with pytest.raises(InputError, match="first-echo"):
        run(tmp_path / "flat.h5", tmp_path / "run", scans="elevation-aware")
    run(tmp_path / "flat.h5", tmp_path / "run", scans="first-echo")


def test_a_configuration_changes_the_run(walk, finished, tmp_path):
    """Given settings are used and stored; the others keep their defaults."""
    (tmp_path / "mine.yaml").write_text("slam:\n  grid:\n    map_resolution: 0.1\nscans:\n  min_range: 2.0\n")
    mine = Configuration.load(tmp_path / "mine.yaml")
    out = tmp_path / "run"
    methods = ["--odometry", "doppler", "--scans", "first-echo"]
    with pytest.raises(SystemExit) as ended:
        command(app, "radarize", ["run", str(walk), "-o", str(out), *methods, "--config", str(tmp_path / "mine.yaml")])
    assert ended.value.code == 0
    stored = json.loads((out / "run.json").read_text())["configuration"]
    assert stored == json.loads(mine.model_dump_json())
    assert stored["slam"]["grid"]["map_resolution"] == 0.1 and stored["scans"]["min_range"] == 2.0
    usual = json.loads((finished / "run.json").read_text())["configuration"]
    assert usual == json.loads(Configuration().model_dump_json()) and usual["slam"]["grid"]["map_resolution"] != 0.1
    assert "resolution: 0.1\n" in (out / "map.yaml").read_text()
    with h5py.File(out / "scans.h5") as file:
        ranges = file["ranges"][:]
    assert ranges.min() > 1.95 and np.isfinite(ranges).any()


def test_empty_recording(tmp_path):
    with RecordingWriter(tmp_path / "empty.h5", PRESETS["radarize"]):
        pass
    with pytest.raises(InputError, match="no whole frame"):
        run(tmp_path / "empty.h5", tmp_path / "run")
