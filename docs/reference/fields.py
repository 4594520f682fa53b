"""Pages of YAML files, from their JSON schemas."""

import json
from collections.abc import Iterator
from typing import Any

from docs.reference.markdown import code, plain, table
from radarsim.dataset import randomise, specification
from radarsim.world import description
from radarsim.world.materials import MATERIALS

_MATERIAL = "[material](#materials)"

_HEADS = {
    "scene": ("Scene files", description.__doc__),
    "dataset": ("Data sets", f"{specification.__doc__}\n{randomise.__doc__}"),
    "front-end": (
        "Front-end files",
        "The front end turns the received wave into samples. `radarsim calibrate` fits one to a real radar and writes "
        "such a file; `radarsim simulate --frontend FILE.yaml` reads it. Fields that a file does not have are the "
        "board's.",
    ),
    "board": (
        "Board files",
        "A board is one YAML file: antenna positions, chip, front end, and its calibration where it was measured. "
        "`radarize/radar/boards` has those of this project; a radar's configuration names another one by its path, "
        "and `radarize calibrate` writes one. The name of a board is that of its file.",
    ),
}
_EDITOR = """Editors complete and check such a file by its [JSON schema](../../scenes/schemas/{name}.json), which
`radarsim schema {name} > {name}.json` writes, too. The YAML language server (VS Code, Neovim, PyCharm) reads it where
the file begins with

    # yaml-language-server: $schema={name}.json
"""


def page(name: str, schema: dict[str, Any]) -> str:
    """Return the page of a kind of file: a table of fields for it and for every kind of entry."""
    title, about = _HEADS[name]
    found = [f"# {title}\n", plain(about or "").strip() + "\n", "## In an editor\n", _EDITOR.format(name=name)]
    found += ["## Fields\n", _fields(schema, "the board's" if name == "front-end" else "")]
    kinds = dict(_kinds(schema, schema.get("$defs", {})))
    for entry, each in kinds.items():
        found += [f"### {entry}\n", plain(each.get("description", "")) + "\n", _fields(each)]
    if _MATERIAL in "".join(found):
        found += ["### Materials\n", ", ".join(map(code, sorted(MATERIALS))) + ".\n"]
    return "\n".join(found)


def _kinds(schema: Any, known: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Models within a schema, those that are named first before those that they name."""
    seen: dict[str, dict[str, Any]] = {}
    waiting = [schema]
    while waiting:
        for value in _inner(waiting.pop(0)):
            name = (
                value.get("$ref", "").removeprefix("#/$defs/") or ("properties" in value and value.get("title")) or ""
            )
            each = known.get(name, value)
            if name and name not in seen:
                seen[name] = each
                waiting.append(each)
    yield from seen.items()


def _inner(schema: Any) -> Iterator[dict[str, Any]]:
    """References and inline models in a schema."""
    for key, value in schema.items() if isinstance(schema, dict) else enumerate(schema):
        if key in ("$defs", "discriminator", "default") or not isinstance(value, dict | list):
            continue
        if isinstance(value, dict) and ("$ref" in value or {"properties", "title"} <= value.keys()):
            yield value
        else:
            yield from _inner(value)


def _fields(schema: dict[str, Any], missing: str = "") -> str:
    needed = schema.get("required", ())
    rows = []
    for name, field in schema.get("properties", {}).items():
        default = (
            "required" if name in needed else code(json.dumps(field["default"])) if "default" in field else missing
        )
        rows.append((code(name), kind(field), default, plain(field.get("description", ""))))
    return table(("field", "type", "default", "what it is"), rows) if rows else ""


def kind(field: dict[str, Any]) -> str:
    """Return the type of a field in words, with its limits."""
    if field.get("anyOf", [{}])[0].get("enum") == sorted(MATERIALS):
        return _MATERIAL
    for key in ("anyOf", "oneOf", "allOf"):
        if key in field:
            return " or ".join(dict.fromkeys(kind(each) for each in field[key]))
    if "$ref" in field or {"properties", "title"} <= field.keys():
        name = field.get("$ref", "").removeprefix("#/$defs/") or field["title"]
        return f"[{name}](#{name.lower()})"
    if "enum" in field or "const" in field:
        return ", ".join(code(value) for value in field.get("enum", [field.get("const")]))
    if "pattern" in field and "type" not in field:
        return "text"
    if field.get("type") == "array":
        if "prefixItems" in field:
            return f"[{', '.join(kind(each) for each in field['prefixItems'])}]"
        return f"list of {kind(field.get('items', {}))}"
    if field.get("type") == "object":
        if len(field.get("properties", {})) == 1:
            ((name, value),) = field["properties"].items()
            return f"{{{name}: {value.get('description', kind(value))}}}"
        each = field.get("additionalProperties") or next(iter(field.get("patternProperties", {}).values()), {})
        return f"mapping of names to {kind(each)}" if isinstance(each, dict) and each else "mapping"
    words = {"string": "text", "integer": "whole number", "boolean": "true or false", "null": "null"}
    name = words.get(field.get("type", ""), field.get("type", "anything"))
    limits = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
    return " ".join([name, ", ".join(f"{sign} {field[key]:g}" for key, sign in limits.items() if key in field)]).strip()
