"""Specifications: what they stand for, their splits, and one clear sentence for what is wrong."""

from collections import Counter
from pathlib import Path

import pytest
import yaml

from radarize.errors import InputError
from radarsim.dataset.specification import Specification

PLAIN = {
    "name": "plain",
    "seed": 1,
    "buildings": {"old": {"kind": "B", "seed": 3}, "office": "office"},
    "recordings": [
        {"building": "old", "floors": [0, 2], "platform": "handheld", "count": 3, "duration": 2},
        {"building": "office", "platform": ["cart", "robot"], "count": 2, "duration": 1.5},
    ],
}


def load(folder: Path, **changes: object) -> Specification:
    path = folder / "spec.yaml"
    path.write_text(yaml.safe_dump(PLAIN | changes, sort_keys=False))
    return Specification.load(path)


def test_recordings_of_a_specification(tmp_path):
    tasks = load(tmp_path).tasks
    assert [task.name for task in tasks] == [
        "old_0_handheld_00", "old_2_handheld_00", "old_0_handheld_01", "office_cart_00", "office_cart_01",
        "office_robot_00", "office_robot_01",
    ]  # fmt: skip
    assert [task.frames for task in tasks] == [60] * 3 + [45] * 4
    assert tasks[1].scene == {"building": {"kind": "B", "seed": 3, "floor": 2}}
    assert Path(tasks[3].scene).name == "office.yaml"
    assert len({task.seed for task in tasks}) == 7


def test_seeds_depend_on_nothing_but_seed_and_name(tmp_path):
    seeds = {task.name: task.seed for task in load(tmp_path).tasks}
    turned = load(tmp_path, recordings=PLAIN["recordings"][::-1], radar="two-tx", name="other")
    assert {task.name: task.seed for task in turned.tasks} == seeds
    more = PLAIN["recordings"][0] | {"count": 9}
    assert seeds.items() >= {t.name: t.seed for t in load(tmp_path, recordings=[more]).tasks if t.name in seeds}.items()
    assert not set(seeds.values()) & {task.seed for task in load(tmp_path, seed=2).tasks}


def test_parameters_tell_recordings_apart(tmp_path):
    """Whatever decides the bytes changes the identity, and a moved file does not."""
    plain = load(tmp_path).tasks[3].identity
    scene = tmp_path / "mine.yaml"
    changes = [{"seed": 2}, {"radar": "two-tx"}, {"sensors": ["imu"]}, {"storage": "heatmaps"}]
    assert len({plain, *(load(tmp_path, **change).tasks[3].identity for change in changes)}) == 5
    seen = []
    for text in ("building: {kind: office, seed: 1}", "building: {kind: office, seed: 2}"):
        scene.write_text(text)
        seen.append(load(tmp_path, buildings=PLAIN["buildings"] | {"office": "mine.yaml"}).tasks[3].identity)
    assert seen[0] != seen[1]
    (tmp_path / "elsewhere").mkdir()
    scene.rename(tmp_path / "elsewhere" / "mine.yaml")
    moved = load(tmp_path / "elsewhere", buildings=PLAIN["buildings"] | {"office": "mine.yaml"})
    assert moved.tasks[3].identity == seen[1]


def test_the_papers_data_set():
    """Counts, platforms and splits of pipeline.md, section 7."""
    found = Specification.load("radarize146")
    counts = Counter((task.platform, task.building) for task in found.tasks)
    for platform, table in (("handheld", (15, 9, 12, 11)), ("cart", (10, 11, 15, 9)), ("robot", (9, 15, 15, 15))):
        assert tuple(counts[platform, building] for building in "ABCD") == table
    assert len(found.tasks) == 146 and {task.duration for task in found.tasks} == {60}
    assert len({(task.building, task.floor) for task in found.tasks}) > 8
    assert list(found.members) == [
        *(f"random-{k}" for k in range(5)), "platform", "building-A", "building-B", "building-C"
    ]  # fmt: skip
    names = {task.name for task in found.tasks}
    for parts in found.members.values():
        together = [name for part in parts.values() for name in part]
        assert len(together) == len(set(together)) and set(together) <= names
    drawn = [found.members[f"random-{k}"] for k in range(5)]
    assert all([len(parts[p]) for p in ("train", "validation", "test")] == [102, 15, 29] for parts in drawn)
    assert len({tuple(parts["test"]) for parts in drawn}) == 5
    platform = found.members["platform"]
    assert all("_handheld_" in name for part in ("train", "validation") for name in platform[part])
    assert len(platform["test"]) == 45 + 54 and not any("_handheld_" in name for name in platform["test"])
    held_out = found.members["building-B"]
    assert all(name.startswith("B_") == (part == "test") for part, names in held_out.items() for name in names)
    assert len(held_out["test"]) == 35 and len(held_out["validation"]) == 11


