"""Domain randomisation of recordings: distributions, dependences, and refusals."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import kstest, lognorm, norm, truncnorm, uniform

from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarsim.cli import app
from radarsim.dataset.randomise import LIMITS, Distribution, Randomise, mounting
from radarsim.dataset.run import INDEX, make
from radarsim.dataset.specification import Specification
from radarsim.motion.platforms import PLATFORMS
from radarsim.world.description import shipped
from radarsim.world.surface_settings import SurfaceSettings
from tests.dataset import hall
from tests.dataset.test_specification import PLAIN, load

USUAL = Randomise.usual()
#: Of the sensor, of the surfaces, and of what they are made of.
SOME = {"clutter": {"uniform": [0.8, 1.2]}, "height": {"uniform": [0.7, 1.1]}, "pitch": {"normal": [4, 1]}, "roll": -2,
        "permittivity": {"choice": [0.9, 1.1]}}  # fmt: skip


@pytest.mark.parametrize(
    ("given", "law", "low", "high"),
    [
        ({"uniform": [0.7, 1.4]}, uniform(0.7, 0.7), 0.7, 1.4),
        ({"normal": [5, 2]}, truncnorm(-3, 3, 5, 2), -1, 11),
        ({"lognormal": [0.8, 0.4]}, lognorm(0.4, scale=0.8), 0.8 * np.exp(-1.2), 0.8 * np.exp(1.2)),
    ],
)
def test_draws_follow_their_distribution(given, law, low, high):
    field = "pitch" if "normal" in given else "clutter"
    about = Randomise.model_validate({field: given})
    drawn = np.array([about.draw(seed, "cart")[field] for seed in range(4000)])
    assert low <= drawn.min() and drawn.max() <= high
    assert kstest(drawn, law.cdf).pvalue > 0.01
    inside = law.expect(lb=low, ub=high, conditional=True)
    assert drawn.mean() == pytest.approx(inside, abs=4 * drawn.std() / np.sqrt(len(drawn)))


def test_choices_are_equally_likely_and_constants_are_constant():
    about = Randomise(furniture={"choice": [0.5, 1, 1.5]}, unevenness=0.7)
    drawn = [about.draw(seed, "cart") for seed in range(3000)]
    values, counts = np.unique([each["furniture"] for each in drawn], return_counts=True)
    np.testing.assert_array_equal(values, [0.5, 1, 1.5])
    np.testing.assert_allclose(counts, 1000, atol=4 * np.sqrt(1000 * 2 / 3))
    assert {each["unevenness"] for each in drawn} == {0.7}


@pytest.mark.parametrize("kind", ["normal", "lognormal"])
def test_the_normal_distribution_ends_at_three_deviations(kind):
    about = Distribution.of({kind: [2, 0.5]})
    ends = np.array([about.quantile(share) for share in (0.0, 0.5, 1.0)])
    np.testing.assert_allclose(ends if kind == "normal" else 2 + np.log(ends / 2), [0.5, 2, 3.5], rtol=1e-9)
    tail = norm.cdf(-3) + (1 - 2 * norm.cdf(-3)) * 0.2
    assert about.quantile(0.2) == pytest.approx(
        {"normal": norm(2, 0.5), "lognormal": lognorm(0.5, 0, 2)}[kind].ppf(tail)
    )


def test_draws_hang_on_seed_and_field_alone():
    whole = USUAL.draw(7, "cart")
    assert whole == USUAL.draw(7, "cart") != USUAL.draw(8, "cart")
    assert Randomise(clutter={"uniform": [0.7, 1.4]}).draw(7, "robot") == {"clutter": whole["clutter"]}
    assert USUAL.draw(7, "cart", {"clutter", "materials"}).items() <= whole.items()
    shares = np.array([[USUAL.draw(seed, "cart")[f] for f in ("clutter", "unevenness", "furniture", "height", "pitch")]
                       for seed in range(1500)])  # fmt: skip
    assert np.abs(np.corrcoef(shares.T) - np.eye(5)).max() < 0.1
    factors = [[by["permittivity"] for by in USUAL.draw(seed, "cart")["materials"].values()] for seed in range(1500)]
    assert np.abs(np.corrcoef(np.transpose(factors)) - np.eye(len(factors[0]))).max() < 0.15


def test_a_sensor_is_placed_as_drawn_or_as_its_platform_has_it():
    for platform, carrier in PLATFORMS.items():
        held = [Randomise(height=0.5).draw(seed, platform) for seed in range(1000)]
        tilt = np.array([[each["pitch"], each["roll"]] for each in held])
        np.testing.assert_allclose(tilt.std(axis=0), np.rad2deg(carrier.tilt), rtol=0.1)
        mount = mounting(held[0], platform)
        np.testing.assert_allclose(mount.lever_arm, [carrier.lever_arm, 0, 0.5 - carrier.height])
        yaw, pitch, roll = mount.rotation.as_euler("ZYX", degrees=True)
        np.testing.assert_allclose([yaw, pitch, roll], [0, *tilt[0]], atol=1e-9)
    own = Randomise(pitch={"cart": {"uniform": [0, 1]}})
    assert own.draw(1, "cart")["height"] == PLATFORMS["cart"].height and own.draw(1, "robot") == {}
    assert mounting({}, "cart") is None


def test_the_default_is_within_what_platforms_and_rooms_have():
    for field, platform, _ in USUAL.rows():
        for name, carrier in PLATFORMS.items() if platform == "all" else [(platform, PLATFORMS[platform])]:
            low, high = (USUAL.of(field, name).quantile(share) for share in (0.0, 1.0))
            middle = {"height": carrier.height, "pitch": 0, "roll": 0}.get(field, 1)
            assert low < middle < high
    assert {field for field, *_ in USUAL.rows()} == {*LIMITS}


def test_data_sets_draw_by_default(tmp_path):
    """All fields that are not given are drawn; a recording's draws do not depend on other recordings."""
    tasks = {task.name: task for task in load(tmp_path).tasks}
    scene = {"clutter", "unevenness", "furniture", "materials"}
    assert all(task.randomised.keys() == scene | {"height", "pitch", "roll"} for task in tasks.values())
    turned = load(tmp_path, recordings=PLAIN["recordings"][::-1], variants={"a": {}, "b": {"radar": {"samples": 48}}})
    assert all(tasks[task.name[:-2]].randomised == task.randomised for task in turned.tasks)
    old = {"kind": "B", "seed": 3, "clutter": 0, "materials": {"brick": {"permittivity": 2}}, "furniture": 0.1}
    given, *_, other = load(tmp_path, buildings=PLAIN["buildings"] | {"old": old}).tasks
    assert given.randomised.keys() == {"unevenness", "height", "pitch", "roll"} and other.randomised.keys() > scene
    assert given.scene["clutter"] == 0 and given.scene["furniture"] == 0.1
    arm, *_ = load(tmp_path, variants={"arm": {"mounting": [0.1, 0, 0, 0, 0, 0]}}).tasks
    assert arm.randomised.keys() == scene
    (hall_,) = hall.specification(tmp_path, randomise={"furniture": 0.5, "clutter": 1}).tasks
    assert hall_.randomised == {"clutter": 1}  # it has no building that could be furnished


