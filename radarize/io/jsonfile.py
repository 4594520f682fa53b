"""Reader of JSON files, with limits for damaged ones."""

import json
from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError, explained
from radarize.io.files import read_text

#: Maximum number of digits of an integer.
_DIGITS = 40


def read_json(path: Path) -> dict:
    """Read a JSON object; empty if there is no file.

    Raises:
        InputError: not JSON, or far larger than any file that this package writes.
    """
    return parse_json(read_text(path, "JSON"), str(path)) if path.exists() else {}


def parse_json(text: str, name: str, number: Callable[[str], object] = float) -> dict:
    """Parse a JSON object; `number` converts fractions, and errors start with `name`.

    Raises:
        InputError: not JSON, or not an object.
    """
    with explained(f"{name}: is not JSON", ValueError, RecursionError):  # thousands of digits, too deep
        content = json.loads(text, parse_float=number, parse_int=_whole)
    if not isinstance(content, dict):
        raise InputError(f"{name}: holds a {type(content).__name__}, expected an object")
    return content


def _whole(digits: str) -> int:
    if len(digits) > _DIGITS:
        raise ValueError(f"a number of {len(digits)} digits, expected at most {_DIGITS}")
    return int(digits)
