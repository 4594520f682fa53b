"""YAML files that people write."""

import math
from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from radarize.errors import InputError

Settings = TypeVar("Settings", bound=BaseModel)


def read_yaml(path: str | Path, most: float = math.inf) -> object:
    """What a YAML file holds, of at most so many bytes: PyYAML makes some hundreds of each.

    Raises:
        InputError: the file cannot be read, or is malformed or too large.
    """
    try:
        if (size := Path(path).stat().st_size) > most:
            raise InputError(f"{path}: has {size} bytes, expected at most {most}")
        return yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read ({error}), expected text in UTF-8") from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # a date like 2026-99-99 is a ValueError
        raise InputError(f"{path}: malformed YAML, {' '.join(str(error).split())}") from error


def read_settings(path: str | Path, defaults: Settings) -> Settings:
    """Settings with what a YAML file says otherwise: sections and fields named as there.

    Raises:
        InputError: no such file, or a field that does not exist or has an impossible value.
    """
    changes = read_yaml(path) or {}
    if not isinstance(changes, dict):
        raise InputError(f"{path}: holds a {type(changes).__name__}, expected sections as `radarize config` prints")
    try:
        return type(defaults).model_validate(changed(defaults, changes))
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise InputError(f"{path}: {where} is {first['input']!r}, expected: {first['msg']}") from error


def changed(settings: BaseModel, changes: dict[str, object]) -> dict[str, object]:
    """The fields of settings, with some of them changed: those of settings within settings, too, however deep."""
    within = {
        name: changed(part, changes[name])
        for name in changes
        if isinstance(part := getattr(settings, name, None), BaseModel) and isinstance(changes[name], dict)
    }
    return settings.model_dump() | changes | within
