"""JSON schemas of YAML files: scenes, data sets, front ends and boards.

`radarsim schema scene` prints one, with the shapes and movers of installed plug-ins. ``scenes/schemas`` has them
without plug-ins.
"""

from typing import Any

from pydantic import BaseModel

from radarize.io.errors import InputError
from radarize.io.schema import json_schema
from radarize.radar.boards import Board
from radarsim.dataset.specification import Specification
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.world.description import description_model

#: Parts of a front end, of which a file may change some fields.
_PARTS = "Antenna", "PhaseNoise"
NAMES = "scene", "dataset", "front-end", "board"


class BoardFile(Board):
    """A board's file; its name is the board's."""

    name: str = ""
    front_end: FrontEndConfig  # type: ignore[assignment]


def schema(name: str) -> dict[str, Any]:
    """Return the JSON schema of a kind of YAML file.

    Args:
        name: one of `NAMES`.

    Raises:
        InputError: there is no such kind.

    Example:
        >>> schema("scene")["title"]
        'Scene file'
    """
    if name not in NAMES:
        raise InputError(f"schema is {name!r}, expected one of {', '.join(NAMES)}")
    models: dict[str, tuple[type[BaseModel], str]] = {
        "scene": (description_model(), "Scene file"),
        "dataset": (Specification, "Data set"),
        "front-end": (FrontEndConfig, "Front end"),
        "board": (BoardFile, "Board"),
    }
    model, title = models[name]
    found = json_schema(model, title)
    for part in _PARTS:
        found.get("$defs", {}).get(part, {}).pop("required", None)
    if name == "front-end":
        found.pop("required")  # what a file does not name is the board's
    return found