def test_nothing_is_drawn_on_request(tmp_path):
    plain, *_ = load(tmp_path, randomise={}).tasks
    assert plain.randomised == {} and plain.parameters["randomised"] is None
    other, *_ = load(tmp_path, randomise={"clutter": 0.5}).tasks
    assert other.randomised == {"clutter": 0.5} and other.identity != plain.identity and other.seed == plain.seed


def test_data_sets_of_the_project():
    """Training and evaluation data sets are randomised; the stress test, in which only levels differ, is not."""
    for file in (shipped() / "datasets").glob("*.yaml"):
        tasks = Specification.load(file.stem).tasks
        assert any(task.randomised for task in tasks) == (file.stem != "stress")
        for task in tasks:
            bounds = {name: [USUAL.of(name, task.platform).quantile(share) for share in (0.0, 1.0)]
                      for name in task.randomised.keys() - {"materials"}}  # fmt: skip
            assert all(low <= round(task.randomised[name], 6) <= high for name, (low, high) in bounds.items())
    for name in ("training", "evaluation", "radarize146", "small"):
        assert all(
            task.randomised.keys() >= {"clutter", "height", "materials"} for task in Specification.load(name).tasks
        )


def test_what_was_drawn_arrives(tmp_path):
    """Drawn values are in the scene, in the sensor's true poses, in the recording and in the index."""
    wanted = hall.specification(tmp_path, randomise=SOME, recordings=hall.recordings(["cart", "robot"], duration=1.5))
    make(wanted, tmp_path / "out", workers=2, log=lambda _: None)
    index = json.loads((tmp_path / "out" / INDEX).read_text())
    assert index["specification"]["randomise"]["clutter"] == SOME["clutter"]
    for task in wanted.tasks:
        drawn = task.randomised
        assert 0.8 <= drawn["clutter"] <= 1.2 and 0.7 <= drawn["height"] <= 1.1 and drawn["roll"] == -2
        with Recording(task.path(tmp_path / "out")) as recording:
            assert json.loads(str(recording.attributes["task"]))["randomised"] == drawn
            poses = recording.read("truth/pose")
        assert index["recordings"][task.name]["randomised"] == drawn
        axes = Rotation.from_quat(poses[:, 3:]).as_matrix()  # (frame, 3, 3), columns are the sensor's axes in the world
        np.testing.assert_allclose(poses[:, 2], drawn["height"], atol=0.005)
        np.testing.assert_allclose(np.rad2deg(-np.arcsin(axes[:, 2, 0])), drawn["pitch"], atol=0.6)  # it trembles
        np.testing.assert_allclose(np.rad2deg(np.arcsin(axes[:, 2, 1])), drawn["roll"], atol=0.6)
        scene = task._scenario()[0].scene
        assert scene.surface_settings == SurfaceSettings(drawn["clutter"], 0.0)
        wood, vinyl = (next(o.material for o in scene.objects if o.name == name) for name in ("wall", "floor"))
        assert wood.permittivity_at(77e9).real == pytest.approx(1.99 * drawn["materials"]["wood"]["permittivity"])
        assert vinyl.name == "vinyl" and not {"visitor"} & {o.name for o in scene.objects}
    first, second = wanted.tasks
    assert first.randomised["height"] != second.randomised["height"]


