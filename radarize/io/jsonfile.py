"""JSON files that this package writes, and reads whatever became of them."""

import json
from collections.abc import Callable
from pathlib import Path

from radarize.io.errors import InputError, explained
from radarize.io.files import read_text

#: Digits of a whole number.
_DIGITS = 40


def read_json(path: Path) -> dict:
    """A JSON object, empty if there is no such file.

    Raises:
        InputError: it is not JSON, or far larger than any that this package writes.
    """
    return parse_json(read_text(path, "JSON"), str(path)) if path.exists() else {}


def parse_json(text: str, name: str, number: Callable[[str], object] = float) -> dict:
    """A JSON object, whose fractions become what `number` makes of them; errors call it `name`.

    Raises:
        InputError: it is not JSON, or no object.
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
