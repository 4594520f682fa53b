"""Trajectory errors against evo's own commands and closed forms."""

import json
import zipfile
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from radarize.evaluation.metrics import evaluate_trajectory
from radarize.io.alignment import load, matched, trajectory
from radarize.io.errors import InputError
from tests.evaluation.fake_run import write_run

FREIBURG = Path(__file__).parents[3] / "shared" / "recordings" / "tum-freiburg1"


def walk(seed: int = 0, count: int = 301, rate: float = 30.0):
    """A smooth planar walk; returns times and poses."""
    rng = np.random.default_rng(seed)
    times = np.arange(count) / rate
    yaw = np.cumsum(rng.normal(0, 0.02, count)) + 0.4 * np.sin(times)
    steps = 1.0 / rate * np.column_stack([np.cos(yaw), np.sin(yaw)])
    poses = np.zeros((count, 7))
    poses[1:, :2] = np.cumsum(steps[:-1], axis=0)
    poses[:, 3:] = Rotation.from_euler("z", yaw[:, None]).as_quat()
    return times, poses


def transformed(poses, angle, shift):
    turn = Rotation.from_euler("z", angle)
    return np.hstack([turn.apply(poses[:, :3]) + shift, (turn * Rotation.from_quat(poses[:, 3:])).as_quat()])


def evo(command: str, relation: str, reference: Path, estimate: Path, home: Path) -> dict[str, float]:
    """Statistics of `evo_ape` (after alignment) or `evo_rpe` (from pose to pose)."""
    archive = home / f"{command}-{relation}.zip"
    options = ["-r", relation, "--t_max_diff", "0.01", "--save_results", str(archive)]
    options += ["-a"] if command == "ape" else ["--delta", "1", "--delta_unit", "f"]
    program, parser = (import_module(f"evo.cli.{command}{part}") for part in ("", "_parser"))
    program.run(parser.parser().parse_args(["tum", str(reference), str(estimate), *options]))
    with zipfile.ZipFile(archive) as content:
        return json.loads(content.read("stats.json"))


@pytest.fixture(params=["freiburg", "run"])
def pair(request, tmp_path) -> tuple[Path, Path]:
    """Reference and estimate: a public pair of six degrees of freedom, or of a run, which has a frame of its own."""
    if request.param == "run":
        run = write_run(tmp_path / "run")
        return run / "reference.tum", run / "odometry.tum"
    if not FREIBURG.is_dir():
        pytest.skip("../shared/recordings/tum-freiburg1 is not there")
    return FREIBURG / "freiburg1_xyz-groundtruth.txt", FREIBURG / "freiburg1_xyz-rgbdslam.txt"


def test_agrees_with_the_evo_commands(pair, tmp_path):
    errors = evaluate_trajectory(load(pair[1]), load(pair[0]), in_plane=False, association="nearest")
    ours = {
        ("ape", "trans_part"): errors.position,
        ("ape", "angle_rad"): errors.rotation,
        ("rpe", "trans_part"): errors.relative["frame"]["position"],
        ("rpe", "angle_rad"): errors.relative["frame"]["rotation"],
    }
    for (command, relation), statistics in ours.items():
        theirs = evo(command, relation, *pair, tmp_path)
        for name in ("mean", "rmse", "max"):
            assert getattr(statistics, name) == pytest.approx(theirs[name], abs=1e-6), (command, relation, name)


def test_a_moved_copy_has_no_error():
    times, poses = walk()
    errors = evaluate_trajectory(trajectory(times, transformed(poses, 2.0, [3, -1, 0])), trajectory(times, poses))
    assert errors.position.max < 1e-9 and errors.rotation.max < 1e-7
    assert errors.drift < 1e-9
    assert errors.distance == pytest.approx(10.0, rel=1e-6)
    np.testing.assert_allclose(errors.turn[:2, :2], [[np.cos(2), np.sin(2)], [-np.sin(2), np.cos(2)]], atol=1e-9)


def test_a_straight_walk_aligns_in_the_plane_but_never_flips():
    times = np.arange(100) / 10
    poses = np.zeros((100, 7))
    poses[:, 0], poses[:, 6] = 0.5 * times, 1
    errors = evaluate_trajectory(trajectory(times, transformed(poses, -1.0, [1, 1, 0])), trajectory(times, poses))
    assert errors.position.max < 1e-9 and errors.rotation.max < 1e-6