def test_same_bytes_whoever_makes_it(tmp_path):
    """Same bytes for any number of processes, any order, and with or without other recordings."""
    both = hall.recordings(["cart", "robot"], duration=1)
    for folder, groups, workers in (("a", both, 2), ("b", [both[0] | {"platform": ["robot"]}], 1)):
        make(hall.specification(tmp_path, randomise=SOME, recordings=groups), tmp_path / folder, workers=workers,
             log=lambda _: None)  # fmt: skip
    name = "hall_robot_00.h5"
    assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_plan_is_printed(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    path = hall.write(tmp_path, randomise=SOME, recordings=hall.recordings(["cart", "robot"]))
    with pytest.raises(SystemExit) as ended:
        run(app, "radarsim", ["dataset", str(path), "--plan"])
    printed = capsys.readouterr().out
    assert ended.value.code == 0 and sorted(p.name for p in tmp_path.iterdir()) == [
        "hall.yaml",
        "small.cfg",
        "tiny.yaml",
    ]
    lines = [" ".join(line.split()) for line in printed.splitlines()]
    for line in (
        "clutter all uniform 0.8, 1.2",
        "pitch all normal 4, 1",
        "roll all -2",
        "permittivity all choice 0.9, 1.1",
    ):
        assert line in lines
    for task in Specification.load(path).tasks:
        clutter, height, pitch, roll = (f"{task.randomised[key]:.2f}" for key in ("clutter", "height", "pitch", "roll"))
        assert f"{task.name} 3 {clutter} - - {height} {pitch} {roll}" in lines
    assert "2 recordings, 0.1 min in all" in lines


def test_without_a_plan_a_folder_is_needed(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        run(app, "radarsim", ["dataset", str(hall.write(tmp_path))])
    assert ended.value.code == 2 and "--output is missing, expected a folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (7, "randomise is 7: input should be a valid dictionary"),
        ({"mess": 1}, "randomise.mess: unknown key"),
        ({"clutter": "much"}, "randomise.clutter is 'much': expected a number or one of: uniform: [low, high]; "),
        ({"clutter": True}, "randomise.clutter is True: expected a number"),
        ({"clutter": {}}, "randomise.clutter: has nothing, expected a number"),
        ({"clutter": {"unifrom": [1, 2]}}, "randomise.clutter: has unifrom, expected a number or one of: uniform"),
        ({"clutter": {"uniform": [1, 2], "choice": [1]}}, "randomise.clutter: has uniform, choice, expected a number"),
        ({"clutter": {"uniform": [1, 2, 3]}}, "randomise.clutter: uniform is [1, 2, 3], expected [low, high]"),
        ({"clutter": {"uniform": [2, 1]}}, "randomise.clutter: uniform is [2, 1], expected the lower number first"),
        ({"clutter": {"uniform": [0, "x"]}}, "randomise.clutter: uniform is [0, 'x'], expected [low, high]"),
        ({"clutter": {"uniform": [0, float("nan")]}}, "randomise.clutter: uniform is [0, nan], expected [low, high]"),
        ({"clutter": {"uniform": [0, 10**30]}}, "randomise.clutter: uniform is [0, 1000"),
        ({"clutter": {"choice": []}}, "randomise.clutter: choice is [], expected [value, ...]"),
        ({"clutter": {"normal": 1}}, "randomise.clutter: normal is 1, expected [mean, standard deviation]"),
        ({"pitch": {"normal": [0, -1]}}, "pitch: normal is [0, -1], expected a standard deviation of 0 to 100"),
        ({"clutter": {"lognormal": [0, 1]}}, "randomise.clutter: lognormal is [0, 1], expected a median above 0"),
        ({"clutter": {"lognormal": [1, 9]}}, "lognormal is [1, 9], expected a standard deviation of 0 to 3"),
        ({"clutter": {"normal": [1, 0.5]}}, "randomise.clutter: normal 1, 0.5 reaches -0.5, expected 0 to 10"),
        ({"furniture": {"choice": [1, 3]}}, "randomise.furniture: choice 1, 3 reaches 3, expected 0 to 2"),
        ({"permittivity": 0.1}, "randomise.permittivity is 0.1: expected 0.5 to 2"),
        ({"height": {"cart": 1, "drone": 2}}, "randomise.height: has cart, drone, expected a number"),
        ({"height": {"cart": {"uniform": [1, 9]}}}, "of cart is {'uniform': [1, 9]}: uniform 1, 9 reaches 9, expected"),
    ],
)  # fmt: skip
def test_mistakes_are_one_sentence(tmp_path: Path, given, expected):
    with pytest.raises(InputError) as error:
        load(tmp_path, randomise=given)
    assert str(error.value).startswith(f"{tmp_path / 'spec.yaml'}: ") and expected in str(error.value)
    assert "\n" not in str(error.value)


def test_mistakes_in_what_a_building_gives(tmp_path):
    for given, expected in (
        ({"furniture": 3}, "buildings.old: furniture is 3"),
        ({"materials": {"metal": {}}}, "buildings.old: materials: names 'metal', expected some of: concrete, "),
        ({"materials": {"brick": {"permittivity": 0}}}, "buildings.old: materials.brick.permittivity is 0"),
    ):
        with pytest.raises(InputError) as error:
            load(tmp_path, buildings=PLAIN["buildings"] | {"old": {"kind": "B", "seed": 3} | given})
        assert expected in str(error.value)
