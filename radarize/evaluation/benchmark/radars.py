"""The same networks on several radars: walks that all of them see alike (data set `radars`)."""

import pandas as pd

from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import Table, with_error
from radarize.pipeline.methods import BEST, CLASSICAL, best_methods

#: Attribute that says which radar saw a recording.
CHIRPS = "chirps"
#: Columns with means and their standard errors over walks, and columns with means in %, by paths of `Study.of`.
MEANS = {
    "odometry m": "odometry.ate.position.mean",
    "odometry rad": "odometry.ate.rotation.mean",
    "SLAM m": "slam.ate.position.mean",
}
SHARES = {"map F1 %": "map.f1", "returned %": "scans.returned", "within 10 cm %": "scans.within_10cm"}
NOTES = (
    "Every walk is made once for each radar, with the same seed and scatterers. Means over walks and their standard "
    "errors. Returned: of bearings with a surface in the radar's reach, so the farther a radar sees, the more it has "
    "to return. Within 10 cm: of returned bearings.",
    "chosen: what `radarize run` takes for that radar if nothing is asked for.",
)


def pairs(chosen: Chosen) -> list[Pair]:
    """Neither with networks, scans alone, and both; or what was asked for instead."""
    without, best = Pair(**CLASSICAL), Pair(**BEST)
    usual = dict.fromkeys([without, Pair(without.odometry, best.scans), best])
    wanted = [pair for pair in usual if pair.odometry in chosen.odometry and pair.scans in chosen.scans]
    return wanted or chosen.by_odometry()


def lacks(data: DataSet) -> str:
    """What a data set must have and has not: recordings that say which radar it was."""
    if any(CHIRPS in case.attributes for case in data.cases):
        return ""
    return f"no recording has an attribute {CHIRPS}, expected a data set such as that of `radarsim dataset radars`"


def tables(study: Study) -> list[Table]:
    """Figures by radar and pair of methods."""
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
