"""Settings of the pipeline: described fields, `radarize config`, errors of configuration files."""

import re
from collections.abc import Iterator

import pytest
import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarize.cli import app
from radarize.evaluation.benchmark.choices import SETS
from radarize.io.console import run as command
from radarize.io.errors import InputError
from radarize.io.plain import tuned_on, unit_of
from radarize.pipeline.config import Configuration, summary
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import make_pipeline
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import HeatmapConfig
from radarize.slam.config import SlamConfig


def leaves(section: dict, at: str = "") -> dict[str, object]:
    """Every field by its path."""
    found = {}
    for name, value in section.items():
        found |= leaves(value, f"{at}{name}.") if isinstance(value, dict) else {f"{at}{name}": value}
    return found


def fields(section: BaseModel, at: str = "") -> Iterator[tuple[str, object, FieldInfo]]:
    """Path, value and field of every setting; each section has a summary."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            assert summary(type(value)), at + name
            yield from fields(value, f"{at}{name}.")
        else:
            yield at + name, value, field


@pytest.mark.parametrize(
    ("path", "value", "field"), [pytest.param(*each, id=each[0]) for each in fields(Configuration())]
)
def test_every_setting_has_a_description_and_a_unit(path, value, field):
    """And sets of recordings that it was tuned on exist."""
    assert field.description and not field.description.endswith(".")
    assert bool(unit_of(field)) != isinstance(value, bool)
    assert set(re.findall(r"\b[A-Z]{4,}\b", tuned_on(field))) - {"NEES", "SLAM"} <= SETS.keys()


def test_what_is_printed_is_what_is_meant(tmp_path, capsys):
    """Every field of every section, and the defaults come back from it; so do changed ones."""
    with pytest.raises(SystemExit) as ended:
        command(app, "radarize", ["config"])
    text = capsys.readouterr().out
    assert ended.value.code == 0 and text == Configuration().text()
    assert leaves(yaml.safe_load(text)).keys() == leaves(Configuration().model_dump()).keys()
    (tmp_path / "mine.yaml").write_text(text)
    assert Configuration.load(tmp_path / "mine.yaml") == Configuration()
    assert max(map(len, text.splitlines())) <= 120 and text.count("#") > 8
    mine = Configuration(heatmaps=HeatmapConfig(loading=0.25), slam=SlamConfig.preset("lidar"))
    (tmp_path / "mine.yaml").write_text(mine.text())
    assert Configuration.load(tmp_path / "mine.yaml") == mine != Configuration()


def test_a_file_says_what_differs(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("scans: {cfar: {window: 5}}\nslam:\n  grid: {hit: 0.9}\n")
    found, usual = Configuration.load(path), Configuration()
    changed = {name: value for name, value in leaves(found.model_dump()).items()
               if leaves(usual.model_dump())[name] != value}  # fmt: skip
    assert changed == {"scans.cfar.window": 5, "slam.grid.hit": 0.9}
    path.write_text("")
    assert Configuration.load(path) == usual


def test_methods_get_their_settings():
    """Settings of heat maps are used in every batch, those of scans and SLAM in their steps."""
    mine = Configuration.model_validate(
        Configuration().model_dump() | {"heatmaps": {"loading": 0.3}, "scans": {"min_range": 1.5}}
    )
    inputs = Inputs(PRESETS["radarize"], mine)
    pipeline = make_pipeline(inputs, "doppler", "first-echo")
    assert inputs.signal.heatmaps.settings.loading == 0.3 and pipeline.extractor.config.min_range == 1.5
    assert pipeline.odometry.rotation._heatmaps.settings.loading == 0.3
    assert pipeline.slam.config == mine.slam


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("fuel: 1", "mine.yaml: fuel is 1, expected: "),
        ("scans: {range: 3}", "mine.yaml: scans.range is 3, expected: "),
        ("slam: {grid: {hit: 1.5}}", r"mine.yaml: slam.grid.hit is 1.5, expected: .*less than 1"),
        ("heatmaps: {loading: lots}", "mine.yaml: heatmaps.loading is 'lots', expected: .*number"),
        ("scans: 3", "mine.yaml: scans is 3, expected: "),
        ("[1, 2]", "mine.yaml: holds a list, expected sections as `radarize config` prints"),
        ("a: [", "mine.yaml: malformed YAML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, capsys, text, expected):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=expected) as refused:
        Configuration.load(path)
    assert "\n" not in str(refused.value)
    with pytest.raises(SystemExit) as ended:
        command(app, "radarize", ["run", "missing.h5", "-o", str(tmp_path / "run"), "--config", str(path)])
    assert ended.value.code == 2 and str(refused.value) in capsys.readouterr().err


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="none.yaml: no such file"):
        Configuration.load(tmp_path / "none.yaml")
