"""The benchmark on real walks, on a synthetic clone whose lidar and radar see a wall."""

import json
import lzma
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from radarize.baselines.real.motion import SMOOTH, disturbed, shifted_turns, smoothed, turn_errors
from radarize.baselines.real.real import RealOptions, clocked_turn_errors, median_error, real
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.poses import BEARINGS, scan, true_poses
from radarize.baselines.walks.walks import Walk
from radarize.cli import app
from radarize.io.errors import InputError
from radarize.io.pose import between
from radarize.io.tum import planar_poses, write_tum
from radarize.signal import polar
from tests.baselines.test_radarhd_pictures import repeating, weights
from tests.baselines.twoclocks import MadeUp

FRAMES = 46


@pytest.fixture
def clone(tmp_path):
    folder = tmp_path / "dataset_5" / "test"
    for kind in ("radar", "lidar"):
        (folder / kind).mkdir(parents=True)
    radar, lidar = np.zeros((256, 64), np.uint8), np.zeros((256, 512), np.uint8)
    radar[76, 20:44], lidar[71, 160:352] = 255, 255  # 0.21 m farther
    for k in range(FRAMES):
        Image.fromarray(radar).save(folder / f"radar/R_7_{k}.png")
        Image.fromarray(lidar).save(folder / f"lidar/L_7_{k}.png")
    return tmp_path / "dataset_5"


def predictions(folder, row: int):
    """Write predictions for frames from the 40th on: the wall at a range row, on the Cartesian grid."""
    cells = np.zeros((FRAMES - 40, *map(len, polar.GRID)), np.uint8)
    picture = np.zeros((256, 512), bool)
    picture[row, 160:352] = True
    at = [np.searchsorted(axis, each - 1e-9) for axis, each in zip(polar.GRID, polar.cartesian(picture).T, strict=True)]
    cells[:, at[0], at[1]] = 1
    folder.mkdir()
    with lzma.open(folder / "7.npz.xz", "wb") as file:
        np.savez(file, prediction=np.packbits(cells, axis=-1), frame=np.arange(40, FRAMES))


