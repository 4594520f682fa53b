"""Evaluation protocols for trajectories: that of the paper (section 6 and its artefact), and a corrected one.

A protocol defines association, averages, relative errors and loop closure for all tables.
"""

from dataclasses import dataclass

import pandas as pd

from radarize.evaluation.benchmark.runs import Pair

#: Odometry of the paper's method: improved, re-implemented, and as published.
OURS = ("fused", "learned", "published")


@dataclass(frozen=True)
class Protocol:
    """A protocol of trajectory errors.

    Attributes:
        title: name in titles of tables.
        note: description.
        association: prefix of its errors in `runs.figures`, with a dot; empty for the top level.
        relative: spans of the relative errors.
        by_split: average over splits of averages over their recordings, so that a recording counts once per split in
            which it is tested; else each recording counts once with each set of networks.
        closing: methods of odometry with loop closure; empty: all.
    """

    title: str
    note: str
    association: str
    relative: tuple[str, ...]
    by_split: bool
    closing: tuple[str, ...] = ()

    @property
    def loops(self) -> str:
        """Sentence on the methods of odometry with loop closure."""
        if not self.closing:
            return "One back end with the same settings for all."
        return f"Loop closure for {', '.join(self.closing)} only, because the paper's baselines have none."

    def columns(self, pair: Pair, trajectory: str) -> dict[str, str]:
        """Return the columns of a table, and the paths of their metrics, for a trajectory: ``odometry`` or ``slam``."""
        if trajectory == "slam" and self.closing and pair.odometry not in self.closing:
            trajectory = "open"
        found = {"ATE m": "ate.position", "ATE rad": "ate.rotation"}
        for span in self.relative:
            found |= {f"RE {span} m": f"re.{span}.position", f"RE {span} rad": f"re.{span}.rotation"}
        return {name: f"{self.association}{trajectory}.{path}.mean" for name, path in found.items()}

    def average(self, runs: pd.DataFrame, pair: Pair, trajectory: str) -> dict[str, float]:
        """Average the metrics of a pair over runs (rows of `Study.of`, once per split): values by column, or NaN."""
        columns = self.columns(pair, trajectory)
        figures = figures_of(runs, columns)
        if self.by_split:
            return figures.groupby(runs["split"]).mean().mean().reindex(columns).to_dict()
        return figures[~runs["run"].duplicated()].mean().to_dict()


def figures_of(runs: pd.DataFrame, columns: dict[str, str]) -> pd.DataFrame:
    """Select the columns of a table by their paths in `Study.of`; NaN for missing metrics."""
    return runs.reindex(columns=list(columns.values())).set_axis(list(columns), axis=1).astype(float)


PROTOCOLS = {
    "paper": Protocol(
        "the paper's protocol",
        "The paper's protocol: estimates are compared with the reference's nearest pose within 10 ms, after alignment "
        "without scale; mean error of a trajectory, mean over trajectories, mean over splits. RE: between consecutive "
        "frames. The paper's RE of rotation is not a relative error (its scripts compute n / (n + 1) of ATE) and is "
        "not repeated. The paper's reference is SLAM on depth scans; ours is the true trajectory.",
        association="nearest.",
        relative=("frame",),
        by_split=True,
        closing=OURS,
    ),
    "corrected": Protocol(
        "corrected protocol",
        "Corrected protocol: the reference is interpolated at the time stamps of the estimate, every recording counts "
        "once with each set of networks, relative errors are over a frame, a second and a metre, and all methods have "
        "loop closure.",
        association="",
        relative=("frame", "second", "metre"),
        by_split=False,
    ),
}
