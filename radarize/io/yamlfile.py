"""YAML files that people write."""

from pathlib import Path
from typing import Any, TypeVar, cast

import yaml
from pydantic import BaseModel, ValidationError

from radarize.io.errors import InputError
from radarize.io.files import read_text
from radarize.io.plain import format_validation_error

Settings = TypeVar("Settings", bound=BaseModel)
#: Bytes of a file, of which PyYAML makes some hundreds each; values in it, counted as often as aliases repeat them; how
#: deep they nest, and the digits of a number.
_BYTES, _VALUES, _DEPTH, _DIGITS = 2 << 20, 250_000, 32, 40
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same in C, where PyYAML was built with it


def read_yaml(path: str | Path, most: int = _BYTES) -> object:
    """What a YAML file holds, of at most so many bytes.

    Raises:
        InputError: the file cannot be read, is malformed, or holds more than anybody would write.
    """
    text = read_text(path, "YAML", most)
    try:
        return _content(text)
    except (yaml.YAMLError, ValueError) as error:  # a date like 2026-99-99 is a ValueError
        raise InputError(f"{path}: malformed YAML, {' '.join(str(error).split())}") from error


def read_beside(module: str) -> dict[str, Any]:
    """What the YAML file that comes with a module (its ``__file__``) and has its name holds, a mapping."""
    return cast(dict[str, Any], read_yaml(Path(module).with_suffix(".yaml")))


def _content(text: str) -> object:
    depth = 0
    for count, event in enumerate(yaml.parse(text, _Loader)):  # composing recurses, and takes memory; this does not
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
    """Values within a node, aliases followed, and how deep they nest.

    Raises:
        ValueError: it holds itself, or a number of too many digits.
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
        return type(defaults).model_validate(changed(defaults, changes))
    except ValidationError as error:
        raise InputError(f"{path}: {format_validation_error(error)}") from error


def changed(settings: BaseModel, changes: dict[str, object]) -> dict[str, object]:
    """The fields of settings, with some of them changed: those of settings within settings, too, however deep."""
    within = {
        name: changed(part, change)
        for name, change in changes.items()
        if isinstance(part := getattr(settings, str(name), None), BaseModel) and isinstance(change, dict)
    }
    return settings.model_dump() | changes | within
