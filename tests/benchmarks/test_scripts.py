"""The scripts write pages that say what they are of; those that take little time run here."""

import importlib
from pathlib import Path

import pytest

from benchmarks import results
from radarize.evaluation.benchmark.results import Results
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene


@pytest.fixture(scope="module")
def walk(tmp_path_factory) -> Path:
    """A second of the bare office, which takes less time to begin."""
    bare = Scene.of({"building": {"kind": "office", "seed": 7}, "clutter": 0, "unevenness": 0}, "office")
    path = tmp_path_factory.mktemp("data") / "office.h5"
    return simulate(bare, path, duration=1.0, seed=4)


@pytest.mark.parametrize(
    ("script", "words"),
    [
        ("claims", ["--data", "{walk.parent}"]),
        ("motion_statistics", ["--buildings", "1"]),
        ("path_types", ["--frames", "2"]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_script_writes_its_page(script, words, walk, tmp_path, monkeypatch, capsys):
    module = importlib.import_module(f"benchmarks.{script}")
    words = [word.format(walk=walk) for word in words]
    monkeypatch.setattr("sys.argv", [script, *words])
    monkeypatch.setattr(results, "FOLDER", tmp_path)
    monkeypatch.setattr(module, "SCENES", ("office",), raising=False)  # the smallest
    module.main()
    page = Results.read(tmp_path / f"{script}.json")
    assert page.tables[0].rows and page.data.walks
    assert page.command.startswith(f"python -m benchmarks.{script} ")
    assert page.markdown() in capsys.readouterr().out
