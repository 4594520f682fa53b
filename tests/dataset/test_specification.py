"""Specifications: expansion, splits, and error messages of one sentence."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from radarize.io.errors import InputError
from radarize.io.yamlfile import read_yaml
from radarize.radar.array import azimuth_row, virtual_positions
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS, load_config
from radarsim.dataset import specification
from radarsim.dataset.specification import Specification
from radarsim.receiver.frontend_config import Channel, FrontEndConfig, Leakage
from radarsim.world import description
from radarsim.world.description import shipped

CONFIG = PRESETS["radarize"]

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


def test_buildings_have_clutter_and_unevenness(tmp_path):
    """Clutter, unevenness and other radars are top-level keys of the scene, and change neither seed nor walk."""
    lived = load(tmp_path, buildings=PLAIN["buildings"] | {"old": {"kind": "B", "seed": 3, "clutter": 2}})
    assert lived.tasks[1].scene == {"building": {"kind": "B", "seed": 3, "floor": 2}, "clutter": 2}
    assert [task.seed for task in lived.tasks] == [task.seed for task in load(tmp_path).tasks]
    radars = [{"name": "robot", "radar": "long-range", "position": [4, 2, 1]}]
    heard = load(tmp_path, buildings=PLAIN["buildings"] | {"old": {"kind": "B", "seed": 3, "interferers": radars}})
    assert heard.tasks[1].scene == {"building": {"kind": "B", "seed": 3, "floor": 2}, "interferers": radars}
    with pytest.raises(InputError, match=r"buildings\.old: clutter is -1"):
        load(tmp_path, buildings={"old": {"kind": "B", "seed": 3, "clutter": -1}, "office": "office"})


def test_seeds_depend_on_nothing_but_seed_and_name(tmp_path):
    seeds = {task.name: task.seed for task in load(tmp_path).tasks}
    turned = load(tmp_path, recordings=PLAIN["recordings"][::-1], radar="two-tx", name="other")
    assert {task.name: task.seed for task in turned.tasks} == seeds
    more = PLAIN["recordings"][0] | {"count": 9}
    assert seeds.items() >= {t.name: t.seed for t in load(tmp_path, recordings=[more]).tasks if t.name in seeds}.items()
    assert not set(seeds.values()) & {task.seed for task in load(tmp_path, seed=2).tasks}


def test_parameters_distinguish_recordings(tmp_path):
    """All parameters that determine the bytes change the identity; moving a file does not."""
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


def test_a_changed_mesh_is_another_recording(tmp_path):
    """A mesh at any level of the scene changes the identity; its folder and other files there do not."""
    mine = "objects: [{name: a, shape: mesh, file: a.ply, material: wood}]\n"
    (tmp_path / "mine.yaml").write_text(
        mine + "levels: [{objects: [{name: b, shape: mesh, file: b.ply, material: wood}]}]"
    )
    seen = []
    for sides in ((3, 4), (5, 4), (5, 6)):
        for name, count in zip("ab", sides, strict=True):
            trimesh.creation.cylinder(1.0, 2.0, sections=count).export(tmp_path / f"{name}.ply")
        seen.append(load(tmp_path, buildings=PLAIN["buildings"] | {"office": "mine.yaml"}).tasks[3].identity)
    assert len(set(seen)) == 3
    (tmp_path / "c.ply").write_text("not named")
    assert load(tmp_path, buildings=PLAIN["buildings"] | {"office": "mine.yaml"}).tasks[3].identity == seen[-1]


def test_variants_change_parts_of_parts(tmp_path):
    """A calibrated board keeps its channels when another field of its leakage changes."""
    channels = tuple(Channel(gain_db=-40.0 - k, phase_deg=10.0 * k) for k in range(12))
    FrontEndConfig.of(CONFIG.board, leakage=Leakage(channels=channels, delay=0.3e-9)).save(tmp_path / "board.yaml")
    variants = {"far": {"frontend": {"leakage": {"delay": 0.9e-9}, "noise_figure_db": {30: 20.0}}}, "none": {}}
    variants["none"]["frontend"] = {"leakage": None}
    far, none = (task.variant.frontend_of(task.frontend, CONFIG.board)
                 for task in load(tmp_path, frontend="board.yaml", variants=variants).tasks[:2])  # fmt: skip
    assert far.leakage == Leakage(channels=channels, delay=0.9e-9) and none.leakage is None
    assert far.noise_figure_db == {30.0: 20.0}  # a table is one value


def test_the_papers_data_set():
    """Counts, platforms and splits of the paper's section 7."""
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


