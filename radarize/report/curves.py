"""Curves of figures over what was varied: the severity of multipath, or a parameter of the radar."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarize.evaluation.stress import FIGURES
from radarize.report.drawings import canvas


def curves(
    rows: Sequence[Mapping[str, object]],
    over: str = "severity",
    panel: str = "stress",
    line: str = "scans",
    names: Sequence[str] = ("ghosts", "missed", "map_f1", "odometry"),
):
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
    panels, lines = (list(dict.fromkeys(row[key] for row in rows)) for key in (panel, line))
    figure, axes = canvas(len(panels), len(names), width=2.4 * len(panels) + 1.2, height=2.1)
    for axis_row, name in zip(axes, names, strict=True):
        words, unit, factor = FIGURES[name]
        for axis, place in zip(axis_row, panels, strict=True):
            here = [row for row in rows if row[panel] == place]
            at = _abscissa([row[over] for row in here])
            for number, label in enumerate(lines):
                points: dict[float, list[float]] = {}
                for row in here:
                    if row[line] == label and row[name] is not None:
                        points.setdefault(at[row[over]], []).append(float(row[name]))
                x = sorted(points)
                y = [factor * float(np.mean(points[k])) for k in x]
                axis.plot(x, y, "o-", ms=3.5, lw=1.4, color=f"C{number}", label=label)
            axis.set_xticks(list(at.values()), [f"{value:.4g}" if isinstance(value, float) else value for value in at])
            axis.grid(alpha=0.25)
            axis.label_outer()
        top = max(axis.dataLim.y1 for axis in axis_row)
        for axis in axis_row:
            axis.set_ylim(0, 1.06 * top if np.isfinite(top) and top > 0 else 1)
        axis_row[0].set_ylabel(f"{words},\n{unit}")
    for axis, place in zip(axes[0], panels, strict=True):
        axis.set_title(place)
    for axis in axes[-1]:
        axis.set_xlabel(over)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(lines), frameon=False)
    return figure


def _abscissa(values: Sequence[object]) -> dict[object, float]:
    """Where values stand: numbers at themselves, names one after the other."""
    distinct = dict.fromkeys(values)
    if all(isinstance(value, (int, float)) for value in distinct):
        return {value: float(value) for value in sorted(distinct)}
    return {value: float(k) for k, value in enumerate(distinct)}