def test_every_walk_and_method_has_a_row(clone, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    predictions(tmp_path / "others", 71)
    done = CliRunner().invoke(app, [
        "benchmark", "real", "--data", str(clone), "--out", str(tmp_path / "out"), "--walks", "7",
        "--weights", str(tmp_path), "--predictions", f"others={tmp_path / 'others'}",
    ])  # fmt: skip
    assert done.exit_code == 0, done.exception
    rows = json.loads((tmp_path / "out" / "real.json").read_text())["tables"][0]["rows"]
    found = {row["method"]: row for row in rows}
    methods = {"picture", "cfar", "first-echo", "others", "shifted pictures", "shifted pictures, smoothed", "lidar"}
    assert {row["walk"] for row in rows} == {7} and methods == found.keys()
    shown = done.output.splitlines()[:-1]
    assert max(map(len, shown)) <= 80 and f" {found['picture']['mod_hausdorff_m']:.4g} " in done.output
    assert {"hausdorff", "chamfer", "smoothed"} <= {word for line in shown for word in line.split()}
    # The rig stands still, so positions and headings stay; maps of the wall are as accurate as the scans.
    assert found["lidar"]["ate_m"] < 0.02 and found["shifted pictures"]["yaw_rmse_deg"] < 0.1
    assert found["lidar"]["map_f1"] > 0.9 and found["others"]["map_f1"] > 0.9 > found["first-echo"]["map_f1"]
    assert found["others"]["chamfer_m"] == 0 and found["others"]["frames"] == FRAMES - 40
    # A wall that is read 5 rows too far has a distance error of 0.21 m, except at its ends.
    assert found["picture"]["mod_hausdorff_m"] == pytest.approx(0.21, abs=0.04)
    assert found["picture"]["chamfer_m"] == pytest.approx(0.21, abs=0.06)
    assert "all real" in (tmp_path / "out" / "real.md").read_text()


def test_networks_have_rows_where_their_weights_are(clone, tmp_path):
    """A network that returns its input has the point-cloud distance of the picture itself."""
    weights(repeating(), tmp_path / "radarhd-pictures.safetensors")
    found = real(clone, tmp_path / "out", RealOptions(weights=tmp_path))
    rows, maps = ({row["method"]: row for row in found.tables[k].rows} for k in (0, 3))
    assert "network" not in rows and rows["radarhd-simulated"]["frames"] == FRAMES - 40
    for name in ("chamfer_m", "mod_hausdorff_m", "instant_chamfer_m"):
        assert rows["radarhd-simulated"][name] == pytest.approx(rows["picture"][name], abs=0.02)
    assert maps["radarhd-simulated"]["ate_m"] < 0.02
    assert ("radarhd-simulated", "picture") in {(row["method"], row["against"]) for row in found.tables[2].rows}
    assert [network.kind for network in found.networks] == ["radarhd-pictures"]


def test_frames_matched_by_time_agree_better(tmp_path):
    """A radar that lost frames: matched by frame index, pictures are of places up to 0.75 m apart."""
    walk = MadeUp(tmp_path / "clone", 7, 320, first=-30.0, rate=1.08)
    write_tum(tmp_path / "7.tum", 0.05 * np.arange(320), planar_poses(np.array([walk.pose(k) for k in range(320)])))
    found = real(walk.write(walk.folder), tmp_path / "out", RealOptions(weights=tmp_path, poses=tmp_path))
    rows = {row["method"]: row for row in found.tables[0].rows}
    assert rows["picture"]["instant_chamfer_m"] < 0.32 < 0.45 < rows["picture"]["chamfer_m"]
    shifted = rows["shifted pictures, smoothed"]
    assert shifted["instant_yaw_rmse_deg"] < shifted["yaw_rmse_deg"]
    clock = found.tables[1].rows[0]
    assert clock["correlation, by time"] > 2 * clock["correlation, by frame index"]
    assert clock["start_s"] == pytest.approx(1.5, abs=0.1)
    assert clock["end_s"] == pytest.approx(1.5 - 0.05 * 0.08 * 319, abs=0.1)


def test_errors_of_yaw_changes_matched_by_time_and_by_frame_index():
    """Exact changes of yaw at the times of the radar's frames have errors only if matched by frame index."""
    walk = MadeUp(Path(), 7, 320, first=-30.0, rate=1.08)
    poses = np.array([walk.pose(frame) for frame in range(320)])
    yaw = np.array([walk.pose(-30.0 + 1.08 * frame)[2] for frame in range(320)])
    turns = np.concatenate([np.full(4, np.nan), yaw[4:] - yaw[:-4]])
    errors = clocked_turn_errors(turns, poses, Clock(-30.0, 1.08))
    assert errors["instant_yaw_rmse_deg"] < 0.01 < 1.0 < errors["yaw_rmse_deg"]


@pytest.mark.parametrize(("options", "words"), [
    (["--walks", "8"], "has no walk 8"), (["--walks", "x"], "expected numbers"),
    (["--predictions", "others"], "expected NAME=FOLDER"),
])  # fmt: skip
def test_invalid_options(clone, tmp_path, options, words):
    done = CliRunner().invoke(app, ["benchmark", "real", "--data", str(clone), "--out", str(tmp_path / "o"), *options])
    assert isinstance(done.exception, InputError) and words in str(done.exception)


def test_standard_error_of_the_median_of_correlated_errors():
    """Errors of an autoregressive process: the estimate agrees with the spread of the medians of many realisations."""
    rng = np.random.default_rng(0)
    estimates, medians = [], []
    for _ in range(200):
        values = np.zeros(600)
        for k, noise in enumerate(rng.normal(size=600)):
            values[k] = 0.9 * values[k - 1] + noise
        estimates.append(median_error(values))
        medians.append(np.median(values))
    assert np.median(estimates) == pytest.approx(np.std(medians), rel=0.25)


def test_turns_to_the_left_are_positive():
    """Azimuths of the static world decrease as the radar turns to the left."""
    rng = np.random.default_rng(0)
    wide = (255 * (rng.random((256, 64 + 60)) > 0.95)).astype(np.uint8)
    pictures = np.stack([wide[:, frame // 4 : frame // 4 + 64] for frame in range(40)])  # a column every 0.2 s
    step = polar.AZIMUTHS[1] - polar.AZIMUTHS[0]
    found = shifted_turns(pictures)
    assert np.isnan(found[:4]).all() and np.median(found[4:]) == pytest.approx(step, rel=0.02)
    poses = np.column_stack([np.zeros((40, 2)), step / 4 * np.arange(40)])
    errors = turn_errors(found, poses)
    assert errors["turns_rms_deg"] == pytest.approx(np.degrees(step)) and errors["yaw_median_deg"] < 0.05


def test_smoothing_reduces_noise_and_keeps_a_steady_turn():
    """A Gaussian reduces the variance of white noise by 1 / (2 sqrt(pi) sigma); unknown changes of yaw stay unknown."""
    rng = np.random.default_rng(0)
    noise = rng.normal(size=20000)
    left = np.var(smoothed(noise)) * 2 * np.sqrt(np.pi) * SMOOTH
    assert left == pytest.approx(1, rel=0.1)
    steady = np.full(100, 0.02)
    steady[:4] = steady[50:60] = np.nan
    found = smoothed(steady)
    assert np.array_equal(np.isnan(found), np.isnan(steady)) and np.nanmax(np.abs(found - 0.02)) < 1e-12


def test_scans_have_the_nearest_point_of_each_bearing():
    points = np.array([[2.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    found = scan(points)
    assert found[90] == 1.0 and found[135] == pytest.approx(np.sqrt(2)) and np.isinf(found).sum() == len(BEARINGS) - 2


def test_simulated_odometry_drifts_by_its_noise_and_bias():
    """Standard deviation of the last yaw over many seeds: from the noise of all steps and the bias."""
    poses = np.zeros((201, 3))
    ends = [disturbed(poses, seed)[0][-1, 2] for seed in range(100)]
    expected = np.hypot(np.sqrt(200) * np.radians(0.1), 200 * 0.05 * np.radians(0.3))
    assert np.std(ends) == pytest.approx(expected, rel=0.25)


def test_covariance_of_the_simulated_odometry_is_consistent_over_a_second():
    """Along a line, over many seeds: mean squared error over variance is 1 along the path, across it and in heading."""
    poses = np.column_stack([0.05 * np.arange(21), np.zeros(21), np.zeros(21)])
    found = [disturbed(poses, seed) for seed in range(400)]
    steps = np.array([between(odometry[:-1], odometry[1:]) - [0.05, 0, 0] for odometry, _ in found]).sum(axis=1)
    variance = np.diagonal(found[0][1].sum(axis=0))
    assert np.mean(steps**2, axis=0) / variance == pytest.approx(1, abs=0.25)


def test_poses_must_be_there(clone, tmp_path):
    path = tmp_path / "7.tum"
    write_tum(path, 0.05 * np.arange(10), np.tile([0.0, 0, 0, 0, 0, 0, 1], (10, 1)))
    with pytest.raises(InputError, match=r"7\.tum: has 10 poses, expected one every 0\.05 s for 46 frames"):
        true_poses(tmp_path, Walk.find(clone, 7))
