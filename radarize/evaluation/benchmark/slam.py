"""Benchmarks of SLAM by combinations of odometry and scans: the paper's table 4, and its table 5 by building."""

from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import PAPER, Table
from radarize.evaluation.benchmark.trajectories import Figures, beside, split_rows, trajectory_tables
from radarize.pipeline.methods import BEST

#: The paper's combinations: ATE, m and rad; RE between frames, m. The paper's RadarHD alone is scan matching here.
COMBINATIONS: Figures = {
    Pair("scan-matching", "radarhd"): (4.833, 0.751, 0.045),
    Pair("milliego", "radarhd"): (3.900, 0.808, 0.022),
    Pair("rnin", "radarhd"): (3.299, 0.541, 0.020),
    Pair(BEST["odometry"], "radarhd"): (0.658, 0.154, 0.018),
    Pair(**BEST): (0.606, 0.116, 0.017),
}
#: Errors of the paper's method in buildings that it was not trained in, and their mean.
BUILDINGS = {
    "A": (0.635, 0.102, 0.018), "B": (0.696, 0.179, 0.016), "C": (0.492, 0.105, 0.016), "mean": (0.608, 0.129, 0.017),
}  # fmt: skip


def pairs(chosen: Chosen) -> list[Pair]:
    """Return the paper's combinations, all odometry with the default scans, and all scans with the default odometry."""
    paper = [pair for pair in COMBINATIONS if pair.odometry in chosen.odometry and pair.scans in chosen.scans]
    return [*paper, *chosen.by_odometry(), *chosen.by_scans()]


def tables(study: Study) -> list[Table]:
    """Return tables of the trajectory errors of SLAM by each protocol."""
    label: dict[Pair, dict[str, object]] = {
        pair: {"odometry": pair.odometry, "scans": pair.scans} for pair in study.pairs
    }
    return trajectory_tables(study, "slam", label, COMBINATIONS, "SLAM")


def building_tables(study: Study) -> list[Table]:
    """Return tables of SLAM errors by building and their mean, for all odometry, by each protocol."""
    found = []
    for protocol in study.options.protocols:
        rows = []
        for pair in study.pairs:
            for split, runs in split_rows(study, pair).items():
                building = split.removeprefix("building-")
                label = {"odometry": pair.odometry, "scans": pair.scans, "building": building}
                paper = BUILDINGS.get(building) if pair == Pair(**BEST) else None
                rows.append({**label, **protocol.average(runs, pair, "slam"), **beside(paper)})
        notes = [
            protocol.note,
            protocol.loops,
            "Buildings are those of this data set, not those of the paper with the same letter.",
        ]
        found.append(Table(f"SLAM in each building, {protocol.title}", rows, notes, (PAPER,)))
    return found
