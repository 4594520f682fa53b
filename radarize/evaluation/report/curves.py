"""Plots of metrics over a varied quantity: the severity of multipath, or a parameter of the radar."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from radarize.evaluation.report.drawings import canvas
from radarize.evaluation.stress import FIGURES


def curves(
    rows: Sequence[Mapping[str, object]],
    over: str = "severity",
    panel: str = "stress",
    line: str = "scans",
    names: Sequence[str] = ("ghosts", "missed", "map_f1", "odometry"),
    quantities: Mapping[str, tuple[str, float]] | None = None,
) -> Figure:
    """Plot metrics over a varied quantity: a row of axes for each metric, a column for each panel. Rows of the table
    with equal keys are averaged.

    Args:
        rows: rows of a table with the columns `names`, `over`, `panel` and `line`.
        over: column of the abscissa: numbers, or names in the order of the rows.
        panel: column with a value for each column of axes.
        line: column with a value for each line.
        names: names of metrics in `FIGURES`.
        quantities: by panel, label of the abscissa with its unit and factor from the values to that unit; by default
            the name of `over`.

    Returns:
        The matplotlib figure.
    """
    table = pd.DataFrame(rows)
    panels, lines = table[panel].unique(), table[line].unique()
    figure, axes = canvas(len(panels), len(names), width=2.4 * len(panels) + 1.2, height=2.1)
    for axis_row, name in zip(axes, names, strict=True):
        figure_of = FIGURES[name]
        for axis, (place, here) in zip(axis_row, table.groupby(panel, sort=False), strict=True):
            label, factor = (quantities or {}).get(str(place), (over, 1.0))
            values = here[over].unique()
            number = all(isinstance(value, (int, float)) for value in values.tolist())
            at = {value: factor * float(value) if number else k for k, value in enumerate(values)}
            for k, method in enumerate(lines):
                means = here[here[line] == method].groupby(over)[name].mean().dropna().rename(at).sort_index()
                axis.plot(means.index, figure_of.factor * means, "o-", ms=3.5, lw=1.4, color=f"C{k}", label=method)
            axis.set_xticks(list(at.values()), [f"{at[value]:.4g}" if number else value for value in at])
            axis.set_xlabel(label)
            axis.grid(alpha=0.25)
            axis.label_outer()
            if name == names[0]:
                axis.set_title(place)
        top = 1.06 * max(axis.dataLim.y1 for axis in axis_row)
        for axis in axis_row:
            axis.set_ylim(0, (min(top, 100) if "%" in figure_of.unit else top) if np.isfinite(top) and top > 0 else 1)
        axis_row[0].set_ylabel(f"{figure_of.words},\n{figure_of.unit}")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(lines), frameon=False)
    return figure
