"""Tables: rows of named values, as Markdown and on a page."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

#: What stands where there is no figure.
NONE = "-"


@dataclass
class Table:
    """Rows of the same columns.

    Attributes:
        title: heading.
        rows: column to value, number or text; None or NaN where there is none.
        notes: sentences below.
    """

    title: str
    rows: list[dict[str, object]]
    notes: list[str] = field(default_factory=list)

    def markdown(self, level: int = 2) -> str:
        """The table as text, with a heading of a level."""
        if not self.rows:
            return f"{'#' * level} {self.title}\n\nNone of it could run.\n"
        columns = list(self.rows[0])
        lines = [f"{'#' * level} {self.title}", "", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(cell(row[column]) for column in columns) + " |" for row in self.rows]
        return "\n".join([*lines, "", *(f"- {note}" for note in self.notes)]) + "\n"

    def numbers(self) -> tuple[int, ...]:
        """Columns that hold figures."""
        columns = list(self.rows[0]) if self.rows else []
        return tuple(
            k for k, column in enumerate(columns) if any(isinstance(row[column], int | float) for row in self.rows)
        )


def cell(value: object) -> str:
    """A value as text."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return NONE
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def mean(values: Sequence[float | None]) -> float:
    """Over those that exist; NaN if none does."""
    known = [value for value in values if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def at(found: dict | None, *path: str) -> float | None:
    """A figure by its place in nested ones; None where it is missing."""
    value: object = found
    for key in path:
        value = value.get(key) if isinstance(value, dict) else None
    return value  # type: ignore[return-value]


def ahead(rows: Sequence[dict[str, object]], ours: int, name: str, columns: Sequence[str]) -> str:
    """A sentence on whether a row, called `name`, has the least value of all rows in some columns."""
    behind = []
    for column in columns:
        own, others = rows[ours][column], [row[column] for k, row in enumerate(rows) if k != ours]
        better = [value for value in others if isinstance(value, float) and value < float(own)]  # type: ignore[arg-type]
        if better:
            behind.append(f"{column} ({cell(own)}, best {cell(min(better))})")
    return f"{name} has the least error in every column." if not behind else f"{name} is behind in {', '.join(behind)}."
