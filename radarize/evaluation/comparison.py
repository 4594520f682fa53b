"""Runs of one recording beside each other: methods by their figures."""

from collections.abc import Sequence
from pathlib import Path

from radarize.evaluation.evaluate import assess
from radarize.runfolder import RunFolder

#: Columns: heading, unit, factor, and where the number stands in the metrics.
COLUMNS = (
    ("velocity RMSE", "m/s", 1.0, ("velocity", "rmse")),
    ("odometry ATE", "m", 1.0, ("odometry", "ate", "position", "mean")),
    ("odometry ATE", "rad", 1.0, ("odometry", "ate", "rotation", "mean")),
    ("SLAM ATE", "m", 1.0, ("slam", "ate", "position", "mean")),
    ("SLAM ATE", "rad", 1.0, ("slam", "ate", "rotation", "mean")),
    ("bearings within 10 cm", "%", 100.0, ("scans", "within_10cm")),
    ("map F1", "%", 100.0, ("map", "f1")),
)


def compare(runs: Sequence[Path], reference: Path | None = None) -> list[tuple[str, ...]]:
    """A row for each run: its methods, then `COLUMNS`, as text; - where a run does not know. Nothing is written.

    Raises:
        InputError: not a run, no truth, or nothing that matches.
    """
    return [(methods(run), *_figures(assess(run, reference))) for run in map(RunFolder, runs)]


def methods(run: RunFolder) -> str:
    """What a run was made with, in short."""
    used = run.methods
    return " + ".join(used[name] for name in ("odometry", "scans") if name in used) or run.path.name


def _figures(metrics: dict) -> list[str]:
    found = []
    for _, unit, factor, path in COLUMNS:
        value: object = metrics
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        found.append("-" if value is None else f"{factor * float(value):.3g} {unit}")  # type: ignore[arg-type]
    return found


def show(rows: list[tuple[str, ...]]) -> None:
    """Print what `compare` returned."""
    from rich.console import Console
    from rich.table import Column, Table

    table = Table("method", *(Column(name, justify="right") for name, *_ in COLUMNS), header_style="bold")
    for row in rows:
        table.add_row(*row)
    Console().print(table)
