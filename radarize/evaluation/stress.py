"""What a run makes of echoes that come from no first surface, figure by figure, and how that changes with severity.

A wrong return is one more than 10 cm off the first surface on its bearing. What it comes from is the strongest cause of
its cell, which a simulated recording knows (``radarsim simulate --sensors ghosts``).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.evaluation.drawings import canvas
from radarize.evaluation.mapping import TOLERANCE
from radarize.evaluation.scans import wrong_by_cause
from radarize.recording import Recording

#: What wrong returns come from, by labels of /truth/cause.
SOURCES = {
    "ghosts": ("ghost_1", "ghost_2", "ghost_3"),
    "behind": ("through_slab",),
    "moving": ("moving",),
    "clutter": ("direct", "floor_ceiling"),
    "noise": ("leakage", "noise"),
}
#: Figures by name: words, unit, factor.
FIGURES = {
    "ghosts": ("ghosts", "% of returns", 100),
    "behind": ("seen through a slab", "% of returns", 100),
    "moving": ("ghosts and skirts of what moves", "% of returns", 100),
    "clutter": ("direct echoes beside, above, below", "% of returns", 100),
    "noise": ("noise and leakage", "% of returns", 100),
    "missed": ("missed surfaces", "% of bearings", 100),
    "map_f1": ("map F1", "%", 100),
    "matching": ("ATE of scan matching", "m", 1),
    "odometry": ("odometry ATE", "m", 1),
    "slam": ("SLAM ATE", "m", 1),
}


def missed(measured: Float[np.ndarray, "scan beam"], true: Float[np.ndarray, "scan beam"]) -> float:
    """Share of bearings with a surface in reach that return nothing at it or before it: it does not exist for them.

    Args:
        measured: ranges, m; not finite, or 0, where nothing was returned.
        true: ranges, m; inf where there is no surface in reach.

    Returns:
        The share, a return within 10 cm behind the surface counting as at it; NaN without surfaces.
    """
    reach = np.isfinite(true)
    seen = np.isfinite(measured) & (measured > 0) & (measured <= true + TOLERANCE)
    return float(1 - seen[reach].mean()) if reach.any() else np.nan


def sources(scans: Mapping[str, np.ndarray], true: Float[np.ndarray, "scan beam"], recording: Path) -> dict[str, float]:
    """Shares of returned bearings that are wrong, by `SOURCES`; empty where the recording does not know.

    Args:
        scans: of a run, as `read_scans` gives them.
        true: ranges on the same bearings, m.
        recording: that the run was made of.

    Raises:
        InputError: unreadable recording.
    """
    with Recording(recording) as source:
        if not source.has("truth/cause") or not source.labels("truth/cause"):
            return {}
        frames = np.searchsorted(source.times, scans["time"]) - 1  # a scan's instant is in the middle of its burst
        axes = source.read("truth/cause_ranges"), source.read("truth/cause_azimuths")
        cause, names = source.read("truth/cause")[frames], source.labels("truth/cause")
    wrong = wrong_by_cause(scans["ranges"], true, scans["azimuths"], cause, *axes, names)
    return {source: sum(wrong[name] for name in names) for source, names in SOURCES.items()}


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