def test_variants_share_seed_and_name(tmp_path):
    variants = {"plain": {}, "coarse": {"radar": {"samples": 48}, "attributes": {"value": 48}}}
    found = load(tmp_path, variants=variants, attributes={"ablation": "samples", "value": 96}).tasks
    plain = load(tmp_path).tasks
    assert [task.name for task in found[:4]] == [
        "old_0_handheld_00_plain", "old_0_handheld_00_coarse", "old_2_handheld_00_plain", "old_2_handheld_00_coarse",
    ]  # fmt: skip
    assert [task.seed for task in found[::2]] == [task.seed for task in found[1::2]] == [task.seed for task in plain]
    assert found[0].attributes == {"ablation": "samples", "value": 96} and found[1].attributes["value"] == 48
    assert found[0].settings == plain[0].settings != found[1].settings
    assert len({task.identity for task in found}) == 14
    assert found[1].variant.radar_of("radarize").samples == 48 and found[0].variant.radar_of("radarize") == "radarize"


def test_recordings_may_name_their_variants_and_have_people(tmp_path):
    groups = [GROUP | {"variants": ["coarse"], "people": 3}, GROUP]
    variants = {"plain": {}, "coarse": {"radar": {"samples": 48}}}
    found, alone = (load(tmp_path, recordings=each, variants=variants).tasks for each in (groups, groups[:1]))
    ends = [task.name.rpartition("_")[2] for task in found]
    first = len(alone)
    assert set(ends[:first]) == {"coarse"} and ends[first : first + 2] == ["plain", "coarse"]
    assert [task.people for task in found[: first + 1]] == [3] * first + [0]
    assert found[:first] == alone and found[0].parameters["people"] == 3 and found[first].parameters["people"] is None


def test_a_plain_recording_is_the_one_it_always_was(tmp_path):
    """Fields that older data sets did not have count as absent, so that finished recordings stay valid."""
    parameters = load(tmp_path).tasks[0].parameters
    assert all(parameters[name] is None for name in ("waypoints", "variant", "attributes"))


def test_files_of_scenes_are_read_once(tmp_path, monkeypatch):
    """Files are read once, not for each of up to 20,000 recordings."""
    asked = []
    for module in (specification, description):
        monkeypatch.setattr(module, "read_yaml", lambda path: asked.append(path.name) or read_yaml(path))
    fields = {"building": "o", "platform": ["cart", "robot"], "count": 500, "duration": 1}
    found = load(tmp_path, buildings={"o": "office"}, recordings=[fields])
    assert len(found.as_data()["recordings"]) == 1000
    assert asked.count("office.yaml") == 2  # what it describes, and which meshes it names


def test_levels_are_scenes_of_their_own(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "objects: [{name: a, shape: sphere, radius: 1, material: wood}]\nlevels: [{objects: [{name: a, radius: 2}]}]"
    )
    fields = {"platform": "cart", "count": 1, "duration": 1, "waypoints": [[0, 1], [2, 3]]}
    groups = [fields | {"building": name} for name in ("mine", "severe")]
    buildings = {"mine": "mine.yaml", "severe": str(tmp_path / "mine.yaml@1")}
    tasks = load(tmp_path, buildings=buildings, recordings=groups, variants={"x": {}, "y": {"level": 1}}).tasks
    assert [Path(task.scene).name for task in tasks] == ["mine.yaml", "mine.yaml@1", "mine.yaml@1", "mine.yaml@1"]
    assert tasks[0].waypoints == ((0, 1), (2, 3))
    assert tasks[0].parameters["scene"]["sha256"] == tasks[1].parameters["scene"]["sha256"]


