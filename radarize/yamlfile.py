"""YAML files that people write."""

from pathlib import Path

import yaml

from radarize.errors import InputError


def read_yaml(path: str | Path) -> object:
    """What a YAML file holds.

    Raises:
        InputError: the file cannot be read, or is malformed.
    """
    try:
        return yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: cannot be read ({error}), expected text in UTF-8") from error
    except yaml.YAMLError as error:
        raise InputError(f"{path}: malformed YAML, {' '.join(str(error).split())}") from error
