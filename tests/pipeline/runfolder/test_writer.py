"""Run folders: complete or absent, and read back as written."""

import gc
import json
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from radarize.io.errors import DiskFull, InputError
from radarize.io.tum import planar_poses, write_tum
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.pipeline import Result
from radarize.pipeline.runfolder import RunFolder, RunWriter
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

RNG, RADAR = np.random.default_rng(0), PRESETS["radarize"]


def result(first, count):
    """Frames of forward motion at 30 Hz; every second one has no echo."""
    frames = first + np.arange(count)
    step = np.tile([0.02, 0.0, 0.01], (count, 1))
    track = SimpleNamespace(
        time=frames / 30, pose=frames[:, None] * [0.02, 0.0, 0.001], step=step,
        velocity=RNG.normal(size=(count, 2)),
        velocity_covariance=np.tile(np.eye(2) * 1e-4, (count, 1, 1)), velocity_seen=frames < 50,
        turn_seen=np.ones(count, bool),
        errors=ErrorModel(
            np.full(count, 1 / 30), RNG.uniform(size=(count, 3, 3)), RNG.uniform(size=(count, 2)),
            RNG.uniform(size=(count, 3, 3)),
        ),
    )  # fmt: skip
    ranges = np.where(frames[:, None] % 2, 3 / np.cos(BEARINGS), np.inf)
    return Result(frames, track, ranges.astype(np.float32))


def session(results):
    slam = Slam(SlamConfig.preset("radar"))
    for each in results:
        for time, pose, scan in zip(each.track.time, each.track.pose, each.ranges, strict=True):
            slam.add_odometry(time, pose)
            slam.add_scan(time, BEARINGS, scan)
    slam.finish()
    return slam


def write(folder, results, facts=None):
    with RunWriter(folder, RADAR) as writer:
        for each in results:
            writer.add(each)
        writer.put("azimuths", BEARINGS, "rad")
        writer.finish(session(results), facts or {"methods": {"odometry": "doppler", "scans": "first-echo"}})
        return writer


def test_what_is_written_is_read(tmp_path):
    results = [result(0, 16), result(16, 5), result(30, 40)]  # frames 21...29 were lost
    writer = write(tmp_path / "a" / "RUN", results)
    run = RunFolder(tmp_path / "a" / "RUN")
    for name in ("time", "velocity", "velocity_seen", "turn_seen"):
        assert np.array_equal(run.scans[name], np.concatenate([getattr(each.track, name) for each in results]))
    for name in ("duration", "noise", "correlation", "variance"):
        expected = np.concatenate([getattr(each.track.errors, name) for each in results])
        assert np.array_equal(getattr(run.errors, name), expected)
    assert np.array_equal(run.scans["frames"], [*range(21), *range(30, 70)])
    assert np.array_equal(run.scans["ranges"], np.concatenate([each.ranges for each in results]))
    times, poses = run.odometry
    assert times == pytest.approx(run.scans["time"]) and poses[:, 0] == pytest.approx(0.02 * run.scans["frames"])
    assert len(run.trajectory[0]) == 61 and run.reference is None and run.map.occupied.any() and run.metrics == {}
    assert run.facts["nodes"] > 1 and run.methods == {"odometry": "doppler", "scans": "first-echo"}
    assert [span.why for span in writer.health.observability.found.spans] == ["frames lost", "no velocity"]
    assert {path.name for path in run.path.iterdir()} == {
        "trajectory.tum", "odometry.tum", "map.pgm", "map.yaml", "scans.h5", "run.json",
    }  # fmt: skip


def test_a_new_run_replaces_all_of_the_old_one_and_nothing_else(tmp_path):
    write(tmp_path, [result(0, 40)])
    write_tum(tmp_path / "reference.tum", np.arange(3.0), planar_poses(np.zeros((3, 3))))
    (tmp_path / "metrics.json").write_text("{}")
    (tmp_path / "notes.txt").write_text("mine")
    write(tmp_path, [result(0, 20)], {"second": True})
    run = RunFolder(tmp_path)
    assert run.facts["second"] and len(run.scans["time"]) == 20
    assert not run.has("reference.tum") and not run.has("metrics.json") and run.has("notes.txt")


@pytest.mark.parametrize("error", [InputError("no"), KeyboardInterrupt(), OSError(28, "No space left on device")])
def test_a_run_that_fails_leaves_the_old_one_as_it_was(tmp_path, monkeypatch, error):
    write(tmp_path / "old", [result(0, 40)])
    before = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}

    def fail(*_, **__):
        raise error

    for folder in (tmp_path / "old", tmp_path / "new"):
        with pytest.raises(BaseException) as met, RunWriter(folder, RADAR) as writer:
            writer.add(result(0, 16))
            with monkeypatch.context() as patch:
                patch.setattr("radarize.pipeline.runfolder.writer.json.dumps", fail)
                writer.finish(session([result(0, 16)]), {})
        assert met.type is (DiskFull if isinstance(error, OSError) else type(error))
    assert {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before
    assert [path.name for path in tmp_path.iterdir()] == ["old"]
    with RunWriter(tmp_path / "new", RADAR) as writer:
        writer.add(result(0, 16))  # and is given up
    assert not (tmp_path / "new").exists()


def test_what_one_who_died_left_is_no_run_and_in_nobodys_way(tmp_path):
    (tmp_path / ".part").mkdir()
    (tmp_path / ".part" / "trajectory.tum").write_text("0 0 0")
    with pytest.raises(InputError, match="has no trajectory.tum"):
        RunFolder(tmp_path)
    write(tmp_path, [result(0, 20)])
    assert len(RunFolder(tmp_path).trajectory[0]) == 20 and not (tmp_path / ".part").exists()


def test_memory_does_not_grow_with_what_is_written(tmp_path):
    with RunWriter(tmp_path / "RUN", RADAR) as writer:
        batch, taken = result(0, 16), []
        tracemalloc.start()
        for k in range(300):
            batch.track.time[:] += 1.0
            writer.add(Result(16 * k + np.arange(16), batch.track, batch.ranges))
            if k in (50, 299):
                gc.collect()
                taken.append(tracemalloc.get_traced_memory()[0])
        tracemalloc.stop()
    assert taken[1] - taken[0] < 0.6e6  # scans of these 4,000 frames alone take 1.9 MB; some are h5py's own notes


def test_run_json_of_today_is_read(tmp_path):
    write(tmp_path, [result(0, 20)])
    (tmp_path / "run.json").write_text(json.dumps({"methods": ["doppler"]}))
    with pytest.raises(InputError, match="run.json: methods is .*expected an object"):
        _ = RunFolder(tmp_path).methods
    (tmp_path / "run.json").unlink()
    assert RunFolder(tmp_path).facts == {} and RunFolder(tmp_path).methods == {}


def test_a_second_run_into_a_folder_is_refused(tmp_path):
    with RunWriter(tmp_path / "RUN"):
        with pytest.raises(InputError, match="another program is writing there"):
            RunWriter(tmp_path / "RUN")
    with RunWriter(tmp_path / "RUN"):
        pass
