"""Comparisons end to end, on recordings that take no simulator."""

import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from radarize import cli
from radarize.benchmark import networks
from radarize.benchmark.benchmark import Study
from radarize.benchmark.benchmarks import BENCHMARKS
from radarize.benchmark.dataset import DataSet
from radarize.benchmark.protocol import PROTOCOLS
from radarize.benchmark.run import benchmark
from radarize.benchmark.runs import Pair, Run, code
from radarize.console import run as command_line
from radarize.errors import InputError
from radarize.methods.registry import ODOMETRY, SCANS
from radarize.recording import Recording
from tests.benchmark import toys as toy_file
from tests.benchmark.rooms import ROOMS, write_rooms
from tests.benchmark.toys import add


@pytest.fixture
def toys(monkeypatch) -> list[str]:
    return add(monkeypatch)


@pytest.fixture(scope="module")
def rooms(tmp_path_factory) -> Path:
    return write_rooms(tmp_path_factory.mktemp("rooms"))


def test_a_method_of_ones_own_is_in_every_table(rooms, toys, tmp_path):
    assert len(Path(toy_file.__file__).read_text().splitlines()) < 60  # two methods, and imports
    moved = []
    found = benchmark("all", rooms, tmp_path, methods=toys, progress=lambda done, total: moved.append((done, total)))
    assert set(found) == set(BENCHMARKS)
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
    found = benchmark("odometry", rooms, tmp_path, methods=toys)["odometry"]
    one, other = (ate(tmp_path / "runs" / name / "scaled+metre") for name in ("A_handheld", "A_cart"))
    assert abs(one - other) > 1e-4
    paper, mended = (table.rows[0]["ATE m"] for table in found.tables[:2])
    assert mended == pytest.approx((one + other) / 2)
    assert paper == pytest.approx(((one + other) / 2 + one) / 2, rel=1e-3)  # the first tests in both splits
    steps = {row["on"]: row for row in found.tables[2].rows}
    assert steps["handheld"]["ATE m"] == pytest.approx(one) and steps["cart"]["ATE m"] == pytest.approx(other)
    # A tenth too fast, but for the first frame, of which nothing is known.
    speeds = [np.linalg.norm(Recording(rooms / f"{name}.h5").read("truth/velocity"), axis=1) for name in ROOMS][:2]
    expected = np.mean([[-speed[0], *(0.1 * speed[1:])] for speed in speeds])
    assert steps["all"]["bias"] == pytest.approx(expected, rel=0.05)
    only = benchmark("odometry", rooms, tmp_path, methods=toys, protocol="mended")["odometry"]
    assert [table.title for table in only.tables] == ["Odometry, slips mended", found.tables[2].title]


def test_what_cannot_run_is_a_dash_with_a_reason(rooms, toys, tmp_path):
    found = benchmark("odometry", rooms, tmp_path, methods=[*toys, "learned"])["odometry"]
    rows = {row["odometry"]: row for row in found.tables[0].rows}
    assert np.isnan(rows["learned"]["ATE m"]) and rows["learned"]["recordings"] == 0
    assert "| learned | 0 | - | - |" in (tmp_path / "odometry.md").read_text()
    note = next(note for note in found.notes if note.startswith("learned+metre: - on 2 of 2 recordings"))
    assert "translation.safetensors: does not fit this radar" in note and str(tmp_path) not in note


def test_runs_are_done_once(rooms, toys, tmp_path, monkeypatch):
    benchmark("odometry", rooms, tmp_path, methods=toys)
    monkeypatch.setattr("radarize.benchmark.runs.run_each", None)  # would break whatever runs now
    benchmark("odometry", rooms, tmp_path, methods=toys)
    with pytest.raises(TypeError):
        benchmark("buildings", rooms, tmp_path, methods=toys)  # B_robot is new
    benchmark("mapping", rooms, tmp_path, methods=toys)


def test_a_changed_method_is_run_again(tmp_path, monkeypatch):
    """Whatever file a method comes from; a run whose sources are the same is kept."""
    monkeypatch.syspath_prepend(tmp_path)
    own = tmp_path / "own_method.py"
    own.write_text("def make(inputs):\n    return 1\n")
    from own_method import make

    before = code(make, partial(make, None))
    assert before != code(ODOMETRY["doppler"].maker)  # of the package
    code.cache_clear()
    assert before == code(make, partial(make, None))
    own.write_text("def make(inputs):\n    return 2\n")
    code.cache_clear()
    assert before != code(make, partial(make, None))


