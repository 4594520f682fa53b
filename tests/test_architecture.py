"""Dependences between packages, and limits on their size and on arguments of functions."""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from radarize.io.extras import EXTRAS

ROOT = Path(__file__).parents[1]
#: Packages and modules of `radarize`, lowest first: each imports only what stands before it, or beside it.
LAYERS = (
    "io",
    "radar",
    "io.recording",
    "signal",
    "io.importers",
    "io.load",
    "learning",
    "odometry",
    "scans",
    "slam",
    "pipeline",
    "evaluation",
    "io.exporters",
    "capture",
    "cli baselines",
)
#: The same of `radarsim`.
SIMULATOR = (
    "machine",
    "world",
    "motion",
    "propagation",
    "receiver",
    "scenario",
    "sensors",
    "recording",
    "dataset emulator twin doctor webpreview api",
    "schema",
    "cli entry",
)
#: What the simulator may take: the sensor, files, and what it shares with a recording's maps and pages; its twins are
#: compared by what the pipeline makes of them, too.
SHARED = (
    "io", "radar", "signal.heatmaps", "signal.maps", "signal.points", "signal.polar", "learning.features",
    "pipeline.runfolder", "evaluation.report",
)  # fmt: skip
#: What only its twins may take beside, and what none of it may take of the first.
OF_TWINS, APART = ("signal.batch", "signal.bearings", "odometry", "scans"), ("io.importers", "io.load", "io.alignment")


@cache
def modules(package: str) -> dict[str, Path]:
    """Files of a package by the name that they are imported by."""
    paths = (ROOT / package).rglob("*.py")
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in paths}


@cache
def imported(package: str) -> dict[str, set[str]]:
    """Imports of each file of a package, including those in functions and under TYPE_CHECKING."""
    found: dict[str, set[str]] = {}
    for name, path in modules(package).items():
        found[name] = set()
        if name == package:
            continue  # the face: loaded at first use
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert not node.level, f"{path} imports relative to itself"
                members = {f"{node.module}.{alias.name}" for alias in node.names}
                there = members & modules(node.module.split(".")[0]).keys()
                found[name] |= there | ({node.module} if len(there) < len(members) else set())
    return found


def part(module: str) -> str:
    """The package or module of `radarize` or `radarsim` that a module belongs to, or a part of `radarize.io`: its
    recordings and formats are made of radars, whose files its openers read."""
    names = module.split(".")
    inner = ".".join(names[1:3])
    return inner if inner in " ".join(LAYERS).split() else names[1] if len(names) > 1 else ""


@pytest.mark.parametrize(("package", "layers"), [("radarize", LAYERS), ("radarsim", SIMULATOR)])
def test_layers(package, layers):
    level = {name: k for k, layer in enumerate(layers) for name in layer.split()}
    unknown = {part(name) for name in imported(package)} - level.keys() - {""}
    assert not unknown, "expected a place in the layers"
    upward, beside = set(), {}
    for name, others in imported(package).items():
        for other in {part(each) for each in others if each.startswith(f"{package}.")} - {part(name), ""}:
            if not part(name):
                continue
            if level[other] > level[part(name)]:
                upward.add(f"{part(name)} -> {other}")
            beside.setdefault(part(name), set()).add(other)
    assert not upward
    assert not cycle(beside)


@pytest.mark.parametrize("package", ["radarize", "radarsim"])
def test_no_circles_of_files(package):
    circle = cycle(imported(package))
    assert not circle, " -> ".join(circle)


def cycle(graph: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_few_rooms():
    """Packages and files of `radarize`, without folders that only hold what an older checkout has compiled."""
    inside = (ROOT / "radarize").iterdir()
    entries = {path.name for path in inside if path.is_file() or (path / "__init__.py").is_file()}
    assert len(entries) <= 14, sorted(entries)


def test_the_pipeline_needs_no_simulator():
    """A user with a real radar needs no ray tracer."""
    tracer = {"radarsim", *EXTRAS["sim"]}
    guilty = {(f, n) for f, names in imported("radarize").items() for n in names if n.split(".")[0] in tracer}
    assert not guilty


def test_the_simulator_takes_only_sensor_and_files_from_the_pipeline():
    def shared(name: str, module: str) -> bool:
        def within(parts: tuple[str, ...]) -> bool:
            return any(f"{module}.".startswith(f"radarize.{each}.") for each in parts)

        parts = (*SHARED, *(OF_TWINS if name.startswith("radarsim.twin.") else ()))
        return within(parts) and not within(APART)

    names = {(f, n) for f, names in imported("radarsim").items() for n in names if n.startswith("radarize.")}
    assert not {(f, n) for f, n in names if not shared(f, n)}


def test_functions_take_at_most_eight():
    """Compiled kernels included, which take named tuples; the command line's options are another matter."""
    found = set()
    for path in (*modules("radarize").values(), *modules("radarsim").values(), *(ROOT / "benchmarks").rglob("*.py")):
        if path.name == "cli.py" or path.parent.name == "cli":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                if len(arguments) - (arguments[:1] in (["self"], ["cls"])) > 8:
                    found.add(f"{path.name}: {node.name}")
    assert not found


def loaded(code: str) -> set[str]:
    """Modules that a fresh interpreter has after some code."""
    command = [sys.executable, "-c", f"{code}\nimport sys\nprint('\\n', *sys.modules, sep='\\n')"]
    return set(subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout.split())


def test_the_pipeline_loads_no_method_and_no_training():
    found = loaded("import radarize.pipeline.pipeline, radarize.evaluation.report.run")
    assert "radarize.pipeline.pipeline" in found
    methods = ("pipeline.classical", "pipeline.networked", "odometry.learned", "odometry.fused", "scans.segmentation")
    apart = (*methods, "baselines", "learning.training", "evaluation.benchmark")
    assert not {name for name in found for each in apart if name.startswith(f"radarize.{each}")}
    assert not found & {"scipy.signal", "scipy.stats", "pandas"}  # a fifth of what a command loads


def test_help_is_quick():
    """The command line alone imports nothing heavy."""
    found = loaded(
        "import sys\nfrom radarize.cli import main\nsys.argv = ['radarize', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass"
    )
    assert "radarize.cli" in found
    assert not found & {"torch", "numpy", "scipy", "numba", "h5py", "gtsam", "matplotlib", "pandas"}


@pytest.mark.parametrize(
    ("call", "home"),
    [
        (r"h5py\.File\((?!.*\"w\")", "hdf5"),
        (r"Image\.open\(", "pixels"),
        (r"np\.load\(|zipfile\.ZipFile\(", "npyfile"),
        (r"yaml\.(safe_)?load\(", "yamlfile"),
    ],
)
def test_what_comes_from_elsewhere_is_opened_in_one_place(call, home):
    """Foreign files are opened only in the modules with the guards."""
    found = {
        path.stem
        for package in ("radarize", "radarsim")
        for path in modules(package).values()
        if any(re.search(call, line) for line in path.read_text().splitlines())
    }
    assert found <= {home}
