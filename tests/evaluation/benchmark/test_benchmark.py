"""Comparisons end to end, on recordings that take no simulator."""

import json
import re
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from radarize import cli
from radarize.evaluation.benchmark import identity, networks
from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.odometry import SEEN
from radarize.evaluation.benchmark.protocol import PROTOCOLS
from radarize.evaluation.benchmark.run import benchmark
from radarize.evaluation.benchmark.steps import kept, perform
from radarize.evaluation.benchmark.study import BENCHMARKS, Chosen, Options, Study
from radarize.io.console import run as command_line
from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.pipeline.methods import ODOMETRY, SCANS
from radarize.pipeline.run import Run
from tests.evaluation.benchmark import toys as toy_file
from tests.evaluation.benchmark.rooms import ROOMS, write_room, write_rooms
from tests.evaluation.benchmark.toys import add
from tests.evaluation.fake_run import walk


@pytest.fixture
def toys(monkeypatch) -> list[str]:
    return add(monkeypatch)


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> Path:
    return write_rooms(tmp_path_factory.mktemp("rooms"))


def test_a_method_of_ones_own_is_in_every_table(rooms, toys, tmp_path):
    assert len(Path(toy_file.__file__).read_text().splitlines()) < 60  # two methods, and imports
    moved = []
    found = benchmark("all", rooms, tmp_path, Options(toys), progress=lambda done, total: moved.append((done, total)))
    assert set(found) == set(BENCHMARKS) - {"real"}
    for name, results in found.items():
        text = (tmp_path / f"{name}.md").read_text()
        assert results.tables and all(table.rows for table in results.tables), name
        for table in results.tables:
            words = {word for row in table.rows for value in row.values() for word in str(value).split("+")}
            assert {"scaled", "metre"} & words, (name, table.title)
        assert json.loads((tmp_path / f"{name}.json").read_text())["machine"]["commit"] in text
        assert (tmp_path / f"{name}.html").is_file()
        assert f'href="{name}.html"' in (tmp_path / "index.html").read_text()
    assert moved == sorted(moved) and moved[-1][0] == moved[-1][1]  # one bar over everything

    row = found["odometry"].tables[0].rows[0]
    assert row["recordings"] == 2 and 0.02 < row["ATE m"] < 0.1 and row["ATE rad"] < 1e-3
    mapping = {row["on"]: row for row in found["mapping"].tables[0].rows}
    assert mapping["all"]["returned %"] == pytest.approx(100) and mapping["all"]["within 10 cm %"] < 50


def ate(run: Path) -> float:
    return json.loads((run / "metrics.json").read_text())["odometry"]["ate"]["position"]["mean"]


def test_means_are_over_trajectories_then_splits_or_each_once(rooms, toys, tmp_path):
    found = benchmark("odometry", rooms, tmp_path, Options(toys))["odometry"]
    one, other = (ate(tmp_path / "runs" / name / "scaled+metre") for name in ("A_handheld", "A_cart"))
    assert abs(one - other) > 1e-4
    paper, corrected = (table.rows[0]["ATE m"] for table in found.tables[:2])
    assert corrected == pytest.approx((one + other) / 2)
    assert paper == pytest.approx(((one + other) / 2 + one) / 2, rel=1e-3)  # the first tests in both splits
    steps = {row["on"]: row for row in found.tables[2].rows}
    assert steps["handheld"]["ATE m"] == pytest.approx(one) and steps["cart"]["ATE m"] == pytest.approx(other)
    # A tenth too fast, but for the first frame, of which nothing is known.
    speeds = [np.linalg.norm(Recording(rooms / f"{name}.h5").read("truth/velocity"), axis=1) for name in ROOMS][:2]
    expected = np.mean([[-speed[0], *(0.1 * speed[1:])] for speed in speeds])
    assert steps["all"]["bias"] == pytest.approx(expected, rel=0.05)
    only = benchmark("odometry", rooms, tmp_path, Options(toys, protocol="corrected"))["odometry"]
    assert [table.title for table in only.tables] == ["Odometry, corrected protocol", found.tables[2].title]


def test_platforms_that_shipped_networks_have_seen_are_not_called_unseen(rooms, toys, tmp_path):
    """Beside the paper's figures, whose networks had seen the handheld platform alone."""
    compared = BENCHMARKS["odometry-platforms"]
    assert SEEN in benchmark("odometry-platforms", rooms, tmp_path, Options(toys))["odometry-platforms"].tables[0].notes
    study = Study.plan(compared, DataSet.load(rooms), tmp_path, Options(toys))
    study.results = {run: kept(run, tmp_path) for _, run in study.runs}
    for own in (Options(toys, trained=True), Options(toys, weights=tmp_path)):
        assert SEEN not in compared.tables(replace(study, options=own))[0].notes


