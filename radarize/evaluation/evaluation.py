"""Evaluation of a run against the truth, in Python."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from radarize.evaluation.evaluate import evaluate as figures
from radarize.evaluation.report import words
from radarize.evaluation.report.run import methods
from radarize.pipeline.run import Run

if TYPE_CHECKING:
    import pandas


class Evaluation(Mapping[str, object]):
    """Errors of a run: a mapping with the content of ``metrics.json``, which prints as tables.

    Example:
        >>> print(rz.evaluate("RUN"))
        trajectory ...
        >>> rz.evaluate("RUN")["slam"]["ate"]["position"]["mean"] < 0.2  # m
        True
    """

    def __init__(self, run: Run, reference: Path | None = None):
        self._run, self._figures = run, figures(run.folder, reference)

    def __getitem__(self, name: str) -> object:
        return self._figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._figures)

    def __len__(self) -> int:
        return len(self._figures)

    @property
    def method(self) -> str:
        """Methods of the run."""
        return methods(self._run.folder)

    @property
    def tables(self) -> Iterator[words.PrintedTable | str]:
        """Tables and sentences for a page or a terminal."""
        return words.everything(self._figures)

    def __str__(self) -> str:
        return "\n\n".join(part if isinstance(part, str) else _plain(part) for part in self.tables)

    def _repr_html_(self) -> str:
        return "".join(
            f"<p>{part}</p>" if isinstance(part, str) else _frame(part).to_html(index=False) for part in self.tables
        )

    def to_json(self) -> str:
        """Return the content of ``metrics.json``."""
        return json.dumps(self._figures, indent=2)

    def to_pandas(self) -> "pandas.Series":
        """Return one metric per row, by dotted name: ``slam.ate.position.mean`` in m, ..."""
        import pandas

        return pandas.json_normalize(self._figures).iloc[0]

    def save(self) -> Path:
        """Write ``metrics.json`` into the folder of the run.

        Raises:
            InputError: the file cannot be written.
        """
        self._run.folder.write_metrics(self._figures)
        return self._run.path / "metrics.json"


def evaluate(run: Run | str | Path, *, reference: str | Path | None = None) -> Evaluation:
    """Compare a run with the truth: trajectories (ATE, RE; by evo), map, scans, velocities.

    Args:
        run: result of `run`, or a folder of ``radarize run``.
        reference: TUM file of true poses; by default those of the run, which a simulated recording contains.

    Returns:
        ``slam`` and ``odometry``: errors of the trajectories in m and rad; ``map``, ``scans``, ``velocity`` if their
        truth is known; see `radarize.evaluation.evaluate.evaluate`. ``print`` shows tables.

    Raises:
        InputError: not a run, no truth, or no matching poses.

    Example:
        >>> found = rz.evaluate("RUN")
        >>> {"map", "odometry", "scans", "slam", "velocity"} <= set(found)
        True
        >>> round(float(found.to_pandas()["odometry.distance"]), 1)  # m
        0.4
    """
    return Evaluation(run if isinstance(run, Run) else Run(run), None if reference is None else Path(reference))


def _frame(table: words.PrintedTable) -> "pandas.DataFrame":
    import pandas

    return pandas.DataFrame(table.rows, columns=list(table.head))


def _plain(table: words.PrintedTable) -> str:
    """Format a table as text with aligned columns."""
    rows = [tuple(table.head), *table.rows]
    widths = [max(len(row[k]) for row in rows) for k in range(len(table.head))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
