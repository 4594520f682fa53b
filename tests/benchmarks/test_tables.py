"""What the tables make of recordings: grouping, pooling, means."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import evaluation, mapping, odometry, transfer
from benchmarks.evaluation import Case, groups
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.evaluation.trajectory import trajectory
from radarize.pipeline import BATCH, run
from radarize.tum import planar_poses
from radarsim.simulate import simulate


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    """Two seconds of the office with provenance."""
    path = tmp_path_factory.mktemp("data") / "office.h5"
    return simulate("office", path, duration=1.5, seed=4, sensors=["ghosts"])


def test_groups_hold_every_recording_by_platform_building_and_all():
    found = [Case(Path(f"{i}.h5"), *of) for i, of in enumerate([("A", "cart"), ("B", "handheld"), ("A", "handheld")])]
    assert groups(found) == {"handheld": [1, 2], "cart": [0], "A": [0, 2], "B": [1], "all": [0, 1, 2]}


def test_a_recording_says_what_it_is_of(recording):
    with evaluation.cases(recording.parent) as found:
        assert found == [Case(recording, "office", "handheld")]


def followed(length: float, speed: float, turn: float, variance: float, frames: int = 40) -> odometry.Followed:
    """A straight walk that odometry takes for faster by `speed` m/s and turning by `turn` rad a frame."""
    times, zero = np.arange(frames) / 10, np.zeros(frames)
    true = np.column_stack([np.linspace(0, length, frames), zero, zero])
    seen = true * [1.1, 1, 1]
    errors = [evaluate_trajectory(*(trajectory(times, planar_poses(poses)) for poses in (seen, true)))]
    velocity = np.tile([1.0, 0.0], (frames, 1))
    return odometry.Followed(
        velocity + [speed, 0], np.tile(np.eye(2) * 0.01, (frames, 1, 1)), velocity, np.full(frames - 8, 8 * turn),
        np.full(frames - 8, 8 * variance), np.full(frames - 1, turn), np.full(frames - 1, variance), *errors,
    )  # fmt: skip


def test_frames_are_pooled_and_trajectories_averaged():
    one, other = followed(4.0, 0.1, 0.01, 1e-4), followed(8.0, -0.3, -0.03, 1e-4)
    row = odometry.row([one, other])
    assert row["velocity RMSE m/s"] == pytest.approx(np.sqrt((0.1**2 + 0.3**2) / 2))
    assert row["bias"] == pytest.approx(-0.1)
    assert row["yaw over 0.27 s, RMSE deg"] == pytest.approx(np.degrees(8 * np.sqrt((0.01**2 + 0.03**2) / 2)))
    assert row["ATE m"] == pytest.approx((one.path.position.mean + other.path.position.mean) / 2)
    assert one.path.position.mean == pytest.approx(0.1 * 4 / 4, rel=0.05)  # a tenth too long, about its middle
    assert row["NEES velocity (median)"].startswith("2.50 (")  # (1 + 9) / 2 deviations squared, one of two dimensions
    assert row["NEES yaw step"] == pytest.approx(5)
    assert row["NEES yaw over 0.27 s"] == pytest.approx(40)  # errors that all go one way
    assert row["RE per metre, m, rad"].startswith("0.1")


def test_odometry_of_a_recording_is_that_of_the_pipeline(recording, tmp_path):
    found = odometry.follow(Case(recording, "office", "handheld"), ["doppler"], None)["doppler"]
    folder = run(recording, tmp_path / "run", odometry="doppler", scans="first-echo")
    from radarize.evaluation.evaluate import evaluate

    metrics = evaluate(folder)
    assert found.path.position.mean == pytest.approx(metrics["odometry"]["ate"]["position"]["mean"], abs=1e-6)
    row = odometry.row([found])
    assert row["velocity RMSE m/s"] == pytest.approx(metrics["velocity"]["rmse"], rel=1e-5)
    assert len(found.steps) == len(found.velocity) - 1 and len(found.velocity) > 2 * BATCH


def test_wrong_returns_have_a_cause(recording, tmp_path):
    case = Case(recording, "office", "handheld")
    found = mapping.judge(case, ["first-echo"], "doppler", None, tmp_path)["first-echo"]
    wrong = 1 - found["scans"]["within_10cm"]
    assert 0.05 < wrong < 0.6
    assert sum(found["causes"].values()) == pytest.approx(wrong, abs=1e-6)
    assert found["causes"]["ghosts"] < 0.1
    assert mapping.mean([found, {"map": {"chamfer": None}}], "map", "f1") == found["map"]["f1"]


def test_a_frame_is_far_from_others_only_if_it_is_unlike_them():
    rng = np.random.default_rng(0)
    maps = rng.normal(0, 5, (10, 32, 40))
    like, among = transfer.distances(maps, rng.normal(0, 5, (1, 32, 40)))
    unlike, _ = transfer.distances(maps, rng.normal(0, 8, (1, 32, 40)))
    assert like < 1.5 * among.max() and unlike > 3 * among.max()
