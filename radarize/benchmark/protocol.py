"""How errors of trajectories become one figure: as in the paper (section 6 and its artefact), and its slips mended."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from radarize.benchmark.benchmark import Study
from radarize.benchmark.runs import Pair, Run
from radarize.benchmark.table import at, mean


@dataclass(frozen=True)
class Protocol:
    """A way to compare trajectories.

    Attributes:
        title: what tables call it.
        notes: what it does.
        association: part of `radarize.benchmark.runs.figures` that holds its errors; None: the whole.
        relative: spans that relative errors are shown over.
        by_split: a mean over splits of means over their recordings, in which a recording counts as often as it tests;
            else each recording counts once with each set of networks.
        equal_loops: the back end closes loops for all methods, else for ours alone.
    """

    title: str
    notes: tuple[str, ...]
    association: str | None
    relative: tuple[str, ...]
    by_split: bool
    equal_loops: bool

    def errors(self, study: Study, run: Run, trajectory: str) -> dict[str, float | None]:
        """Figures of one run: columns to values."""
        found = study.results[run]
        found = found[self.association] if self.association else found
        return errors(found[trajectory], self.relative)  # type: ignore[index]

    def average(
        self, study: Study, pair: Pair, trajectory: str, splits: dict[str, list[Run]] | None = None
    ) -> dict[str, float]:
        """Figures of a pair over some splits, by default all: columns to values, NaN where there are none."""
        found = study.of(pair) if splits is None else splits
        parts = list(found.values()) if self.by_split else [list(dict.fromkeys(chain.from_iterable(found.values())))]
        tables = [[self.errors(study, run, trajectory) for run in runs] for runs in parts]
        columns = errors(None, self.relative)
        return {column: mean([mean([row[column] for row in table]) for table in tables]) for column in columns}


def errors(summary: dict | None, relative: Sequence[str]) -> dict[str, float | None]:
    """Columns of a `TrajectoryErrors.summary`: absolute errors, and relative ones over spans."""

    found = {"ATE m": at(summary, "ate", "position", "mean"), "ATE rad": at(summary, "ate", "rotation", "mean")}
    for span in relative:
        found[f"RE {span} m"] = at(summary, "re", span, "position", "mean")
        found[f"RE {span} rad"] = at(summary, "re", span, "rotation", "mean")
    return found


PROTOCOLS = {
    "paper": Protocol(
        "the paper's protocol",
        (
            "The paper's protocol: estimates are compared with the reference's nearest pose within 10 ms after "
            "alignment without scale; mean error of a trajectory, mean over trajectories, mean over splits. RE: "
            "between consecutive frames. Its RE of rotation is no relative error (it follows n / (n + 1) of ATE, a "
            "slip of the evaluation's scripts) and not repeated; its reference was SLAM on depth scans, ours is the "
            "true path.",
        ),
        association="nearest",
        relative=("frame",),
        by_split=True,
        equal_loops=False,
    ),
    "mended": Protocol(
        "slips mended",
        (
            "Slips mended: the reference is interpolated to the estimate's stamps, every recording counts once with "
            "each set of networks, relative errors are true ones over a frame, a second and a metre, and the back end "
            "treats all methods alike.",
        ),
        association=None,
        relative=("frame", "second", "metre"),
        by_split=False,
        equal_loops=True,
    ),
}
