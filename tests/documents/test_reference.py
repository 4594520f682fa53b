"""Reference pages and JSON schemas are up to date, and the schemas accept the project's files and no others."""

import copy
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from jsonschema import Draft202012Validator

from docs.reference.pages import written
from radarize import cli as radarize
from radarize.io.console import run
from radarize.io.errors import InputError
from radarize.pipeline.config import Configuration
from radarsim import cli as radarsim
from radarsim import schema

ROOT = Path(__file__).parents[2]
SCENES, DATASETS = ROOT / "scenes", ROOT / "scenes" / "datasets"
BOARDS = ROOT / "radarize" / "radar" / "boards"
FILES = [
    *(("scene", path) for path in sorted(SCENES.rglob("*.yaml")) if DATASETS not in path.parents),
    *(("dataset", path) for path in sorted(DATASETS.rglob("*.yaml"))),
    *(("board", path) for path in sorted(BOARDS.glob("*.yaml"))),
]
VALIDATORS = {name: Draft202012Validator(schema.schema(name)) for name in schema.NAMES}


class Loader(yaml.SafeLoader):
    """Numbers as in YAML 1.2, which editors read: 60e9 is one."""


Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(\.\d+|\d+(\.\d*)?)[eE][-+]?\d+$"), list("-+.0123456789")
)


def read(path: Path) -> dict:
    """A file as JSON has it, whose keys are texts."""
    return json.loads(json.dumps(yaml.load(path.read_text(), Loader)))


def test_pages_and_schemas_are_up_to_date():
    """If this fails: python -m docs.reference"""
    assert [path for path, text in written().items() if (ROOT / path).read_text() != text] == []


def fields(part: object, at: str = "") -> Iterator[tuple[str, dict]]:
    """Every field of every model within a schema, by its path."""
    for key, value in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        if key == "properties" and "title" in part:
            yield from ((f"{at}.{name}", field) for name, field in value.items())
        yield from fields(value, f"{at}.{key}")


@pytest.mark.parametrize("name", schema.NAMES)
def test_every_field_has_a_description(name):
    found = VALIDATORS[name].schema
    Draft202012Validator.check_schema(found)
    known = list(fields(found))
    assert len(known) > 20
    assert [path for path, field in known if not field.get("description")] == []


@pytest.mark.parametrize(("name", "path"), FILES, ids=lambda each: getattr(each, "stem", each))
def test_files_of_the_project_are_valid(name, path):
    data = read(path)
    assert not list(VALIDATORS[name].iter_errors(data))
    if name == "board":
        assert not list(VALIDATORS["front-end"].iter_errors(data["front_end"]))


@pytest.mark.parametrize(("name", "path"), FILES, ids=lambda each: getattr(each, "stem", each))
def test_a_wrong_key_is_not(name, path):
    """At the top, and in every entry of a list or mapping of entries but levels, which may have any field."""
    data = read(path)
    parts = {"scene": ("objects", "building", "moving"), "dataset": ("recordings",), "board": ("front_end",)}[name]
    entries = [[]]
    for part in parts:
        inner = data.get(part)
        entries += [[part, k] for k in range(len(inner))] if isinstance(inner, list) else [[part]] * (inner is not None)
    for entry in entries:
        wrong = copy.deepcopy(data)
        inner = wrong
        for step in entry:
            inner = inner[step]
        inner["colour"] = "blue"
        assert list(VALIDATORS[name].iter_errors(wrong)), entry


def test_commands_print_the_schemas(capsys):
    for arguments, expected in (
        (["schema", "scene"], json.loads((SCENES / "schemas" / "scene.json").read_text())),
        (["schema", "board"], json.loads((SCENES / "schemas" / "board.json").read_text())),
    ):
        with pytest.raises(SystemExit) as ended:
            run(radarsim.app, "radarsim", arguments)
        assert ended.value.code == 0 and json.loads(capsys.readouterr().out) == expected
    with pytest.raises(InputError, match="schema is 'castle', expected one of scene, dataset, front-end, board"):
        schema.schema("castle")


def test_the_configuration_has_a_schema(capsys):
    with pytest.raises(SystemExit):
        run(radarize.app, "radarize", ["config", "--schema"])
    validator = Draft202012Validator(json.loads(capsys.readouterr().out))
    whole = yaml.safe_load(Configuration().text())
    assert not list(validator.iter_errors(whole)) and not list(validator.iter_errors({"slam": {"grid": {"hit": 0.8}}}))
    for text in ("fuel: 1", "slam: {grid: {hit: 1.5}}", "scans: {cfar: {windows: 3}}"):
        assert list(validator.iter_errors(yaml.safe_load(text)))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("scene", "objects: [{name: a, shape: box, size: [1, 1], material: wood}]"),
        ("scene", "objects: [{name: a, shape: box, size: [1, 1, 1], material: cheese}]"),
        ("scene", "building: {kind: A, seed: -1}"),
        ("scene", "interferers: [{name: a, radar: warp, position: [0, 0, 0]}]"),
        ("dataset", "{name: a, buildings: {A: {kind: B}}, recordings: [{building: A, platform: car, count: 1}]}"),
        ("front-end", "tx_power_dbm: loud"),
        ("front-end", "{phase_noise: {offset: [1]}}"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_not_valid(name, text):
    assert list(VALIDATORS[name].iter_errors(yaml.safe_load(text)))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("scene", "objects: [{name: a, shape: box, size: [1, 1, 1], material: itu_ceiling_board}]"),
        ("scene", "interferers: [{name: a, radar: {slope: 70.0e+12}, position: [0, 0, 0]}]"),
        ("front-end", "{leakage: {level_db: -40}, phase_noise: {lower_band_db: -1}, mount: null}"),
    ],
)
def test_a_right_value_is_valid(name, text):
    assert not list(VALIDATORS[name].iter_errors(yaml.safe_load(text)))