def test_standing_still_is_aligned_by_attitude():
    times = np.arange(50) / 10
    poses = np.zeros((50, 7))
    poses[:, 6] = 1
    errors = evaluate_trajectory(trajectory(times, transformed(poses, 0.7, [1, 1, 0])), trajectory(times, poses))
    assert errors.position.max < 1e-9 and errors.rotation.max < 1e-6
    assert errors.summary()["drift"] is None


def test_relative_errors_of_wrong_scale_and_turn_rate():
    # Speed 3 % too high along a line: 3 cm over a metre and over a second at 1 m/s, 1 mm a frame.
    times = np.arange(301) / 30
    poses = np.zeros((301, 7))
    poses[:, 0], poses[:, 6] = times, 1
    fast = poses.copy()
    fast[:, 0] *= 1.03
    errors = evaluate_trajectory(trajectory(times, fast), trajectory(times, poses))
    assert errors.relative["metre"]["position"].mean == pytest.approx(0.03, rel=1e-6)
    assert errors.relative["second"]["position"].mean == pytest.approx(0.03, rel=1e-6)
    assert errors.relative["frame"]["position"].mean == pytest.approx(0.001, rel=1e-6)
    assert errors.drift == pytest.approx(0.03, rel=1e-6)
    # Heading that drifts by 0.02 rad/s.
    turning = poses.copy()
    turning[:, 3:] = Rotation.from_euler("z", 0.02 * times[:, None]).as_quat()
    errors = evaluate_trajectory(trajectory(times, turning), trajectory(times, poses))
    assert errors.relative["second"]["rotation"].mean == pytest.approx(0.02, rel=1e-6)
    assert errors.relative["frame"]["rotation"].mean == pytest.approx(0.02 / 30, rel=1e-6)
    # Aligned by position, which is exact: the rotation error is the drift itself, 0...0.2 rad.
    assert errors.rotation.mean == pytest.approx(0.1, rel=1e-6)


def test_the_plane_leaves_height_and_tilt_out():
    times, poses = walk()
    shaken = poses.copy()
    shaken[:, 2] = 1 + 0.05 * np.sin(10 * times)
    tilt = Rotation.from_euler("y", 0.3 * np.sin(7 * times)[:, None])
    shaken[:, 3:] = (Rotation.from_quat(poses[:, 3:]) * tilt).as_quat()
    errors = evaluate_trajectory(trajectory(times, poses), trajectory(times, shaken))
    assert errors.position.max < 1e-9 and errors.rotation.max < 1e-6
    assert evaluate_trajectory(trajectory(times, poses), trajectory(times, shaken), in_plane=False).rotation.max > 0.1


def test_a_denser_and_offset_reference_is_interpolated():
    times, poses = walk(count=3001, rate=300.0)
    later = times[5:-10:20] + 0.0013
    inner = trajectory(times, poses)
    at, reference = matched(trajectory(later, poses[5:-10:20]), inner)
    assert len(at.timestamps) == len(later)
    between = poses[5:-10:20, :3] + 0.0013 * 300 * (poses[6:-9:20, :3] - poses[5:-10:20, :3])
    np.testing.assert_allclose(reference.positions_xyz, between, atol=1e-9)
    _, nearest = matched(trajectory(later, poses[5:-10:20]), inner, association="nearest")
    np.testing.assert_allclose(nearest.positions_xyz, poses[5:-10:20, :3], atol=1e-12)


def test_long_gaps_of_the_reference_are_not_bridged():
    times, poses = walk()
    holes = (times < 3) | (times > 5)
    at, _ = matched(trajectory(times, poses), trajectory(times[holes], poses[holes]))
    assert not np.any((at.timestamps > 3) & (at.timestamps < 5))
    assert len(at.timestamps) == holes.sum()


def test_bad_input_is_one_sentence(tmp_path):
    times, poses = walk()
    good = trajectory(times, poses)
    with pytest.raises(InputError, match="0 of 301 poses have a counterpart.*spans 100"):
        evaluate_trajectory(trajectory(times + 100, poses), good)
    broken = poses.copy()
    broken[7, 1] = np.nan
    with pytest.raises(InputError, match="estimate: 1 of 301 poses are not finite"):
        evaluate_trajectory(trajectory(times, broken), good)
    for content in ("", "# only a comment\n", "1 2 3\n", "0 0 0 nan 0 0 0 1\n"):
        (tmp_path / "bad.tum").write_text(content)
        with pytest.raises(InputError, match="bad.tum"):
            load(tmp_path / "bad.tum")