def test_what_cannot_run_is_a_dash_with_a_reason(rooms, toys, tmp_path):
    found = benchmark("odometry", rooms, tmp_path, Options([*toys, "learned"]))["odometry"]
    rows = {row["odometry"]: row for row in found.tables[0].rows}
    assert np.isnan(rows["learned"]["ATE m"]) and rows["learned"]["recordings"] == 0
    assert "| learned | 0 | - | - |" in (tmp_path / "odometry.md").read_text()
    note = next(note for note in found.notes if note.startswith("learned+metre: failed on 2 of 2 recordings"))
    assert "translation.safetensors: does not fit this radar" in note and str(tmp_path) not in note


def test_runs_are_done_once(rooms, toys, tmp_path, monkeypatch):
    benchmark("odometry", rooms, tmp_path, Options(toys))
    monkeypatch.setattr("radarize.evaluation.benchmark.runs.run_recording", None)  # would break whatever runs now
    benchmark("odometry", rooms, tmp_path, Options(toys))
    found = benchmark("buildings", rooms, tmp_path, Options(toys))["buildings"]  # B_robot is new
    assert any("scaled+metre: failed on 1 of 3 recordings" in note for note in found.notes)
    benchmark("mapping", rooms, tmp_path, Options(toys))


def test_a_changed_method_is_run_again(tmp_path, monkeypatch):
    """Whatever file a method comes from; a run whose sources are the same is kept."""
    monkeypatch.syspath_prepend(tmp_path)
    own = tmp_path / "own_method.py"
    own.write_text("def make(inputs):\n    return 1\n")
    from own_method import make

    code = identity.of_code
    before = code(make, partial(make, None))
    assert before != code(ODOMETRY["doppler"].make)  # of the package
    code.cache_clear()
    assert before == code(make, partial(make, None))
    own.write_text("def make(inputs):\n    return 2\n")
    code.cache_clear()
    assert before != code(make, partial(make, None))


