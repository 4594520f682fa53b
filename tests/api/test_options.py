"""A command and its function have the same options, with the same defaults."""

import inspect
from dataclasses import MISSING, fields
from typing import get_type_hints

import pytest
import typer

import radarize as rz
import radarsim
from radarize import cli as radarize_cli
from radarize.capture.api import LiveOptions
from radarize.capture.board import NetworkAddresses
from radarize.capture.uart import BAUD
from radarize.io.importers import Given
from radarize.io.load import CaptureOptions
from radarsim import cli as radarsim_cli
from radarsim.api import Plan
from radarsim.motion.walk import Walk
from radarsim.recording.simulate import planned

#: Of functions alone: a terminal shows how far a command is.
PROGRESS = {"progress"}


def defaults(function) -> dict[str, object]:
    return {
        name: each.default
        for name, each in inspect.signature(function).parameters.items()
        if each.kind is not each.VAR_KEYWORD
    }


def of_fields(kind: type) -> dict[str, object]:
    return {each.name: each.default for each in fields(kind) if each.default is not MISSING}


#: Command: its function, further options of that with their defaults, and what only the command has, and why.
PAIRS = {
    "radarize run": (
        rz.run,
        {},
        {"every": "frames are sliced: rec[::2]", "board": "recordings are opened with it: rz.load(rec, board=...)"},
    ),
    "radarize calibrate": (rz.calibrate, {}, {}),
    "radarize evaluate": (rz.evaluate, {}, {"beside": "one table of several", "as_json": "how it is printed"}),
    "radarize import": (rz.load, dict.fromkeys(CaptureOptions.__annotations__) | of_fields(Given), {}),
    "radarize live": (
        rz.live,
        {
            **of_fields(NetworkAddresses),
            "weights": None,
            "pipeline": None,
            "baud": BAUD,
            "output": None,
            "overwrite": False,
            "address": None,
            "foxglove": None,
            "board": None,
        },
        {},
    ),
    "radarsim simulate": (radarsim.simulate, defaults(planned) | of_fields(Walk), {}),
}
#: Options with different defaults in command and function, and why.
OTHERWISE = {
    ("radarize import", "output"): "a command leaves a file",
    ("radarize calibrate", "output"): "a command leaves a file",
    ("radarize run", "output"): "a command leaves a folder",
    ("radarsim simulate", "output"): "a command leaves a file",
    ("radarize live", "address"): "a command shows a page",
    ("radarsim simulate", "workers"): "a script that starts processes needs a guard, a command does not",
}


@pytest.mark.parametrize("command", PAIRS)
def test_options(command):
    function, more, alone = PAIRS[command]
    package, name = command.split()
    app = {"radarize": radarize_cli, "radarsim": radarsim_cli}[package].app
    parameters = typer.main.get_command(app).commands[name].params
    of_command = {each.name: each.default for each in parameters if each.name not in {"help", *alone}}
    options = get_type_hints(
        {rz.load: CaptureOptions, rz.live: LiveOptions, radarsim.simulate: Plan}.get(function, object)
    )
    known = defaults(function) | {option: more[option] for option in options}
    assert of_command.keys() == known.keys() - PROGRESS
    for option, default in of_command.items():
        if known[option] is not inspect.Parameter.empty and (command, option) not in OTHERWISE:
            assert default == known[option] or not default and not known[option], option
