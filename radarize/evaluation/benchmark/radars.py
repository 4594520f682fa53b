"""Benchmark of the same networks on several radars, on the same walks (data set `radars`)."""

import pandas as pd

from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import Table, with_error
from radarize.pipeline.methods import BEST, CLASSICAL, best_methods

#: Attribute of a recording with the name of its radar.
CHIRPS = "chirps"
#: Columns with means +- standard errors over walks, and columns with means in %: paths of the metrics in `Study.of`.
MEANS = {
    "odometry m": "odometry.ate.position.mean",
    "odometry rad": "odometry.ate.rotation.mean",
    "SLAM m": "slam.ate.position.mean",
}
SHARES = {"map F1 %": "map.f1", "returned %": "scans.returned", "within 10 cm %": "scans.within_10cm"}
NOTES = (
    "Every walk is simulated once for each radar, with the same seed and scatterers. odometry m, odometry rad, SLAM m: "
    "mean ATE +- standard error over walks. returned %: of bearings with a surface within the radar's maximum range, "
    "which is larger for long-range radars. within 10 cm %: of bearings with a return.",
    "chosen: default methods of `radarize run` for the radar.",
)


def pairs(chosen: Chosen) -> list[Pair]:
    """Return pairs of methods: both without networks, scans with a network, and both with networks; or the requested
    ones."""
    without, best = Pair(**CLASSICAL), Pair(**BEST)
    usual = dict.fromkeys([without, Pair(without.odometry, best.scans), best])
    wanted = [pair for pair in usual if pair.odometry in chosen.odometry and pair.scans in chosen.scans]
    return wanted or chosen.by_odometry()


def lacks(data: DataSet) -> str:
    """Return a sentence if no recording of a data set has the name of its radar; else an empty string."""
    if any(CHIRPS in case.attributes for case in data.cases):
        return ""
    return f"no recording has an attribute {CHIRPS}, expected a data set such as that of `radarsim dataset radars`"


def tables(study: Study) -> list[Table]:
    """Return the table of metrics by radar and pair of methods."""
    radars = {case.attributes[CHIRPS]: case.config for case in study.data.cases if CHIRPS in case.attributes}
    found = {pair: study.of(pair) for pair in study.pairs}
    rows = []
    for radar, config in radars.items():
        best = Pair(**best_methods(config)[0])
        for pair, runs in found.items():
            mine = runs[[run.case.attributes.get(CHIRPS) == radar for run in runs["run"]]]
            about = {"radar": radar, "odometry by": pair.odometry, "scans": pair.scans}
            rows.append(about | {"chosen": "yes" if pair == best else "", "walks": len(mine)} | _figures(mine))
    return [Table("By radar", rows, list(NOTES))]


def _figures(runs: pd.DataFrame) -> dict[str, object]:
    means, shares = figures_of(runs, MEANS), 100 * figures_of(runs, SHARES)
    return {name: with_error(values) for name, values in means.items()} | shares.mean().to_dict()
