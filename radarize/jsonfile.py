"""JSON files that this package writes, and reads whatever became of them."""

import json
from pathlib import Path

from radarize.errors import InputError

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
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({error})") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds a {type(content).__name__}, expected an object")
    return content
