"""What depends on what."""

import ast
from pathlib import Path

PACKAGES = Path(__file__).parents[1]


def imported(package: str) -> dict[str, set[str]]:
    """Modules that each file of a package imports, anywhere in it."""
    found = {}
    for path in (PACKAGES / package).rglob("*.py"):
        names: set[str] = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module or "")
        found[str(path.relative_to(PACKAGES))] = names
    return found


def test_the_pipeline_needs_no_simulator():
    """A user with a real radar needs no ray tracer."""
    tracer = ("radarsim", "sionna", "mitsuba", "drjit")
    guilty = {f: n for f, names in imported("radarize").items() for n in names if n.split(".")[0] in tracer}
    assert not guilty


def test_the_simulator_takes_only_sensor_and_files_from_the_pipeline():
    files = ("recording", "tum", "yamlfile", "replacing", "errors", "console", "exporters", "jobs")
    modules = ("radar", *files, "heatmaps", "points", "training.maps")
    allowed = {f"radarize.{name}" for name in modules} | {"radarize"}
    # Twins are compared by what the pipeline makes of them, and drawn as runs are.
    judging = ("mapping.scans", "odometry.doppler", "report.drawings", "report.page", "evaluation.runfiles")
    of_twins = {f"radarize.{name}" for name in judging}
    guilty = {
        (f, n)
        for f, names in imported("radarsim").items()
        for n in names
        if n.startswith("radarize") and not (n in allowed or n.startswith("radarize.radar."))
        if not (n in of_twins and f.startswith("radarsim/twin/"))
    }
    assert not guilty
