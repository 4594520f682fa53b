"""What is lost where only every second frame is used, as `radarize live` does with networks of turns: the same walks
with all frames and with every second one, with networks and without."""

import argparse
import itertools
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from benchmarks.results import Data, Page, performed, script
from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.table import with_error
from radarize.evaluation.evaluate import evaluate
from radarize.io.jobs import Report
from radarize.io.load import load
from radarize.pipeline.methods import BEST, CLASSICAL
from radarize.pipeline.run import run

PAIRS, EVERY = (Pair(**BEST), Pair(**CLASSICAL)), (1, 2)


class Trial(NamedTuple):
    """A recording by some methods and every so many-th frame."""

    path: Path
    pair: Pair
    every: int

    def __str__(self) -> str:
        return f"{self.path.stem}, {self.pair}, {self.every}"

    def figures(self, _: Report) -> dict[str, float]:
        """Errors (m, rad), and F1 of the map."""
        with tempfile.TemporaryDirectory() as folder:
            found = evaluate(run(load(self.path)[:: self.every], Path(folder) / "run", **asdict(self.pair)).path)
        errors = {name: found[name]["ate"] for name in ("odometry", "slam")}
        return {
            "odometry": errors["odometry"]["position"]["mean"],
            "yaw": errors["odometry"]["rotation"]["mean"],
            "slam": errors["slam"]["position"]["mean"],
            "f1": found["map"]["f1"],
        }


def row(pair: Pair, every: int, found: pd.DataFrame, whole: pd.DataFrame) -> dict[str, object]:
    """Means with standard errors over walks, and by how much they differ from those of all frames."""
    more = found - whole
    apart = {name: with_error(more[name]) if every > 1 else None for name in ("odometry", "slam")}
    return {
        "odometry, scans": f"{pair.odometry}, {pair.scans}",
        "frames": "all" if every == 1 else f"one of {every}",
        "odometry m": with_error(found["odometry"]),
        "more than by all, m": apart["odometry"],
        "odometry rad": found["yaw"].mean(),
        "SLAM m": with_error(found["slam"]),
        "SLAM more than by all, m": apart["slam"],
        "worst SLAM m": found["slam"].max(),
        "map F1 %": 100 * found["f1"].mean(),
    }


@script("Every frame, or every second one", data=(Path, "data set, such as `evaluation`"), workers=(2, "processes"))
def main(options: argparse.Namespace) -> Page:
    paths = [case.path for case in DataSet.load(options.data).cases]
    trials = [Trial(*each) for each in itertools.product(paths, PAIRS, EVERY)]
    found = performed({str(trial): trial.figures for trial in trials}, options.workers, "every")
    kinds = list(itertools.product(PAIRS, EVERY))
    of = {kind: pd.DataFrame(found[k :: len(kinds)]) for k, kind in enumerate(kinds)}
    return Page(
        [row(pair, every, each, of[pair, 1]) for (pair, every), each in of.items()],
        data=Data.of(options.data.name, paths),
        networks=Networks().used(PAIRS[0].networks),
        notes=[
            "Mean errors after alignment, mean over walks +- standard error; differences are walk by walk. "
            "`radarize live` follows every second frame of a radar of 30 Hz with networks, and all frames without.",
        ],
    )
