"""Tables of trajectory errors by method, for each protocol."""

import pandas as pd

from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.benchmark.table import PAPER, Table

#: Columns of the paper's results: ATE, m and rad; RE between frames, m.
PAPER_COLUMNS = ("paper: ATE m", "paper: ATE rad", "paper: RE frame m")
GYROSCOPE = "Yaw of rnin is from the IMU's gyroscope, whose error from frame to frame is below that of any radar."
#: Results by pair of methods.
Figures = dict[Pair, tuple[float, ...]]


def trajectory_tables(
    study: Study, trajectory: str, labels: dict[Pair, dict[str, object]], paper: Figures, about: str
) -> list[Table]:
    """Return a table for each protocol of a study.

    Args:
        study: study that has run.
        trajectory: ``odometry`` or ``slam``.
        labels: first columns of the rows, by pair; other pairs have no row.
        paper: the paper's results by pair.
        about: start of the titles.
    """
    pairs, found = list(labels), []
    runs = {pair: study.of(pair, once=False) for pair in pairs}
    for protocol in study.options.protocols:
        rows = []
        for pair, label in labels.items():
            figures = protocol.average(runs[pair], pair, trajectory)
            rows.append({**label, "recordings": runs[pair]["run"].nunique(), **figures, **beside(paper.get(pair))})
        table = Table(f"{about}, {protocol.title}", rows, [protocol.note], (PAPER,))
        if study.chosen.partner in pairs and len(pairs) > 1:
            ours = pairs.index(study.chosen.partner)
            table.notes.append(table.ahead(ours, " + ".join(map(str, labels[pairs[ours]].values()))))
        if any(pair.odometry == "rnin" for pair in pairs):
            table.notes.append(GYROSCOPE)
        if trajectory == "slam":
            table.notes.append(protocol.loops)
        found.append(table)
    return found


def beside(paper: tuple[float, ...] | None) -> dict[str, float | None]:
    """Return the columns of the paper's results; None if it has none."""
    return dict(zip(PAPER_COLUMNS, paper or (None,) * len(PAPER_COLUMNS), strict=True))


def split_rows(study: Study, pair: Pair) -> dict[str, pd.DataFrame]:
    """Return the runs of a pair by split, then all runs."""
    runs = study.of(pair, once=False)
    return {split: runs[runs["split"] == split] for split in study.splits} | {"mean": runs}
