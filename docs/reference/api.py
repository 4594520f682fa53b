"""The page of the Python API, from docstrings and signatures."""

import ast
import inspect
import textwrap
from importlib import import_module
from typing import Any

from docs.reference.markdown import code, docstring, plain, table

_HEAD = """# Python API

For your own programs. The annotations give the shapes of arrays; units are SI. Input that cannot be used raises
`radarize.InputError`. [In Python](../howto/python.md) introduces the functions. Examples take `import radarize as rz`
and an opened recording, `rec`. Of a member's arguments, those in brackets are optional. `radarize.odometry` is another
name of `radarize.estimate_odometry`.
"""
#: Beyond the names of `radarize` and `radarsim`: sections of names by where they are defined.
_SECTIONS = {
    "Recordings": (
        "radarize.io.recording.Clip", "radarize.io.recording.RecordingWriter",
        "radarize.io.importers.import_recording", "radarize.io.exporters.export",
    ),
    "Signals": (
        "radarize.radar.config.RadarConfig", "radarize.radar.presets.load_config", "radarize.signal.heatmaps.Heatmaps",
        "radarize.signal.batch.Batch",
    ),
    "Pipeline and plug-ins": (
        "radarize.pipeline.pipeline.Pipeline", "radarize.pipeline.methods.make_pipeline",
        "radarize.pipeline.method.Method", "radarize.pipeline.method.Inputs",
        "radarize.pipeline.pipeline.ScanExtractor", "radarize.pipeline.pipeline.OdometryEstimator",
        "radarize.odometry.integration.Track", "radarize.odometry.uncertainty.ErrorModel",
        "radarize.io.importers.format.Format", "radarize.slam.backend.Slam",
        "radarize.pipeline.runfolder.RunFolder", "radarize.pipeline.runfolder.OccupancyMap",
        "radarize.evaluation.evaluate.evaluate",
    ),
    "Simulator": (
        "radarsim.world.scene.Scene", "radarsim.motion.walk.Walk", "radarsim.scenario.Scenario",
        "radarsim.scenario.Frames", "radarsim.recording.simulate.simulate", "radarsim.schema.schema",
    ),
}  # fmt: skip


def page() -> str:
    """Return the page: every public name with signature, docstring and example."""
    found = [_HEAD]
    for package in ("radarize", "radarsim"):
        found.append(f"## import {package}\n")
        names = import_module(package).__all__
        found += [_described(f"{package}.{name}") for name in names if name not in ("__version__", "odometry")]
    for section, names in _SECTIONS.items():
        found += [f"## {section}\n", *map(_described, names)]
    return "\n".join(found)


def _described(name: str) -> str:
    module, _, attribute = name.rpartition(".")
    each = getattr(import_module(module), attribute)
    signature = f"```python\n{_signature(each, attribute)}\n```\n"
    parts = [f"### {name}\n", signature, docstring(inspect.getdoc(each) or "")]
    if inspect.isclass(each) and (rows := list(_members(each))):
        parts.append(table(("member", ""), rows))
    return "\n".join(parts)


def _signature(each: Any, name: str) -> str:
    """As in the source, with its annotations."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(each))).body[0]
    if isinstance(tree, ast.ClassDef):
        made = next((node for node in tree.body if getattr(node, "name", "") == "__init__"), None)
        if made is None:
            return f"class {name}"
        return f"class {name}({_arguments(made)})"
    return f"{name}({_arguments(tree)}) -> {ast.unparse(tree.returns) if tree.returns else None}"


def _arguments(function: Any) -> str:
    arguments = ast.unparse(function.args)
    return arguments.removeprefix("self, ").removeprefix("self")


def _call(function: Any) -> str:
    """Names of the arguments, with those that need not be given in brackets."""
    known = [each for name, each in inspect.signature(function).parameters.items() if name not in ("self", "cls")]
    return f"({', '.join(each.name if each.default is each.empty else f'[{each.name}]' for each in known)})"


def _members(of: type) -> Any:
    """Public methods and properties that the class itself defines, with the first line of their docstrings."""
    for name, member in vars(of).items():
        function = getattr(member, "__func__", member)
        about = inspect.getdoc(function) if callable(function) or isinstance(function, property) else None
        cached = getattr(function, "func", None)
        about = inspect.getdoc(cached) if cached is not None else about
        if not name.startswith("_") and about and not inspect.isclass(function):
            call = "" if isinstance(function, property) or cached is not None else _call(function)
            yield code(f"{name}{call}"), plain(about.split("\n\n")[0])
