"""Tables: named columns, as Markdown, as JSON and on a page."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

#: What stands where there is no figure.
NONE = "-"


@dataclass(frozen=True)
class Beside:
    """Figures of other people, which stand beside ours.

    Attributes:
        name: that their columns or rows begin with.
        of: what they are of.
        simulated: or real.
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
    """Rows of the same columns.

    Attributes:
        title: heading.
        rows: column to value, number or text; None or NaN where there is none.
        notes: sentences below.
        beside: whose figures stand beside ours.

    Raises:
        ValueError: figures of the paper of which it does not say what they are of.
    """

    title: str
    rows: list[dict[str, Any]]
    notes: list[str] = field(default_factory=list)
    beside: tuple[Beside, ...] = ()

    def __post_init__(self):
        words = [word for row in self.rows for word in (*row, next(iter(row.values())))]
        if PAPER not in self.beside and any(str(word).startswith(PAPER.name) for word in words):
            raise ValueError(f"{self.title}: shows figures of the {PAPER.name}, expected `beside` to say so")

    @property
    def frame(self) -> pd.DataFrame:
        """The same, with the columns of the first row."""
        return pd.DataFrame(self.rows, columns=list(self.rows[0]) if self.rows else None, dtype=object)

    def markdown(self, level: int = 2) -> str:
        """The table as text, with a heading of a level."""
        if not self.rows:
            return f"{'#' * level} {self.title}\n\nNone of it could run.\n"
        columns = list(self.frame)
        lines = [f"{'#' * level} {self.title}", "", "| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(map(cell, row)) + " |" for row in self.frame.itertuples(index=False)]
        return "\n".join([*lines, "", *(f"- {note}" for note in self.notes)]) + "\n"

    def in_terminal(self, columns: Sequence[str]) -> tuple[list[str], list[list[str]], range]:
        """Head, rows and columns of figures, of the named columns, as `radarize.io.console.print_table` takes them.

        Args:
            columns: names; what says which row it is, then figures from the third on.
        """
        rows = [[cell(row.get(column)) for column in columns] for row in self.rows]
        return [column.replace("_", " ") for column in columns], rows, range(2, len(columns))

    def numbers(self) -> tuple[int, ...]:
        """Columns that hold figures."""
        figures = self.frame.map(lambda value: isinstance(value, int | float) and value == value).any()
        return tuple(np.flatnonzero(figures))

    def ahead(self, ours: int, name: str) -> str:
        """A sentence on whether a row, called `name`, has the least error of all rows."""
        errors = self.frame.loc[:, [column for column in self.frame if column.startswith(("ATE", "RE"))]].astype(float)
        own, least = errors.loc[ours], errors.drop(index=ours).min()
        behind = [f"{each} ({cell(own[each])}, best {cell(least[each])})" for each in errors.columns[least < own]]
        return f"{name} is behind in {', '.join(behind)}." if behind else f"{name} has the least error in every column."


def cell(value: object) -> str:
    """A value as text."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return NONE
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def with_error(values: pd.Series) -> str:
    """Mean of a figure over walks +- its standard error; of a single walk there is none."""
    return f"{values.mean():.3f} +- {values.sem():.3f}" if len(values) > 1 else NONE


def with_median(mean: float, median: float) -> str:
    """Mean of a ratio, in brackets its median."""
    return f"{mean:.2f} ({median:.2f})"
