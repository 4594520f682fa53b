"""Pages of results: their commands exist, and figures in docs agree with them."""

import ast
import importlib
import shlex
from pathlib import Path

import pytest
import typer

from benchmarks import figures, make
from benchmarks.results import PARTS
from radarize import cli as radarize
from radarize.evaluation.benchmark.results import Results
from radarize.evaluation.benchmark.study import BENCHMARKS
from radarsim import cli as radarsim
from radarsim.dataset.specification import Specification

PLACE = make.Place(PARTS, Path(), Path(), False, None, None)
LISTED = {name: about for page in make.PAGES.values() for name, about in page["parts"].items()}
DATA = {data for part, about in LISTED.items() for data in make.Part(part, about).sets()}


def understood(command: str) -> None:
    """Parse a command; SystemExit, ImportError or AssertionError if it is invalid."""
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


def test_every_part_is_of_one_page():
    assert len(LISTED) == sum(len(page["parts"]) for page in make.PAGES.values()) and len(make.PAGES) <= 14
    assert {path.stem for path in PARTS.glob("*.json")} <= LISTED.keys()
    assert {path.stem for path in PARTS.parent.glob("*.md")} == make.PAGES.keys()


@pytest.mark.parametrize("name", make.PAGES)
def test_a_page_is_made_of_its_parts(name):
    parts = {part: make.Part(part, about).read(PLACE) for part, about in make.PAGES[name]["parts"].items()}
    made = make.page(name, {part: results for part, results in parts.items() if results is not None}, [])
    assert (PARTS.parent / f"{name}.md").read_text() == made


@pytest.mark.parametrize("name", LISTED)
def test_a_part_has_a_command(name):
    """The command of the existing part, and the present ones, in full and as a short trial."""
    about = LISTED[name]
    path = PARTS / f"{name}.json"
    if path.is_file():
        understood(Results.read(path).command)
    for words in (about.get("words", ""), f"{about.get('words', '')} {about.get('smoke', '')}"):
        if "benchmark" in about:
            understood(f"radarize benchmark {about['benchmark']} --data DATA --out OUT {words}")
        else:
            understood(f"python -m benchmarks.{name} {words}")


@pytest.mark.parametrize("name", sorted(DATA))
def test_a_data_set_of_a_part_is_valid(name, tmp_path):
    """Except for the buildings that are made from lidar logs."""
    path = make.data_file(name)
    text = path.read_text()
    for plan in make.PLANS:
        text = text.replace(f"{plan}: {plan}.yaml", f"{plan}: {{kind: A, seed: 1}}")
    for config in path.parent.glob("*.cfg"):
        (tmp_path / config.name).write_text(config.read_text())
    (tmp_path / path.name).write_text(text)
    assert Specification.load(tmp_path / path.name).recordings


def test_main_of_a_script_is_the_end_of_its_file():
    """It runs where it is decorated, and does not know what stands below."""
    scripts = [path for path in make.HERE.glob("*.py") if "\n@script(" in path.read_text()]
    assert len(scripts) > 10
    for path in scripts:
        *_, last = ast.parse(path.read_text()).body
        assert isinstance(last, ast.FunctionDef) and last.decorator_list, path


def test_figures_of_the_docs_are_those_of_the_pages():
    assert len(figures.pages()) >= 2
    for page in figures.pages():
        text = page.read_text()
        assert figures.written(text) == text, page


def test_a_changed_figure_is_updated():
    stale = "On them it is <!-- figures: walks-mean -->0.99 and 0.999 m<!-- end -->, and so on."
    assert figures.walks_mean() in figures.written(stale) and "0.99" not in figures.written(stale)
    with pytest.raises(KeyError, match="walk-mean"):
        figures.written(stale.replace("walks-mean", "walk-mean"))


def test_a_short_trial_has_few_short_recordings():
    about = make.yaml.safe_load(make.shortened((make.HERE / "walks.yaml").read_text()))
    assert len(about["recordings"]) == make.FEW
    assert {(each["duration"], each["count"], *each["floors"]) for each in about["recordings"]} == {(2.0, 1, 0)}


@pytest.mark.parametrize(
    "command",
    [
        "radarize benchmark odometri --data small --out tables",
        "radarize benchmark odometry --data small --output tables",
        "radarize compare small",
        "radarsim simulate office --sensor all",
        "python -m benchmarks.tables slam",
        "python -m benchmarks.soak --length 5",
        "python benchmarks/soak.py",
    ],
)
def test_invalid_commands_are_detected(command):
    with pytest.raises((SystemExit, ImportError, AssertionError)):
        understood(command)


@pytest.mark.parametrize(
    "command",
    [
        "radarize benchmark slam --data evaluation --out tables --workers 2",
        "radarize benchmark all --data small -o tables --train --epochs 2",
        "radarsim dataset small -o small",
        "python -m benchmarks.soak --minutes 5",
    ],
)
def test_valid_commands_are_parsed(command):
    understood(command)