def test_the_stress_test():
    """Seven places at four levels; the recordings of a place differ only in the level."""
    tasks = Specification.load("stress").tasks
    assert Counter(task.attributes["severity"] for task in tasks) == dict.fromkeys(range(4), 7)
    assert len({task.attributes["stress"] for task in tasks}) == 7
    for task in tasks:
        assert task.variant.model_dump(exclude_defaults=True).keys() <= {"level", "attributes"}
    assert len({(task.building, task.seed, task.waypoints, task.settings) for task in tasks}) == 7


def test_ablations_change_what_they_are_called_after():
    """The values have the expected effect, by closed forms of the radar."""
    found: dict[str, list] = {}
    for file in (shipped() / "datasets" / "ablation").glob("*.yaml"):
        tasks = Specification.load(f"ablation/{file.stem}").tasks
        radars = [load_config(task.variant.radar_of(task.radar))[0] for task in tasks]
        values = [task.attributes["value"] for task in tasks]
        found[file.stem] = list(zip(tasks, radars, values, strict=True))
        walks = Counter((task.building, task.seed) for task in tasks)
        assert len(walks) == 10 and {*walks.values()} == {len({*values})}  # ten walks, each at every value
        assert len({task.attributes["ablation"] for task in tasks}) == 1
        for task in tasks:
            assert set(task.variant.model_dump(exclude_defaults=True)) <= {
                "radar",
                "frontend",
                "mounting",
                "attributes",
            }
    assert sorted(found) == [
        "antennas", "bandwidth", "device", "frame_rate", "height", "loops", "noise_figure", "tilt", "tx_order",
    ]  # fmt: skip

    def check(name, measure, law):
        for task, radar, value in found[name]:
            assert measure(task, radar) == pytest.approx(law(value), rel=0.01), (name, value)

    check("bandwidth", lambda _, radar: radar.range_resolution, lambda value: SPEED_OF_LIGHT / 2 / value)
    check("bandwidth", lambda _, radar: radar.max_range, lambda value: 4.28)
    check("antennas", lambda _, radar: virtual_positions(radar).reshape(-1, 3).shape[0], lambda value: value)
    check("antennas", lambda _, radar: radar.loop_time, lambda value: 516e-6)
    check("loops", lambda _, radar: radar.velocity_resolution, lambda value: CONFIG.wavelength / 2 / (value * 516e-6))
    check("frame_rate", lambda _, radar: radar.frame_rate, lambda value: value)
    check(
        "noise_figure",
        lambda task, radar: 10 * np.log10(task.variant.frontend_of(None, radar.board).noise_factor(30)),
        lambda v: v,
    )
    check("height", lambda task, _: 1.2 + task.variant.mounted.lever_arm[2], lambda value: value)
    check(
        "tilt", lambda task, _: -np.rad2deg(np.arcsin(task.variant.mounted.rotation.apply([1, 0, 0])[2])), lambda v: v
    )
    check("device", lambda _, radar: radar.center_frequency, {"IWR1843BOOST": 78.9e9, "IWR6843ISK": 61.9e9}.get)
    apart = {"TX1 TX3 TX2": 1, "TX1 TX2 TX3": 2, "TX2 TX1 TX3": 1}
    check("tx_order", lambda _, radar: radar.slot[2] - radar.slot[0], apart.get)
    assert [len(azimuth_row(radar)) for _, radar, _ in found["antennas"]] == 10 * [2, 4, 8, 8]


