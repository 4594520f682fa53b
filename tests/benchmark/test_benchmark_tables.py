"""What tables make of runs: grouping, pooling, means, text."""

import json
from pathlib import Path

import numpy as np
import pytest

from radarize.benchmark import odometry, runtime
from radarize.benchmark.dataset import DataSet, groups
from radarize.benchmark.results import Results
from radarize.benchmark.table import Table, ahead, mean
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.evaluation.trajectory import trajectory
from radarize.tum import planar_poses
from tests.benchmark.rooms import write_rooms


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> DataSet:
    return DataSet.load(write_rooms(tmp_path_factory.mktemp("rooms"), frames=2))


def names(found: dict) -> dict[str, list[str]]:
    return {name: [case.name for case in cases] for name, cases in found.items()}


def test_recordings_are_grouped_by_platform_building_and_all(rooms):
    assert names(groups(list(rooms.cases))) == {
        "handheld": ["A_handheld"],
        "cart": ["A_cart"],
        "robot": ["B_robot"],
        "A": ["A_cart", "A_handheld"],
        "B": ["B_robot"],
        "all": ["A_cart", "A_handheld", "B_robot"],
    }


def test_test_parts_of_splits_or_what_stands_for_them(rooms, tmp_path):
    assert names(rooms.splits("random")) == {"random-0": ["A_handheld", "A_cart"], "random-1": ["A_handheld"]}
    assert names(rooms.splits("platform")) == {"platform": ["A_cart", "B_robot"]}
    for path in rooms.folder.glob("*.h5"):
        (tmp_path / path.name).symlink_to(path)
    plain = DataSet.load(tmp_path)
    assert not plain.trainable("random") and rooms.trainable("random") and rooms.seed == 5 and plain.seed is None
    assert names(plain.splits("random")) == {"all": ["A_cart", "A_handheld", "B_robot"]}
    assert names(plain.splits("platform")) == {"platform": ["A_cart", "B_robot"]}
    assert names(plain.splits("building")) == {"building-A": ["A_cart", "A_handheld"], "building-B": ["B_robot"]}


def test_folders_of_data_sets_make_one(rooms, tmp_path):
    for name in ("loops", "tilt"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "A_cart.h5").symlink_to(rooms.folder / "A_cart.h5")
    assert [case.name for case in DataSet.load(tmp_path).cases] == ["loops/A_cart", "tilt/A_cart"]


def followed(length: float, speed: float, turn: float, variance: float, frames: int = 40) -> odometry.Followed:
    """A straight walk that odometry takes for faster by `speed` m/s and turning by `turn` rad a frame."""
    times, zero = np.arange(frames) / 10, np.zeros(frames)
    true = np.column_stack([np.linspace(0, length, frames), zero, zero])
    seen = true * [1.1, 1, 1]
    errors = evaluate_trajectory(*(trajectory(times, planar_poses(poses)) for poses in (seen, true)))
    velocity = np.tile([1.0, 0.0], (frames, 1))
    return odometry.Followed(
        velocity + [speed, 0], np.tile(np.eye(2) * 0.01, (frames, 1, 1)), velocity, np.full(frames - 8, 8 * turn),
        np.full(frames - 8, 8 * variance), np.full(frames - 1, turn), np.full(frames - 1, variance), errors.summary(),
    )  # fmt: skip


def test_frames_are_pooled_and_trajectories_averaged():
    one, other = followed(4.0, 0.1, 0.01, 1e-4), followed(8.0, -0.3, -0.03, 1e-4)
    row = odometry.row([one, other])
    assert row["velocity RMSE m/s"] == pytest.approx(np.sqrt((0.1**2 + 0.3**2) / 2))
    assert row["bias"] == pytest.approx(-0.1)
    assert row["yaw over 0.27 s, RMSE deg"] == pytest.approx(np.degrees(8 * np.sqrt((0.01**2 + 0.03**2) / 2)))
    means = [each.path["ate"]["position"]["mean"] for each in (one, other)]
    assert row["ATE m"] == pytest.approx(sum(means) / 2)
    assert means[0] == pytest.approx(0.1 * 4 / 4, rel=0.05)  # a tenth too long, about its middle
    assert row["NEES velocity (median)"].startswith("2.50 (")  # (1 + 9) / 2 deviations squared, one of two dimensions
    assert row["NEES yaw step"] == pytest.approx(5)
    assert row["NEES yaw over 0.27 s"] == pytest.approx(40)  # errors that all go one way
    assert row["RE per metre, m, rad"].startswith("0.1")


def test_stages_add_up_as_in_the_paper():
    spent = {"spectra": 2.0, "maps": 1.0, "translation": 3.0, "rotation": 5.0, "scans": 4.0, "slam": 1.0, "icp": 7.0}
    took = runtime.stages({"stages": spent, "whole": 25.0})
    assert took["preprocess"] == 3 and took["other"] == 7 and took["map"] == 4
    assert took["longest path"] == 3 + 7 + 1 and took["whole, with reading"] == 25
    assert sum(runtime.PAPER["RTX 3090"][k] for k in (0, 2, 4)) == pytest.approx(runtime.PAPER["RTX 3090"][5], abs=0.01)


def test_a_table_as_text_and_json(tmp_path):
    table = Table("One", [{"who": "a", "x": 0.12345, "n": 3}, {"who": "b", "x": np.nan, "n": None}], ["A note."])
    assert table.numbers() == (1, 2)
    results = Results("Two", [table], ["Of all."], "radarize benchmark x", 5, {"commit": "abc"})
    text = results.write(tmp_path, "x").read_text()
    assert "| a | 0.1235 | 3 |\n| b | - | - |\n\n- A note.\n" in text and text.startswith("# Two\n\n## One\n")
    assert text.endswith("- Of all.\n\n`radarize benchmark x`, seed 5; commit abc.\n")
    found = json.loads((tmp_path / "x.json").read_text())
    assert found["tables"][0]["rows"][1] == {"who": "b", "x": None, "n": None} and found["seed"] == 5
    lone = Results("One", [table], [], "c", None, {"commit": "abc"})
    assert lone.markdown().startswith("# One\n\n| who") and lone.markdown().endswith("`c`, commit abc.\n")


def test_ahead_or_where_not():
    rows = [{"who": "ours", "x": 1.0, "y": 2.0}, {"who": "b", "x": 3.0, "y": 1.5}, {"who": "c", "x": None, "y": np.nan}]
    assert ahead(rows, 0, "ours", ["x"]) == "ours has the least error in every column."
    assert ahead(rows, 0, "ours", ["x", "y"]) == "ours is behind in y (2, best 1.5)."
    assert mean([1.0, None, 3.0, np.nan]) == 2 and np.isnan(mean([None]))


def test_folders_are_not_the_readers_business(monkeypatch):
    from radarize.benchmark.results import command

    monkeypatch.setattr(
        "sys.argv", ["x", "benchmark", "all", "--data", str(Path("/somewhere/deep/small")), "-o", "out"]
    )
    assert command("radarize") == "radarize benchmark all --data small -o out"
