"""Tables with named columns, as Markdown, as JSON and on a page."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

#: Text for a missing value.
NONE = "-"


@dataclass(frozen=True)
class Beside:
    """Published results that are shown beside ours.

    Attributes:
        name: start of the names of their columns or rows.
        of: their data.
        simulated: whether the data is simulated.
    """

    name: str
    of: str
    simulated: bool

    @property
    def sentence(self) -> str:
        return f"{self.name}: {'simulated' if self.simulated else 'real'} {self.of}"


PAPER = Beside(
    "paper", "recordings of its authors, in its own buildings (A. Sie et al., Radarize, MobiSys 2024)", simulated=False
)


@dataclass
class Table:
    """Rows with the same columns.

    Attributes:
        title: heading.
        rows: values by column, numbers or text; None or NaN for a missing value.
        notes: sentences below the table.
        beside: published results that are shown in the table.

    Raises:
        ValueError: the table shows results of the paper, but `beside` lacks them.
    """

    title: str
    rows: list[dict[str, Any]]
    notes: list[str] = field(default_factory=list)
    beside: tuple[Beside, ...] = ()

    def __post_init__(self):
        words = [word for row in self.rows for word in (*row, next(iter(row.values())))]
        if PAPER not in self.beside and any(str(word).startswith(PAPER.name) for word in words):
            raise ValueError(f"{self.title}: shows figures of the {PAPER.name}, expected them in `beside`")

    @property
    def frame(self) -> pd.DataFrame:
        """The rows as a data frame with the columns of the first row."""
        return pd.DataFrame(self.rows, columns=list(self.rows[0]) if self.rows else None, dtype=object)

    def markdown(self, level: int = 2) -> str:
        """Return the table as Markdown, with a heading of a level."""
        if not self.rows:
            return f"{'#' * level} {self.title}\n\nAll runs failed.\n"
        columns = list(self.frame)
        lines = [f"{'#' * level} {self.title}", "", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(map(cell, row)) + " |" for row in self.frame.itertuples(index=False)]
        return "\n".join([*lines, "", *(f"- {note}" for note in self.notes)]) + "\n"

    def in_terminal(self, columns: Sequence[str]) -> tuple[list[str], list[list[str]], range]:
        """Return head, rows and indices of numeric columns for `radarize.io.console.print_table`.

        Args:
            columns: names of the columns: two that identify the row, then numeric ones.
        """
        rows = [[cell(row.get(column)) for column in columns] for row in self.rows]
        return [column.replace("_", " ") for column in columns], rows, range(2, len(columns))

    def numbers(self) -> tuple[int, ...]:
        """Indices of numeric columns."""
        figures = self.frame.map(lambda value: isinstance(value, int | float) and value == value).any()
        return tuple(np.flatnonzero(figures))

    def ahead(self, ours: int, name: str) -> str:
        """Return a sentence on the columns of errors in which a row, called `name`, is not the best of all rows."""
        errors = self.frame.loc[:, [column for column in self.frame if column.startswith(("ATE", "RE"))]].astype(float)
        own, least = errors.loc[ours], errors.drop(index=ours).min()
        behind = [f"{each} ({cell(own[each])}, best {cell(least[each])})" for each in errors.columns[least < own]]
        worse = f"{name} has larger errors than the best method in {', '.join(behind)}."
        return worse if behind else f"{name} has the least error in every column."


def cell(value: object) -> str:
    """Format a value as text."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return NONE
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def with_error(values: pd.Series) -> str:
    """Format mean +- standard error of a metric over walks; a single walk has none."""
    return f"{values.mean():.3f} +- {values.sem():.3f}" if len(values) > 1 else NONE


def with_median(mean: float, median: float) -> str:
    """Format the mean of a ratio, with its median in brackets."""
    return f"{mean:.2f} ({median:.2f})"
