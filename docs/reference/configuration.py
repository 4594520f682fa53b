"""The page of the configuration, from its classes."""

from collections.abc import Iterator

from pydantic import BaseModel

from docs.reference.markdown import code, table
from radarize.io.plain import tuned_on, unit_of
from radarize.pipeline.config import Configuration, summary
from radarize.slam.config import PRESETS, SlamConfig

_HEAD = """# Configuration

All settings of the pipeline. `radarize config > mine.yaml` writes them with their defaults as YAML, and `radarize run
REC.h5 -o RUN --config mine.yaml` reads such a file; it needs to have only what differs. `radarize config --schema`
prints the JSON schema, by which an editor completes and checks the file: write `# yaml-language-server:
$schema=configuration.json` into its first line.

A number without a unit has the unit 1. The last column has the recordings on which the default was chosen; names in
capitals are sets of [choices.yaml](../../radarize/evaluation/benchmark/choices.yaml). It is empty where no such set is
recorded. The back end has three presets; the pipeline uses `radar`.
"""


def page() -> str:
    """Return the page: a table for every section."""
    return "\n".join([_HEAD, *_sections(Configuration(), "")])


def _sections(section: BaseModel, at: str) -> Iterator[str]:
    nested = []
    rows = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, BaseModel):
            nested.append((f"{at}{name}", value))
        else:
            rows.append([code(name), *_defaults(section, at, name), unit_of(field), field.description, tuned_on(field)])
    if rows:
        presets = [f"preset {name}" for name in PRESETS] if at.startswith("slam.") else ["default"]
        yield table(("field", *presets, "unit", "what it is", "tuned on"), rows)
    for path, value in nested:
        yield f"{'#' * (2 + path.count('.'))} {path}\n\n{summary(type(value))}.\n"
        yield from _sections(value, f"{path}.")


def _defaults(section: BaseModel, at: str, name: str) -> list[str]:
    """The default, or of the back end the value of each preset: `radar` is the pipeline's."""
    if not at.startswith("slam."):
        return [_shown(getattr(section, name))]
    part = at.split(".")[1]
    return [_shown(getattr(getattr(SlamConfig.preset(preset), part), name)) for preset in PRESETS]


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return code(str(value).lower())
    if isinstance(value, tuple):
        return code([*value])
    return code(f"{value:.6g}" if isinstance(value, float) else value)
