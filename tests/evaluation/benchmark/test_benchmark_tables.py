"""Tables of runs (grouping, pooling, means, text), and the provenance of results."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from radarize.evaluation.benchmark import odometry, runtime
from radarize.evaluation.benchmark.choices import CHOICES, SETS, tuned_on
from radarize.evaluation.benchmark.dataset import DataSet, groups
from radarize.evaluation.benchmark.frame_errors import FrameErrors
from radarize.evaluation.benchmark.results import Data, NamedWalk, Results, UsedNetwork, command, commit
from radarize.evaluation.benchmark.table import PAPER, Table
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.errors import InputError
from radarize.io.tum import planar_poses
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.method import Weights
from radarsim.dataset.specification import Specification
from tests.evaluation.benchmark.rooms import write_rooms


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> DataSet:
    return DataSet.load(write_rooms(tmp_path_factory.mktemp("rooms"), frames=2))


def names(found: dict) -> dict[str, list[str]]:
    return {name: [case.name for case in cases] for name, cases in found.items()}


def test_recordings_are_grouped_by_platform_building_and_all(rooms):
    assert names(groups(rooms.cases)) == {
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
    assert not plain.trainable("random") and rooms.trainable("random")
    assert rooms.data(rooms.cases).seed == 5 and plain.data([]).seed is None
    assert names(plain.splits("random")) == {"all": ["A_cart", "A_handheld", "B_robot"]}
    assert names(plain.splits("platform")) == {"platform": ["A_cart", "B_robot"]}
    assert names(plain.splits("building")) == {"building-A": ["A_cart", "A_handheld"], "building-B": ["B_robot"]}


def test_folders_of_data_sets_make_one(rooms, tmp_path):
    for name in ("loops", "tilt"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "A_cart.h5").symlink_to(rooms.folder / "A_cart.h5")
    assert [case.name for case in DataSet.load(tmp_path).cases] == ["loops/A_cart", "tilt/A_cart"]


def followed(length: float, speed: float, turn: float, frames: int = 40) -> tuple[FrameErrors, dict]:
    """Return a straight walk with an odometry error of `speed` m/s and `turn` rad per frame, and its errors."""
    times, zero = np.arange(frames) / 30, np.zeros(frames)
    true = np.column_stack([np.linspace(0, length, frames), zero, zero])
    seen = true * [1.1, 1, 1]
    errors = evaluate_trajectory(*(trajectory(times, planar_poses(poses)) for poses in (seen, true)))
    velocity = np.tile([1.0, 0.0], (frames, 1))
    found = FrameErrors(
        velocity + [speed, 0],
        np.tile(np.eye(2) * 0.01, (frames, 1, 1)),
        velocity,
        np.column_stack([zero, zero, turn * np.arange(frames)]),
        zero,
        ErrorModel.independent(np.tile(np.eye(3) * 1e-4, (frames, 1, 1))),
        1 / 30,
    )
    return found, errors.summary()


def test_frames_are_pooled_and_trajectories_averaged():
    (one, path), (other, longer) = followed(4.0, 0.1, 0.01), followed(8.0, -0.3, -0.03)
    row = odometry.row(pd.json_normalize([{"odometry": path}, {"odometry": longer}]), [one, other])
    assert row["velocity RMSE m/s"] == pytest.approx(np.sqrt((0.1**2 + 0.3**2) / 2))
    assert row["bias"] == pytest.approx(-0.1)
    assert row["yaw over 0.27 s, RMSE deg"] == pytest.approx(np.degrees(8 * np.sqrt((0.01**2 + 0.03**2) / 2)))
    means = [each["ate"]["position"]["mean"] for each in (path, longer)]
    assert row["ATE m"] == pytest.approx(sum(means) / 2)
    assert means[0] == pytest.approx(0.1 * 4 / 4, rel=0.05)  # a tenth too long, about its middle
    assert row["NEES velocity (median)"].startswith("2.50 (")  # (1 + 9) / 2 deviations squared, one of two dimensions
    assert row["NEES yaw step"] == pytest.approx(5)
    assert row["NEES yaw over 0.27 s"] == pytest.approx(40)  # all errors have the same sign
    assert row["RE per metre, m, rad"].startswith("0.1")


def test_stages_add_up_as_in_the_paper():
    spent = {"spectra": 2.0, "maps": 1.0, "translation": 3.0, "rotation": 5.0, "scans": 4.0, "slam": 1.0, "icp": 7.0}
    took = runtime.stages({"stages": spent, "whole": 25.0})
    assert took["preprocess"] == 3 and took["other"] == 7 and took["map"] == 4
    assert took["longest path"] == 3 + 7 + 1 and took["whole, with reading"] == 25
    device = runtime.DEVICES["RTX 3090"]
    assert sum(device[k] for k in (0, 2, 4)) == pytest.approx(device[5], abs=0.01)


MACHINE = {"processor": "abacus", "cores": "2", "version": "0", "commit": "abc (clean)"}
NETWORK = UsedNetwork("rotation", 1234567, "training", "random-0", 5)
TABLE = Table("One", [{"who": "a", "x": 0.12345, "n": 3}, {"who": "b", "x": np.nan, "n": None}], ["A note."])
RESULTS = Results(
    "Two", [TABLE], Data("d", (NamedWalk("office", 7, 12.3, True),), 5), (NETWORK,), "c", ["Of all."], MACHINE
)


def test_results_have_their_provenance_and_can_be_read_again(tmp_path):
    assert TABLE.numbers() == (1, 2)
    text = RESULTS.write(tmp_path, "x").read_text()
    assert "| a | 0.1235 | 3 |\n| b | - | - |\n\n- A note.\n" in text and text.startswith("# Two\n\n## One\n")
    assert text.endswith(
        "- Of all.\n- **Data**: d, 1 recordings, 12 m walked, all simulated, seed 5; 1 of 1 in the tuning set of scans "
        "and the back end's preset radar.\n- **Networks**: rotation, 1,234,567 parameters, trained on training "
        "(random-0), 5 epochs.\n- **Command**: `c`.\n- **Machine**: processor abacus, cores 2, version 0, commit abc "
        "(clean).\n"
    )
    assert Results.read(tmp_path / "x.json").markdown() == text
    lone = replace(RESULTS, tables=[replace(TABLE, title="Two")])
    assert lone.markdown().startswith("# Two\n\n| who")


@pytest.mark.parametrize("missing", ["data", "networks", "command"])
def test_results_without_their_origin_are_refused(missing):
    with pytest.raises(ValueError, match=f"has no {missing}"):
        replace(RESULTS, **{missing: None})
    with pytest.raises(ValueError, match="lacks commit"):
        replace(RESULTS, machine={name: word for name, word in MACHINE.items() if name != "commit"})


@pytest.mark.parametrize("row", [{"who": "ours", "paper: ATE m": 1.0}, {"who": "paper, RTX 3090", "ms": 1.0}])
def test_the_papers_results_are_marked_as_of_real_recordings(row):
    with pytest.raises(ValueError, match="figures of the paper"):
        Table("T", [row])
    results = replace(RESULTS, tables=[Table("T", [row], beside=(PAPER,))])
    assert "**Beside**: paper: real recordings of its authors" in results.markdown()
    assert "all simulated" in results.facts["Data"]


def test_a_page_of_another_layout_is_refused(tmp_path):
    path = tmp_path / "x.json"
    path.write_text('{"title": "Old", "tables": [], "notes": [], "command": "c", "seed": 1, "machine": {}}')
    with pytest.raises(InputError, match="is no page of results as this version writes them"):
        Results.read(path)


def test_path_length_and_origin_of_a_recording(rooms):
    (walk, *_) = (case.walk for case in rooms.cases)
    assert walk.scene == "A_0" and walk.seed is None and not walk.simulated and 0 < walk.metres < 1
    data = Data("d", (walk, replace(walk, simulated=True, metres=None)))
    assert "2 recordings, 0 m walked (1 without true poses), 1 simulated, 1 real" in data.sentence


def test_recordings_of_tuning_sets_are_listed():
    tasks = Specification.load("evaluation").tasks
    assert [task.seed for task in tasks] == [seed for seeds in SETS["EVALUATION"].values() for seed in seeds]
    walks = [NamedWalk(scene, seed, 1.0, True) for scene, seeds in SETS["EVALUATION"].items() for seed in seeds]
    listed = tuned_on(walks)
    assert len(listed) == 2 and listed[0].startswith("at most 4 of 15 in the tuning set of the probability")
    assert tuned_on(walks[:2])[1].startswith("at most 2 of 2")
    others = [replace(walk, seed=1) for walk in walks]
    assert tuned_on(others) == ["none in a tuning set", "other walks through A_0, B_0, C_0, D_0, office are"]
    assert tuned_on([NamedWalk("elsewhere", 1, 1.0, True)]) == ["none in a tuning set"]
    assert all(choice.recordings for choice in CHOICES)


def test_size_and_training_of_networks():
    network = UsedNetwork.of(Weights(None).of("rotation"))
    assert (
        network.sentence.startswith("rotation, width 16, 70")
        and "5.5 h of training, then any-radar, then training, then training, then any-radar, then any-radar (random-0)"
        in network.sentence
    )


def test_a_commit_is_of_the_sources_that_run(tmp_path):
    if (Path(__file__).parents[3] / ".git").exists():
        assert re.fullmatch(r"[0-9a-f]{7,} \((clean|\d+ files changed since)\)", commit(Path(__file__)))
    inside = tmp_path / "environment" / "package.py"
    inside.parent.mkdir()
    inside.touch()
    assert commit(inside) == "not a checkout"


def test_ahead_or_where_not():
    rows = [{"who": "ours", "ATE m": 1.0, "RE m": 2.0}, {"who": "b", "ATE m": 3.0, "RE m": 1.5}]
    rows.append({"who": "c", "ATE m": None, "RE m": np.nan})
    assert Table("T", rows).ahead(0, "ours") == ("ours has larger errors than the best method in RE m (2, best 1.5).")
    assert Table("T", [rows[0] | {"RE m": 1.0}, *rows[1:]]).ahead(0, "ours") == (
        "ours has the least error in every column."
    )


def test_folders_are_not_the_readers_business(monkeypatch):
    monkeypatch.setattr(
        "sys.argv", ["x", "benchmark", "all", "--data", str(Path("/somewhere/deep/small")), "-o", "out"]
    )
    assert command("radarize") == "radarize benchmark all --data small -o out"