def test_a_remade_recording_is_run_again(toys, tmp_path):
    """Of the same name and size: what is in it differs."""
    path = write_room(tmp_path / "data" / "A_cart.h5", 60, 0, scene="A_0", platform="cart")
    benchmark("odometry", tmp_path / "data", tmp_path, Options(toys))
    study = Study.plan(BENCHMARKS["odometry"], DataSet.load(path.parent), tmp_path, Options(toys))
    ((_, run),) = study.runs
    assert kept(run, tmp_path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert not kept(run, tmp_path)


def test_networks_are_trained_on_each_split(rooms, toys, monkeypatch, tmp_path):
    asked = []

    def train(kind, data, output, settings, options, *, log):
        asked.append((kind, options.split, settings.epochs, options.resume))
        if kind == "rotation":
            raise InputError(f"{data}: holds too little")
        output.write_text(options.split)
        log("epoch 1: loss 1")

    monkeypatch.setattr(networks, "train", train)
    choices = {"methods": [*toys, "learned"], "trained": True, "epochs": 2}
    monkeypatch.setattr("radarize.evaluation.benchmark.study.BEST", {"odometry": "scaled", "scans": "metre"})
    for _ in range(2):
        found = benchmark("buildings", rooms, tmp_path, Options(**choices))["buildings"]
    kinds = [(kind, split) for split in ("building-A", "building-B") for kind in ("translation", "rotation")]
    # What could not be done is tried again, what could is not.
    assert [(kind, split) for kind, split, *_ in asked] == [*kinds, *(pair for pair in kinds if pair[0] == "rotation")]
    assert all(rest == [2, True] for _, _, *rest in asked)
    assert (tmp_path / "weights" / "building-A" / "translation.safetensors").read_text() == "building-A"
    assert any(note.startswith("building-A: rotation could not be trained") for note in found.notes)
    assert any("learned+metre: failed on 3 of 3" in note for note in found.notes)
    # What needs no network is run once, whatever the split.
    assert sorted(path.name for path in (tmp_path / "runs").glob("*/*")) == ["scaled+metre"] * 3


@pytest.fixture
def training(rooms, tmp_path, monkeypatch):
    """Networks of a split, trained by something that leaves a checkpoint; whether each was begun anew."""
    data = tmp_path / "data"
    shutil.copytree(rooms, data)
    begun = []

    def train(kind, data, output, *choices, **reports):
        begun.append(not output.with_suffix(".checkpoint").exists())
        output.with_suffix(".checkpoint").touch()
        output.touch()

    def go(**changed) -> int:
        step = networks.Training("building-A", "translation", data, **changed)
        count = len(begun)
        perform([step], tmp_path, 1, lambda *where: None)
        return len(begun) - count

    monkeypatch.setattr(networks, "train", train)
    return data, begun, go


def test_a_training_is_done_again_when_anything_has_changed(training, monkeypatch):
    data, begun, go = training
    assert [go(), go()] == [1, 0]
    with h5py.File(data / "B_robot.h5", "r+") as file:  # trains
        file["radar/adc"][0] += 1
    assert [go(), go()] == [1, 0]
    with h5py.File(data / "A_cart.h5", "r+") as file:  # tests
        file["radar/adc"][0] += 1
    assert go() == 0
    assert [go(epochs=3), go(epochs=3), go(epochs=3, seed=1)] == [1, 0, 1]
    monkeypatch.setattr(networks, "of_code", lambda: "other sources")
    assert [go(), go()] == [1, 0]
    settings = networks.find_task("translation").defaults
    monkeypatch.setattr(networks, "find_task", lambda kind: SimpleNamespace(defaults=replace(settings, rate=0.5)))
    assert [go(), go()] == [1, 0]
    assert all(begun)  # no training goes on from the checkpoint of another


def test_an_interrupted_training_goes_on(training, monkeypatch):
    _, begun, go = training
    train = networks.train

    def stopped(*arguments, **choices):
        train(*arguments, **choices)
        raise KeyboardInterrupt

    monkeypatch.setattr(networks, "train", stopped)
    with pytest.raises(KeyboardInterrupt):
        go()
    monkeypatch.setattr(networks, "train", train)
    go()
    assert begun == [True, False]


def test_a_protocol_means_the_same_in_every_table(rooms, toys, tmp_path, monkeypatch):
    """In the paper's, loops are closed for its own method and no other, whatever else is compared."""
    monkeypatch.setitem(ODOMETRY, "learned", ODOMETRY["scaled"])
    pairs = {"scaled": [3, 2], "learned": [2, 2]}  # open and closed, in the order of `PROTOCOLS`
    for name in ("slam", "buildings"):
        study = Study.plan(BENCHMARKS[name], DataSet.load(rooms), tmp_path, Options([*toys, "learned"]))
        for _, run in study.runs:
            means = {"odometry": 1, "slam": 2, "open": 3}
            errors = {which: {"ate": {"position": {"mean": k}}} for which, k in means.items()}
            study.results[run] = {**errors, "nearest": errors}
        for odometry, expected in pairs.items():
            tables = [table.frame[table.frame["odometry"] == odometry] for table in BENCHMARKS[name].tables(study)]
            assert [set(table["ATE m"]) for table in tables] == [{value} for value in expected], (name, odometry)
        for table, protocol in zip(BENCHMARKS[name].tables(study), PROTOCOLS.values(), strict=True):
            assert protocol.loops in table.notes
    assert "Loop closure for fused, learned, published only" in PROTOCOLS["paper"].loops


@pytest.mark.parametrize(
    ("name", "choices", "expected"),
    [
        ("odometri", {}, "benchmark is 'odometri', expected one of: ablation, buildings, mapping"),
        ("odometry", {"methods": ["dopler"]}, "methods names 'dopler', expected some of: doppler, doppler-ransac"),
        ("odometry", {"protocol": "mine"}, "protocol is 'mine', expected one of: paper, corrected"),
        ("odometry", {"weights": Path("none")}, "weights is none, expected a folder"),
        ("odometry", {"weights": Path(), "trained": True}, "weights . are given with --train, expected one"),
    ],
)
def test_bad_input_is_one_sentence(rooms, tmp_path, name, choices, expected):
    with pytest.raises(InputError, match=expected.replace(".", r"\.")):
        benchmark(name, rooms, tmp_path / "out", Options(**choices))


def test_table_by_radar(toys, tmp_path, monkeypatch):
    """Two walks of one radar, one of another. If all displacements are 10 % too long, the position error of a pose is
    10 % of its distance from the mean position."""
    folder, off = tmp_path / "radars", []
    folder.mkdir()
    for seed, chirps in enumerate(("far", "far", "near")):
        write_room(folder / f"A_cart_{seed}.h5", 60, seed, scene="A_0", platform="cart", chirps=chirps)
        path = walk()[1][40 * seed :][:60]
        off.append(0.1 * np.linalg.norm(path - path.mean(axis=0), axis=1).mean())
    chosen = {"odometry": "scaled", "scans": "threshold"}
    monkeypatch.setattr("radarize.evaluation.benchmark.radars.CLASSICAL", {"odometry": "scaled", "scans": "metre"})
    monkeypatch.setattr("radarize.evaluation.benchmark.radars.BEST", chosen)
    monkeypatch.setattr("radarize.evaluation.benchmark.radars.best_methods", lambda config: (chosen, ""))
    (table,) = benchmark("radars", folder, tmp_path / "out")["radars"].tables
    assert [(row["radar"], row["scans"], row["chosen"], row["walks"]) for row in table.rows] == [
        ("far", "metre", "", 2), ("far", "threshold", "yes", 2),
        ("near", "metre", "", 1), ("near", "threshold", "yes", 1),
    ]  # fmt: skip
    mean, error = (float(part) for part in table.rows[0]["odometry m"].split(" +- "))
    assert mean == pytest.approx(np.mean(off[:2]), abs=1e-3)
    assert error == pytest.approx(abs(off[0] - off[1]) / 2, abs=6e-4) and error > 1e-3
    assert table.rows[2]["odometry m"] == "-"


def test_of_samples_are_compared_what_reads_samples(rooms):
    chosen = Chosen.of(Options(["doppler"]), DataSet.load(rooms))
    assert chosen.odometry == ("doppler",)
    assert {"segmentation", "first-echo", "radarhd"} <= set(chosen.scans) and "pictures" not in chosen.scans


def test_data_that_a_benchmark_cannot_use(rooms, tmp_path):
    lone = tmp_path / "lone"
    lone.mkdir()
    with pytest.raises(InputError, match="holds no recordings"):
        benchmark("odometry", lone, tmp_path)
    (lone / "A_cart.h5").symlink_to(rooms / "A_cart.h5")
    with pytest.raises(InputError, match="no recording has attributes ablation and value"):
        benchmark("ablation", lone, tmp_path)
    with pytest.raises(InputError, match="no recording has an attribute chirps"):
        benchmark("radars", lone, tmp_path)
    with pytest.raises(InputError, match="no split of kind building, expected one to train on"):
        benchmark("buildings", lone, tmp_path, Options(trained=True))
    with pytest.raises(
        InputError, match="nothing could be compared: .*translation.safetensors: does not fit this radar"
    ):
        benchmark("odometry", lone, tmp_path, Options(["learned"]))
    with pytest.raises(InputError, match="methods names learned, segmentation, of which this benchmark compares none"):
        benchmark("ablation", rooms, tmp_path, Options(["learned", "segmentation"]))


def test_the_how_tos_methods_run(rooms, tmp_path, monkeypatch):
    text = (Path(__file__).parents[3] / "docs" / "howto" / "method.md").read_text()
    monkeypatch.setitem(SCANS, "wall", SCANS["cfar"])  # so that it is taken out again
    monkeypatch.setitem(ODOMETRY, "straight", ODOMETRY["doppler"])
    paths = {"small": rooms, "tables": tmp_path, "walk.h5": rooms / "A_cart.h5", "MINE": tmp_path / "M"}
    for name, path in paths.items():
        text = text.replace(f'"{name}"', repr(str(path)))
    wall, straight = re.findall("```python\n(.*?)```", text, re.S)
    exec(compile(wall, "method.md", "exec"), {})
    exec(compile(straight, "method.md", "exec"), {})
    assert Run(tmp_path / "M").methods["odometry"] == "straight"
    rows = json.loads((tmp_path / "mapping.json").read_text())["tables"][0]["rows"][-2:]
    assert [row["scans"] for row in rows] == ["wall", "threshold"] and rows[0]["returned %"] == pytest.approx(100)


def test_requested_methods_without_a_row_are_named(rooms, toys, tmp_path):
    lines = []
    found = benchmark("odometry", rooms, tmp_path, Options([*toys, "cfar"]), log=lines.append)["odometry"]
    assert lines == ["odometry: Requested methods that this benchmark does not compare: cfar."]
    assert lines[0].removeprefix("odometry: ") in found.notes
    assert lines[0].removeprefix("odometry: ") in (tmp_path / "odometry.html").read_text()
    assert not Study.plan(BENCHMARKS["mapping"], DataSet.load(rooms), tmp_path, Options([*toys, "cfar"])).left_out


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["odometry", "--out", "x"], "--data is missing, expected a folder"),
        (["odometry", "--data", "none", "--out", "x"], "none: holds no recordings, expected *.h5"),
    ],
)
def test_the_command_line(capsys, arguments, expected):
    with pytest.raises(SystemExit) as ended:
        command_line(cli.app, "radarize", ["benchmark", *arguments])
    assert ended.value.code == 2 and expected in capsys.readouterr().err


def test_the_list_names_all(capsys):
    with pytest.raises(SystemExit):
        command_line(cli.app, "radarize", ["benchmark", "list"])
    first = [line.split(" ")[0] for line in capsys.readouterr().out.splitlines()[2:]]
    assert [word for word in first if word] == [*BENCHMARKS]