GROUP = PLAIN["recordings"][0]


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"seed": -1}, "seed is -1"),
        ({"bogus": 1}, "bogus: unknown key"),
        ({"name": "a b"}, "name is 'a b'"),
        ({"sensors": ["deph"]}, "sensors: 'deph' is unknown, expected all or some of depth"),
        ({"storage": "both"}, "storage is 'both': input should be 'raw' or 'heatmaps'"),
        ({"radar": "x.cfg"}, "x.cfg: no such radar configuration"),
        ({"frontend": "x.yaml"}, "x.yaml: no such file"),
        ({"buildings": {"old": {"kind": "Z"}}}, "buildings.old: "),
        ({"buildings": {"old": {"kind": "B", "seed": -4}}}, "buildings.old: seed is -4"),
        ({"buildings": {"office": "nowhere.yaml"}}, "buildings.office: scene file nowhere.yaml does not exist"),
        ({"recordings": []}, "recordings is []"),
        ({"recordings": [{"building": "old"}]}, "has no recordings[0].platform"),
        ({"recordings": [GROUP | {"platform": "drone"}]}, "recordings[0].platform is 'drone'"),
        ({"recordings": [GROUP | {"count": 0}]}, "recordings[0].count is 0"),
        ({"recordings": [GROUP | {"count": 4294967296}]}, "recordings, expected at most 20000"),
        ({"recordings": [GROUP | {"duration": 0.001}]}, "recordings[0].duration is 0.001 s, expected at least one"),
        ({"recordings": [GROUP | {"building": "x"}]}, "recordings[0].building is 'x', expected one of buildings: old"),
        ({"recordings": [GROUP | {"building": "office"}]}, "recordings[0].floors is [0, 2], but building office is a"),
        ({"recordings": [GROUP | {"waypoints": [[1, 2]]}]}, "recordings[0].waypoints is [[1, 2]]"),
        ({"variants": {"a": {"level": 1}}}, "buildings.old: is generated and has no levels"),
        ({"variants": {"a": {"radar": {"slop": 1}}}}, "variants.a.radar: slop: unknown key, expected some of board"),
        (
            {"variants": {"a": {"radar": "short-range"}}},
            "variants.a.radar is 'short-range': no such preset, expected one of radarize, long-range",
        ),
        ({"variants": {"a": {"radar": {"slope": "steep"}}}}, "variants.a: radar: slope is 'steep'"),
        ({"variants": {"a": {"radar": {"slope": 90e12}}}}, "variants.a: radar configuration: start_frequency, slope"),
        ({"variants": {"a": {"frontend": {"noize": 1}}}}, "variants.a: frontend: noize: unknown key"),
        ({"variants": {"a": {"mounting": [1, 2]}}}, "variants.a.mounting"),
        ({"splits": {"a": {"kind": "random", "train": 0.5}}}, "splits.a: train + validation + test is 0.8, expected 1"),
        (
            {"recordings": [GROUP | {"variants": ["a"]}]},
            "recordings[0].variants names 'a', expected some of variants: there are none",
        ),
        ({"recordings": [GROUP | {"people": -1}]}, "recordings[0].people is -1"),
        ({"splits": {"a": {"kind": "x"}}}, "splits.a.kind is 'x', expected one of: random"),
        ({"splits": {"a": {"kind": "random", "folds": 0}}}, "splits.a.folds is 0"),
        ({"splits": {"a": {"kind": "random", "folds": 65536}}}, "splits.a.folds is 65536"),
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
        InputError,
        match="no specification 'huge', expected .* one of: ablation/.*, evaluation, .*radarize146, radars, small, str",
    ):
        Specification.load("huge")
    path = tmp_path / "x.yaml"
    for text, expected in (("a: [", "malformed YAML"), ("7", "holds int, expected keys")):
        path.write_text(text)
        with pytest.raises(InputError, match=expected):
            Specification.load(path)
