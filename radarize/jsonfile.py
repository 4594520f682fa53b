"""JSON files that this package writes, and reads whatever became of them."""

import json
from collections.abc import Callable
from pathlib import Path

from radarize.errors import InputError, explained

#: Bytes of a file: Python makes some 25 of each.
_LARGEST = 8 << 20


def read_json(path: Path) -> dict:
    """A JSON object, empty if there is no such file.

    Raises:
        InputError: it is not JSON, or far larger than any that this package writes.
    """
    if not path.is_file():
        return {}
    if (size := path.stat().st_size) > _LARGEST:
        raise InputError(f"{path}: has {size} bytes, expected at most {_LARGEST}")
    with explained(f"{path}: cannot be read", OSError, UnicodeDecodeError):
        text = path.read_text(encoding="utf-8")
    return parse_json(text, str(path))


def parse_json(text: str, name: str, number: Callable[[str], object] = float) -> dict:
    """A JSON object, whose fractions become what `number` makes of them; errors call it `name`.

    Raises:
        InputError: it is not JSON, or no object.
    """
    with explained(f"{name}: is not JSON", ValueError, RecursionError):  # thousands of digits, too deep
        content = json.loads(text, parse_float=number)
    if not isinstance(content, dict):
        raise InputError(f"{name}: holds a {type(content).__name__}, expected an object")
    return content