def test_networks_are_trained_on_each_split(rooms, toys, monkeypatch, tmp_path):
    asked = []

    def train(kind, data, output, *, split, settings, resume, say):
        asked.append((kind, split, settings.epochs, resume))
        if kind == "rotation":
            raise InputError(f"{data}: holds too little")
        output.write_text(split)
        say("epoch 1: loss 1")

    monkeypatch.setattr(networks, "train", train)
    choices = {"methods": [*toys, "learned"], "trained": True, "epochs": 2}
    monkeypatch.setattr("radarize.benchmark.benchmark.BEST", {"odometry": "scaled", "scans": "metre"})
    for _ in range(2):
        found = benchmark("buildings", rooms, tmp_path, **choices)["buildings"]
    kinds = [(kind, split) for split in ("building-A", "building-B") for kind in ("translation", "rotation")]
    # What could not be done is tried again, what could is not.
    assert [(kind, split) for kind, split, *_ in asked] == [*kinds, *(pair for pair in kinds if pair[0] == "rotation")]
    assert all(rest == [2, True] for _, _, *rest in asked)
    assert (tmp_path / "weights" / "building-A" / "translation.safetensors").read_text() == "building-A"
    assert any(note.startswith("building-A: rotation could not be trained") for note in found.notes)
    assert any("learned+metre: - on 3 of 3" in note for note in found.notes)
    # What needs no network is run once, whatever the split.
    assert sorted(path.name for path in (tmp_path / "runs").glob("*/*")) == ["scaled+metre"] * 3


def test_slam_of_baselines_is_open_in_the_papers_protocol(rooms, toys, tmp_path):
    study = Study.plan(BENCHMARKS["slam"], DataSet.load(rooms), tmp_path, toys)
    pair = Pair("scaled", "metre")
    for run in study.runs:
        errors = {name: {"ate": {"position": {"mean": k}, "rotation": {"mean": k}}, "re": {}} for k, name in
                  enumerate(("odometry", "slam", "open"))}  # fmt: skip
        study.results[run] = {**errors, "nearest": {name: each for name, each in errors.items()}}
    tables = BENCHMARKS["slam"].tables(study)
    assert [table.rows[0]["ATE m"] for table in tables] == [2, 1]
    assert PROTOCOLS["paper"].average(study, pair, "odometry")["ATE m"] == 0
    assert isinstance(study.runs[0], Run)


@pytest.mark.parametrize(
    ("name", "choices", "expected"),
    [
        ("odometri", {}, "benchmark is 'odometri', expected one of: odometry, odometry-platforms, slam"),
        ("odometry", {"methods": ["dopler"]}, "methods names 'dopler', expected some of: fused, learned"),
        ("odometry", {"protocol": "mine"}, "protocol is 'mine', expected one of: paper, mended"),
        ("odometry", {"weights": Path("none")}, "weights is none, expected a folder"),
        ("odometry", {"weights": Path(), "trained": True}, "weights . are given with --train, expected one"),
    ],
)
def test_bad_input_is_one_sentence(rooms, tmp_path, name, choices, expected):
    with pytest.raises(InputError, match=expected.replace(".", r"\.")):
        benchmark(name, rooms, tmp_path / "out", **choices)


def test_data_that_a_benchmark_cannot_use(rooms, tmp_path):
    lone = tmp_path / "lone"
    lone.mkdir()
    with pytest.raises(InputError, match="holds no recordings"):
        benchmark("odometry", lone, tmp_path)
    (lone / "A_cart.h5").symlink_to(rooms / "A_cart.h5")
    with pytest.raises(InputError, match="no recording has attributes ablation and value"):
        benchmark("ablation", lone, tmp_path)
    with pytest.raises(InputError, match="no split of kind building, expected one to train on"):
        benchmark("buildings", lone, tmp_path, trained=True)
    with pytest.raises(
        InputError, match="nothing could be compared: .*translation.safetensors: does not fit this radar"
    ):
        benchmark("odometry", lone, tmp_path, methods=["learned"])


def test_the_how_tos_method_runs(rooms, tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "comparing.md").read_text()
    code = next(block for block in re.findall("```python\n(.*?)```", text, re.S) if "class Wall" in block)
    monkeypatch.setitem(SCANS, "wall", None)  # so that it is taken out again
    code = code.replace('"small"', repr(str(rooms))).replace('"tables"', repr(str(tmp_path)))
    exec(compile(code, "comparing.md", "exec"), {})
    rows = json.loads((tmp_path / "mapping.json").read_text())["tables"][0]["rows"][-2:]
    assert [row["scans"] for row in rows] == ["wall", "threshold"] and rows[0]["returned %"] == pytest.approx(100)


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
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(BENCHMARKS)
