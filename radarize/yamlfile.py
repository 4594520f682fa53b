"""YAML files that people write."""

import math
from pathlib import Path
from typing import TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from radarize.errors import InputError, explained
from radarize.plain import complaint

Settings = TypeVar("Settings", bound=BaseModel)


def read_yaml(path: str | Path, most: float = math.inf) -> object:
    """What a YAML file holds, of at most so many bytes: PyYAML makes some hundreds of each.

    Raises:
        InputError: the file cannot be read, or is malformed or too large.
    """
    try:
        with explained(f"{path}: cannot be read", OSError, UnicodeDecodeError):
            if (size := Path(path).stat().st_size) > most:
                raise InputError(f"{path}: has {size} bytes, expected at most {most}")
            text = Path(path).read_text(encoding="utf-8")
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # a date like 2026-99-99 is a ValueError
        raise InputError(f"{path}: malformed YAML, {' '.join(str(error).split())}") from error


def read_settings(path: str | Path, defaults: Settings, expected: str) -> Settings:
    """Settings with what a YAML file says otherwise: sections and fields named as there.

    Args:
        expected: what such a file holds, in words.

    Raises:
        InputError: no such file, or a field that does not exist or has an impossible value.
    """
    changes = read_yaml(path) or {}
    if not isinstance(changes, dict):
        raise InputError(f"{path}: holds a {type(changes).__name__}, expected {expected}")
    try:
        return type(defaults).model_validate(_merged(defaults.model_dump(), changes))
    except ValidationError as error:
        raise InputError(f"{path}: {complaint(error)}") from error


def _merged(settings: dict, changes: dict) -> dict:
    """Settings with some of them changed, however deep."""
    both = {name for name in changes if isinstance(changes[name], dict) and isinstance(settings.get(name), dict)}
    return settings | changes | {name: _merged(settings[name], changes[name]) for name in both}
