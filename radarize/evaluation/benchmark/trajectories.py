"""Tables of trajectory errors, a row a method, by each protocol."""

import pandas as pd

from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.benchmark.table import PAPER, Table

#: What the paper says beside: ATE in m and rad, RE between frames in m.
PAPER_COLUMNS = ("paper: ATE m", "paper: ATE rad", "paper: RE frame m")
GYROSCOPE = "Turns of rnin are those of the IMU's gyroscope, which from frame to frame no radar reaches."
#: By method.
Figures = dict[Pair, tuple[float, ...]]


def trajectory_tables(
    study: Study, trajectory: str, labels: dict[Pair, dict[str, object]], paper: Figures, about: str
) -> list[Table]:
    """A table for each protocol of a study.

    Args:
        study: carried out.
        trajectory: ``odometry`` or ``slam``.
        labels: first columns of a pair's row; pairs that are not in it have none.
        paper: its figures of a pair.
        about: what the titles begin with.
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
    """The paper's columns, empty where it says nothing."""
    return dict(zip(PAPER_COLUMNS, paper or (None,) * len(PAPER_COLUMNS), strict=True))


def split_rows(study: Study, pair: Pair) -> dict[str, pd.DataFrame]:
    """Runs of a pair by split, then those of all."""
    runs = study.of(pair, once=False)
    return {split: runs[runs["split"] == split] for split in study.splits} | {"mean": runs}
