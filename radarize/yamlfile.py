"""YAML files that people write."""

import math
from pathlib import Path

import yaml

from radarize.errors import InputError


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
