"""SLAM on plain files: input, output, and refused files."""

import json
import tracemalloc

import h5py
import numpy as np
import pytest

from radarize.cli import app
from radarize.evaluation.report.run import report_run
from radarize.io.console import run as run_app
from radarize.io.errors import InputError
from radarize.io.pose import between
from radarize.io.tum import planar_poses, read_tum, write_tum
from radarize.pipeline.log import Log, run
from radarize.pipeline.runfolder import OccupancyMap, RunFolder
from radarize.slam.config import SlamConfig
from tests.slam.world import box, scan

AZIMUTHS = np.radians(np.arange(-120.0, 121.0, 1.0))
ROOM = np.concatenate([box(0, 0, 6.03, 4.04), box(4, 3, 4.5, 3.3), box(3, 0.6, 3.4, 0.9)])
POSES = np.array([[1.5 + 0.1 * k, 1.5, 0.04 * k] for k in range(15)])


def files(folder, **changes):
    ranges = np.stack([scan(ROOM, pose, AZIMUTHS) for pose in POSES])
    fields = {"ranges": ranges, "angle_min": AZIMUTHS[0], "angle_increment": np.radians(1.0), "range_max": 30.0}
    np.savez(folder / "scans.npz", **{k: v for k, v in {**fields, **changes}.items() if v is not None})
    write_tum(folder / "odometry.tum", np.arange(15.0), planar_poses(POSES))
    return folder / "scans.npz", folder / "odometry.tum"


def test_what_is_written(tmp_path, capsys):
    scans, odometry = files(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        run_app(app, "radarize", ["slam", str(scans), str(odometry), "-o", str(tmp_path / "RUN"),
                                  "--reference", str(odometry)])  # fmt: skip
    assert stopped.value.code == 0
    times, poses = read_tum(tmp_path / "RUN" / "trajectory.tum")
    np.testing.assert_allclose(times, np.arange(15.0))
    assert np.hypot(*(poses[:, :2] - POSES[:, :2]).T).max() < 0.03
    grid = OccupancyMap.read(tmp_path / "RUN" / "map.yaml")
    assert grid.occupied.sum() > 100 and grid.free.sum() > 1000 and (grid.pixels == 205).any()
    with h5py.File(tmp_path / "RUN" / "scans.h5") as file:
        assert file["trajectory_covariance"].shape == (15, 3, 3)
    facts = json.loads((tmp_path / "RUN" / "run.json").read_text())
    assert SlamConfig.model_validate(facts["slam_settings"]) == SlamConfig.preset("lidar")
    # And again from the folder that was written.
    again = run(tmp_path / "RUN", None, tmp_path / "RUN2", config=SlamConfig.preset("lidar"))
    assert (again / "trajectory.tum").read_bytes() == (tmp_path / "RUN" / "trajectory.tum").read_bytes()
    assert (again / "reference.tum").is_file()


def test_a_graph_that_cannot_be_solved_for_covariances_ends_no_run(tmp_path, capsys, monkeypatch):
    def refuse(graph, values):
        raise RuntimeError("Indeterminate linear system detected while working near variable 4")

    monkeypatch.setattr("gtsam.Marginals", refuse)
    monkeypatch.setattr("radarize.slam.posegraph._by_qr", refuse)
    with pytest.raises(SystemExit) as stopped:
        run_app(app, "radarize", ["slam", *map(str, files(tmp_path)), "-o", str(tmp_path / "RUN")])
    assert stopped.value.code == 0
    (warning,) = RunFolder(tmp_path / "RUN").warnings
    assert "covariances of the pose graph" in warning and f"warning: {warning}" in capsys.readouterr().err
    assert np.isfinite(RunFolder(tmp_path / "RUN").scans["trajectory_covariance"]).all()
    assert warning in report_run(tmp_path / "RUN").read_text()


def test_without_odometry(tmp_path):
    scans, _ = files(tmp_path)
    run(scans, None, tmp_path / "RUN", config=SlamConfig.preset("lidar"))
    _, poses = read_tum(tmp_path / "RUN" / "trajectory.tum")
    moved = poses[-1, :2] - poses[0, :2]
    assert np.hypot(*moved) == pytest.approx(np.hypot(*between(POSES[0], POSES[-1])[:2]), abs=0.06)
    assert not (tmp_path / "RUN" / "odometry.tum").exists()


def test_times_and_far_ranges(tmp_path):
    ranges = np.full((3, len(AZIMUTHS)), 2.0)
    ranges[0, :5] = 30.0
    ranges[1, 3] = np.nan
    scans, odometry = files(tmp_path, ranges=ranges, times=np.array([4.0, 2.0, 3.0]))
    log = Log.read(scans, odometry)
    assert np.isinf(log.ranges[0, :5]).all() and np.isnan(log.ranges[1, 3])
    np.testing.assert_allclose(log.azimuths, AZIMUTHS)
    written = run(scans, odometry, tmp_path / "RUN", config=SlamConfig())
    np.testing.assert_allclose(read_tum(written / "trajectory.tum")[0], [2, 3, 4])  # order of time, none lost


@pytest.mark.parametrize(
    "changes, sentence",
    [
        ({"range_max": None}, "has no range_max"),
        ({"ranges": np.zeros(5)}, "ranges has shape"),
        ({"angle_min": np.nan}, "angle_min is nan"),
        ({"times": np.arange(3.0)}, "times has shape"),
        ({"ranges": np.array([object()])}, "expected numbers"),
    ],
)
def test_bad_files_are_named(tmp_path, changes, sentence):
    scans, odometry = files(tmp_path, **changes)
    with pytest.raises(InputError, match=sentence):
        Log.read(scans, odometry)


def test_a_log_that_unpacks_to_a_thousand_times_its_size_is_refused(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", ranges=np.zeros((5000, 5000)))
    assert (tmp_path / "a.npz").stat().st_size < 200_000
    tracemalloc.start()
    with pytest.raises(InputError, match="declares 200000000 bytes of numbers, but has"):
        Log.read(tmp_path / "a.npz")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4e6


def test_settings_from_a_file(tmp_path):
    (tmp_path / "s.yaml").write_text("grid: {nodes: 20}\nloop: {enabled: false}\n")
    config = SlamConfig.load(tmp_path / "s.yaml", "radar")
    assert config.grid.nodes == 20 and not config.loop.enabled
    assert config.grid.hit == SlamConfig.preset("radar").grid.hit != SlamConfig().grid.hit
    for text, sentence in (
        ("grid: {cells: 3}", "grid.cells"),
        ("loop: {every: 0}", "loop.every is 0"),
        ("[1]", "holds a list, expected sections with fields, such as grid: {nodes: 10}"),
    ):
        (tmp_path / "s.yaml").write_text(text)
        with pytest.raises(InputError, match=sentence):
            SlamConfig.load(tmp_path / "s.yaml")
    with pytest.raises(InputError, match="preset is 'sonar'"):
        SlamConfig.preset("sonar")
