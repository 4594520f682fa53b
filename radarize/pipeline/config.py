"""All settings of the pipeline: ``radarize config`` prints them, ``radarize run --config mine.yaml`` reads them."""

import json
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from radarize.io.plain import Frozen, tuned_on, unit_of
from radarize.io.yamlfile import read_settings
from radarize.odometry.doppler import DopplerConfig
from radarize.odometry.integration import VelocityConfig
from radarize.odometry.rotation import RotationConfig
from radarize.odometry.settings import FusionConfig, TurnConfig
from radarize.scans.extraction import ScanConfig
from radarize.signal.heatmaps import HeatmapConfig
from radarize.slam.config import SlamConfig


class Configuration(Frozen):
    """Settings of the pipeline, one section per step."""

    heatmaps: HeatmapConfig = HeatmapConfig()
    scans: ScanConfig = ScanConfig()
    doppler: DopplerConfig = DopplerConfig()
    rotation: RotationConfig = RotationConfig()
    velocity: VelocityConfig = VelocityConfig()
    fusion: FusionConfig = FusionConfig()
    turns: TurnConfig = TurnConfig()
    slam: SlamConfig = SlamConfig.preset("radar")

    @classmethod
    def load(cls, path: str | Path) -> "Configuration":
        """Return the defaults with the values of a YAML file in their place; sections and fields as above.

        Raises:
            InputError: no such file, or a field that does not exist or has an impossible value.
        """
        return read_settings(path, cls(), "sections as `radarize config` prints")

    def text(self) -> str:
        """Return the settings as YAML, with a comment above each: description, unit, recordings it was tuned on."""
        return _HEAD + "\n".join(_lines(self, "")) + "\n"


_HEAD = """\
# Settings of the pipeline. Units are in brackets; [1] is a number without a unit. Names in capitals are sets of
# recordings in radarize/evaluation/benchmark/choices.yaml.
"""


def summary(section: type[BaseModel]) -> str:
    """Return the first line of a section's docstring without markup and full stop."""
    return (section.__doc__ or "").split("\n")[0].rstrip(".").replace("`", "")


def _lines(section: BaseModel, indent: str) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        nested = isinstance(value, BaseModel)
        comment = summary(type(value)) if nested else _comment(field)
        yield from wrap(comment, 118, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ")
        if nested:
            yield f"{indent}{name}:"
            yield from _lines(value, indent + "  ")
        else:
            yield f"{indent}{name}: {json.dumps(value)}"


def _comment(field: FieldInfo) -> str:
    unit, tuned = unit_of(field), tuned_on(field)
    return f"{field.description}{f' [{unit}]' if unit else ''}{f'. Tuned on {tuned}' if tuned else ''}"
