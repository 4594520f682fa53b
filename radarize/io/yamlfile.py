"""Safe reader of YAML files that people write."""

from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError

from radarize.io.errors import InputError
from radarize.io.files import read_text
from radarize.io.plain import format_validation_error

Settings = TypeVar("Settings", bound=BaseModel)
#: Maximum bytes of a file, each of which needs some hundred bytes of memory in PyYAML; maximum number of values,
#: counted as often as aliases repeat them; maximum depth; maximum digits of a number.
_BYTES, _VALUES, _DEPTH, _DIGITS = 2 << 20, 250_000, 32, 40
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the implementation in C, if PyYAML has it


def read_yaml(path: str | Path, most: int = _BYTES) -> object:
    """Read a YAML file of at most `most` bytes.

    Raises:
        InputError: the file cannot be read, is malformed, or exceeds the limits.
    """
    text = read_text(path, "YAML", most)
    try:
        return _content(text)
    except (yaml.YAMLError, ValueError) as error:  # a date like 2026-99-99 is a ValueError
        raise InputError(f"{path}: malformed YAML, {' '.join(str(error).split())}") from error


def read_beside(module: str) -> dict[str, Any]:
    """Return the mapping in the YAML file beside a module (its ``__file__``), of the same name."""
    return cast(dict[str, Any], read_yaml(Path(module).with_suffix(".yaml")))


def _content(text: str) -> object:
    depth = 0
    for count, event in enumerate(
        yaml.parse(text, _Loader)
    ):  # unlike composing, parsing needs neither recursion nor memory
        if count > 2 * _VALUES:
            raise ValueError(f"it holds more than {_VALUES} values")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEPTH:
            raise ValueError(f"line {event.start_mark.line + 1} nests deeper than {_DEPTH} levels")
    loader = _Loader(text)
    try:
        if (node := loader.get_single_node()) is None:
            return None
        values, depth = _extent(node, {})
        if values > _VALUES or depth > _DEPTH:
            raise ValueError(
                f"it makes {values:.3g} values, {depth} levels deep, expected at most {_VALUES} and {_DEPTH}"
            )
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _extent(node: yaml.Node, known: dict[int, tuple[int, int] | None]) -> tuple[int, int]:
    """Return the number of values within a node, with aliases expanded, and their depth.

    Raises:
        ValueError: it contains itself, or a number of too many digits.
    """
    if isinstance(node, yaml.ScalarNode):
        if len(node.value) > _DIGITS and node.tag.endswith((":int", ":float")):
            raise ValueError(f"line {node.start_mark.line + 1} has a number of more than {_DIGITS} digits")
        return 1, 0
    if id(node) not in known:
        known[id(node)] = None
        within = [part for pair in node.value for part in pair] if isinstance(node, yaml.MappingNode) else node.value
        parts = [_extent(part, known) for part in within]
        known[id(node)] = 1 + sum(values for values, _ in parts), 1 + max((depth for _, depth in parts), default=0)
    if (found := known[id(node)]) is None:
        raise ValueError(f"line {node.start_mark.line + 1} has an alias of what it lies in")
    return found


def read_settings(path: str | Path, defaults: Settings, expected: str) -> Settings:
    """Read settings from a YAML file, with sections and fields named as in the defaults, which fill what is missing.

    Args:
        expected: description of such a file.

    Raises:
        InputError: no such file, or a field that does not exist or has an impossible value.
    """
    changes = read_yaml(path) or {}
    if not isinstance(changes, dict):
        raise InputError(f"{path}: holds a {type(changes).__name__}, expected {expected}")
    try:
        return type(defaults).model_validate(changed(defaults, changes))
    except ValidationError as error:
        raise InputError(f"{path}: {format_validation_error(error)}") from error


def changed(settings: BaseModel, changes: dict[str, object]) -> dict[str, object]:
    """Return the fields of settings with some of them changed, also in nested settings."""
    within = {
        name: changed(part, change)
        for name, change in changes.items()
        if isinstance(part := getattr(settings, str(name), None), BaseModel) and isinstance(change, dict)
    }
    return settings.model_dump() | changes | within