def test_the_small_data_set():
    found = Specification.load("small")
    assert len(found.tasks) == 12 and {task.duration for task in found.tasks} == {20}
    assert {(task.building, task.platform) for task in found.tasks} == {
        (building, platform) for building in "ABCD" for platform in ("handheld", "cart", "robot")
    }
    assert all(parts["train"] and parts["test"] for parts in found.members.values())


GROUP = PLAIN["recordings"][0]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"seed": -1}, "seed is -1"),
        ({"bogus": 1}, "bogus: unknown key"),
        ({"name": "a b"}, 'name is "a b"'),
        ({"sensors": ["deph"]}, "sensors: 'deph' is unknown, expected all or some of depth"),
        ({"storage": "both"}, "storage is \"both\": input should be 'raw' or 'heatmaps'"),
        ({"radar": "x.cfg"}, "x.cfg: no such radar configuration"),
        ({"frontend": "x.yaml"}, "x.yaml: cannot be read"),
        ({"buildings": {"old": {"kind": "Z"}}}, "buildings.old: "),
        ({"buildings": {"old": {"kind": "B", "seed": -4}}}, "buildings.old: seed is -4"),
        ({"buildings": {"office": "nowhere.yaml"}}, "buildings.office: scene file nowhere.yaml does not exist"),
        ({"recordings": []}, "recordings is []"),
        ({"recordings": [{"building": "old"}]}, "has no recordings[0].platform"),
        ({"recordings": [GROUP | {"platform": "drone"}]}, 'recordings[0].platform is "drone"'),
        ({"recordings": [GROUP | {"count": 0}]}, "recordings[0].count is 0"),
        ({"recordings": [GROUP | {"duration": 0.001}]}, "recordings[0].duration is 0.001 s, expected at least one"),
        ({"recordings": [GROUP | {"building": "x"}]}, "recordings[0].building is 'x', expected one of buildings: old"),
        ({"recordings": [GROUP | {"building": "office"}]}, "recordings[0].floors is [0, 2], but building office is a"),
        ({"splits": {"a": {"kind": "random", "train": 0.5}}}, "splits.a: train + validation + test is 0.8, expected 1"),
        ({"splits": {"a": {"kind": "x"}}}, "splits.a: input tag 'x'"),
        ({"splits": {"a": {"kind": "random", "folds": 0}}}, "splits.a.folds is 0"),
        ({"splits": {"a": {"kind": "platform", "train": ["x"]}}}, "splits.a: train names 'x', expected some of: cart"),
        (
            {"splits": {"a": {"kind": "platform", "train": ["cart"], "test": ["cart"]}}},
            "splits.a: 'cart' is in train and in test",
        ),
        ({"splits": {"a": {"kind": "building", "held_out": ["x"]}}}, "splits.a: held_out names 'x', expected some of"),
    ],
)
def test_mistakes_are_one_sentence(tmp_path, changes, expected):
    with pytest.raises(InputError) as error:
        load(tmp_path, **changes | {"buildings": PLAIN["buildings"] | changes.get("buildings", {})})
    assert f"{tmp_path / 'spec.yaml'}: " in str(error.value) and expected in str(error.value)
    assert "\n" not in str(error.value)


def test_files_that_are_no_specification(tmp_path):
    with pytest.raises(
        InputError, match="no specification 'huge', expected .* one of: evaluation, radarize146, small, training"
    ):
        Specification.load("huge")
    path = tmp_path / "x.yaml"
    for text, expected in (("a: [", "malformed YAML"), ("7", "holds int, expected keys")):
        path.write_text(text)
        with pytest.raises(InputError, match=expected):
            Specification.load(path)
