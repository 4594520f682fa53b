"""Curves of figures over what was varied: the severity of multipath, or a parameter of the radar."""

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
) -> Figure:
    """Figures over what was varied: a row of axes for each figure, a column for each panel, means where rows are alike.

    Args:
        rows: of a table; each has `names` and the following.
        over: key of the abscissa: numbers, or names, which stand in their order.
        panel: key of what has axes of its own.
        line: key of what has a line of its own.
        names: figures, of `FIGURES`.

    Returns:
        The matplotlib figure.
    """
    table = pd.DataFrame(rows)
    panels, lines = table[panel].unique(), table[line].unique()
    figure, axes = canvas(len(panels), len(names), width=2.4 * len(panels) + 1.2, height=2.1)
    for axis_row, name in zip(axes, names, strict=True):
        figure_of = FIGURES[name]
        for axis, (place, here) in zip(axis_row, table.groupby(panel, sort=False), strict=True):
            values = here[over].unique()
            number = all(isinstance(value, (int, float)) for value in values.tolist())
            at = {value: float(value) if number else k for k, value in enumerate(values)}
            for k, label in enumerate(lines):
                means = here[here[line] == label].groupby(over)[name].mean().dropna().rename(at).sort_index()
                axis.plot(means.index, figure_of.factor * means, "o-", ms=3.5, lw=1.4, color=f"C{k}", label=label)
            axis.set_xticks(list(at.values()), [f"{value:.4g}" if isinstance(value, float) else value for value in at])
            axis.grid(alpha=0.25)
            axis.label_outer()
            if name == names[0]:
                axis.set_title(place)
        top = max(axis.dataLim.y1 for axis in axis_row)
        for axis in axis_row:
            axis.set_ylim(0, 1.06 * top if np.isfinite(top) and top > 0 else 1)
        axis_row[0].set_ylabel(f"{figure_of.words},\n{figure_of.unit}")
    for axis in axes[-1]:
        axis.set_xlabel(over)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(lines), frameon=False)
    return figure
