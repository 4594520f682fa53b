"""How errors of trajectories become one figure: as in the paper (section 6 and its artefact), and its slips mended.

All that a protocol means stands here, for every table: association, means, relative errors, and loop closure.
"""

from dataclasses import dataclass

import pandas as pd

from radarize.evaluation.benchmark.runs import Pair

#: Odometry of the paper's method, as published, re-implemented and improved: what the others are compared with.
OURS = ("fused", "learned", "published")


@dataclass(frozen=True)
class Protocol:
    """A way to compare trajectories.

    Attributes:
        title: what tables call it.
        note: what it does.
        association: part of `runs.figures` that holds its errors, with a dot; "": the whole.
        relative: spans that relative errors are shown over.
        by_split: a mean over splits of means over their recordings, in which a recording counts as often as it tests;
            else each recording counts once with each set of networks.
        closing: odometry whose loops the back end closes; empty: all.
    """

    title: str
    note: str
    association: str
    relative: tuple[str, ...]
    by_split: bool
    closing: tuple[str, ...] = ()

    @property
    def loops(self) -> str:
        """Whose loops are closed, as a sentence."""
        if not self.closing:
            return "One back end with the same settings for all."
        return f"Loops are closed for {', '.join(self.closing)} alone: the paper's baselines ran without."

    def columns(self, pair: Pair, trajectory: str) -> dict[str, str]:
        """Columns of a table to paths of figures, of a trajectory: ``odometry`` or ``slam``."""
        if trajectory == "slam" and self.closing and pair.odometry not in self.closing:
            trajectory = "open"
        found = {"ATE m": "ate.position", "ATE rad": "ate.rotation"}
        for span in self.relative:
            found |= {f"RE {span} m": f"re.{span}.position", f"RE {span} rad": f"re.{span}.rotation"}
        return {name: f"{self.association}{trajectory}.{path}.mean" for name, path in found.items()}

    def average(self, runs: pd.DataFrame, pair: Pair, trajectory: str) -> dict[str, float]:
        """Figures of a pair over some of its runs (rows of `Study.of`, once a split): columns to values, or NaN."""
        columns = self.columns(pair, trajectory)
        figures = figures_of(runs, columns)
        if self.by_split:
            return figures.groupby(runs["split"]).mean().mean().reindex(columns).to_dict()
        return figures[~runs["run"].duplicated()].mean().to_dict()


def figures_of(runs: pd.DataFrame, columns: dict[str, str]) -> pd.DataFrame:
    """Columns of a table, of paths in `Study.of`; NaN where there are none."""
    return runs.reindex(columns=list(columns.values())).set_axis(list(columns), axis=1).astype(float)


PROTOCOLS = {
    "paper": Protocol(
        "the paper's protocol",
        "The paper's protocol: estimates are compared with the reference's nearest pose within 10 ms after alignment "
        "without scale; mean error of a trajectory, mean over trajectories, mean over splits. RE: between consecutive "
        "frames. Its RE of rotation is no relative error (it follows n / (n + 1) of ATE, a slip of the evaluation's "
        "scripts) and not repeated; its reference was SLAM on depth scans, ours is the true path.",
        association="nearest.",
        relative=("frame",),
        by_split=True,
        closing=OURS,
    ),
    "mended": Protocol(
        "slips mended",
        "Slips mended: the reference is interpolated to the estimate's stamps, every recording counts once with each "
        "set of networks, relative errors are true ones over a frame, a second and a metre, and the back end treats "
        "all methods alike.",
        association="",
        relative=("frame", "second", "metre"),
        by_split=False,
    ),
}
