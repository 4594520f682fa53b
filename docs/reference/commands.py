"""The page of commands, from their help texts."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, get_args, get_origin

import typer
from typer.core import TyperCommand

from docs.reference.markdown import code, table
from radarize import cli as radarize
from radarsim import cli as radarsim


def page() -> str:
    """Return the page: every command with its arguments and options."""
    found = ["# Commands", "`--debug` shows the traceback of an error, `--version` prints the version."]
    for name, app in (("radarize", radarize.app), ("radarsim", radarsim.app)):
        found += _described(name, typer.main.get_command(app))
    return "\n\n".join(found) + "\n"


def _described(name: str, command: TyperCommand) -> Iterator[str]:
    """Markdown of a command, or of all below it."""
    if hasattr(command, "commands"):
        for below in command.commands.values():
            yield from _described(f"{name} {below.name}", below)
        return
    rows = []
    for parameter in command.params:
        if parameter.name == "help":
            continue
        option = parameter.opts[0].startswith("-")
        flags = ", ".join(parameter.opts) if option else parameter.metavar or parameter.name.upper()
        kind = parameter.type_descriptor.annotation
        choices = f" One of {', '.join(map(code, get_args(kind)))}." if get_origin(kind) is Literal else ""
        default = parameter.default if isinstance(parameter.default, str | int | float | Path) else ""
        shown = "required" if parameter.required else "" if default in ("", False) else code(default)
        rows.append((code(flags), (getattr(parameter, "help", "") or "") + choices, shown))
    yield f"## {name}"
    yield " ".join((command.help or "").split())
    if rows:
        yield table(("argument or option", "", "default"), rows).strip()
