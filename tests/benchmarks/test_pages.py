"""Published pages: nobody can tell what a figure is worth if its command is gone or its page is of another layout."""

import importlib
import shlex
from pathlib import Path

import pytest
import typer

from radarize import cli as radarize
from radarize.evaluation.benchmark.results import Results
from radarize.evaluation.benchmark.study import BENCHMARKS
from radarsim import cli as radarsim

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"
PAGES = sorted(path.stem for path in RESULTS.glob("*.json"))


def understood(command: str) -> None:
    """Raises: SystemExit, ImportError or AssertionError: a command that is none."""
    program, *words = shlex.split(command)
    if program in ("radarize", "radarsim"):
        app = typer.main.get_command({"radarize": radarize, "radarsim": radarsim}[program].app)
        chosen = app.get_command(None, words[0])
        assert chosen is not None, f"{program} has no {words[0]}"
        try:
            context = chosen.make_context(words[0], words[1:])
        except Exception as error:  # the parser's own
            raise AssertionError(f"{command}: {error}") from error
        assert words[0] != "benchmark" or context.params["name"] in (*BENCHMARKS, "all", "real")
    else:
        assert [program, words[0]] == ["python", "-m"] and words[1].startswith("benchmarks."), command
        importlib.import_module(words[1]).main.parser.parse_args(words[2:])


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_as_this_version_writes_it(name):
    results = Results.read(RESULTS / f"{name}.json")
    assert results.markdown() == (RESULTS / f"{name}.md").read_text()
    understood(results.command)
    if results.command.startswith("python"):
        assert f"-m benchmarks.{name}" in results.command
    else:
        assert name in (*BENCHMARKS, "real")


def test_every_page_has_its_figures():
    assert PAGES == sorted(path.stem for path in RESULTS.glob("*.md"))


@pytest.mark.parametrize(
    "command",
    [
        "radarize benchmark odometri --data small --out tables",
        "radarize benchmark odometry --data small --output tables",
        "radarize compare small",
        "radarsim simulate office --sensor all",
        "python -m benchmarks.tables slam",
        "python -m benchmarks.twin --length 5",
        "python benchmarks/twin.py",
    ],
)
def test_commands_that_are_none_are_noticed(command):
    with pytest.raises((SystemExit, ImportError, AssertionError)):
        understood(command)


@pytest.mark.parametrize(
    "command",
    [
        "radarize benchmark slam --data evaluation --out tables --workers 2",
        "radarize benchmark all --data small -o tables --train --epochs 2",
        "radarsim dataset small -o small",
        "python -m benchmarks.twin --duration 5",
    ],
)
def test_commands_that_are_some_are_understood(command):
    understood(command)
