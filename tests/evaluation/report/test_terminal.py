"""Output of `radarize evaluate` in a terminal of 80 columns."""

import json

import pytest

from radarize import cli
from radarize.io.console import run
from tests.evaluation.fake_run import write_run
from tests.evaluation.report.test_report import SPANS, listing, with_facts


@pytest.fixture
def evaluate(monkeypatch, capsys):
    """Run the command and return its output."""
    monkeypatch.setenv("COLUMNS", "80")

    def call(*arguments: object) -> str:
        with pytest.raises(SystemExit) as exit_:
            run(cli.app, "radarize", ["evaluate", *map(str, arguments)])
        assert exit_.value.code == 0
        return capsys.readouterr().out

    return call


def test_it_prints_what_it_writes(tmp_path, evaluate):
    folder = write_run(tmp_path / "run")
    out = evaluate(folder)
    metrics = json.loads((folder / "metrics.json").read_text())
    assert f"{metrics['slam']['ate']['position']['mean']:.3f} m" in out
    assert f"{100 * metrics['map']['f1']:.3g} %" in out and "observable" not in out
    assert max(map(len, out.splitlines())) <= 80
    assert json.loads(evaluate(folder, "--json")) == metrics


def test_runs_beside_each_other(tmp_path, evaluate):
    """Names of methods are complete, and only the metrics of the first run are written."""
    names = ("scan-matching", "fused", "[b]mine[/b]")
    runs = [
        with_facts(write_run(tmp_path / str(k), seed=k), methods={"odometry": name, "scans": "segmentation"})
        for k, name in enumerate(names)
    ]
    before = listing(*runs)
    out = evaluate(runs[0], "--beside", runs[1], "--beside", runs[2])
    assert max(map(len, out.splitlines())) <= 80
    assert all(name in out for name in names) and out.count("segmentation") == 3
    after = listing(*runs)
    assert {path: after[path] for path in before} == before
    assert set(after) - set(before) == {str(runs[0] / "metrics.json")}


def test_spans_with_unobservable_motion(tmp_path, evaluate):
    folder = with_facts(write_run(tmp_path / "run"), **{"blind": SPANS})
    out = evaluate(folder)
    assert "on 2.2 m, 12 % of the path" in " ".join(out.split())
    assert "no turn" in out and "no <velocity>" in out
    assert json.loads((folder / "metrics.json").read_text())["blind"] == SPANS
