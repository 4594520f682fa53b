"""SLAM by combinations of odometry and scans: the paper's table 4, and its table 5 building by building."""

from radarize.benchmark.benchmark import Chosen, Study
from radarize.benchmark.protocol import PROTOCOLS
from radarize.benchmark.runs import Pair
from radarize.benchmark.table import Table
from radarize.benchmark.trajectories import PAPER_COLUMNS, trajectory_tables
from radarize.methods.registry import BEST

#: The paper's combinations: ATE in m and rad, RE between frames in m. RadarHD alone is scan matching on its scans.
PAPER = {
    Pair("scan-matching", "radarhd"): (4.833, 0.751, 0.045),
    Pair("milliego", "radarhd"): (3.900, 0.808, 0.022),
    Pair("rnin", "radarhd"): (3.299, 0.541, 0.020),
    Pair(BEST["odometry"], "radarhd"): (0.658, 0.154, 0.018),
    Pair(**BEST): (0.606, 0.116, 0.017),
}
#: The same of its own method in a building that it was not trained in.
PAPER_BUILDINGS = {"A": (0.635, 0.102, 0.018), "B": (0.696, 0.179, 0.016), "C": (0.492, 0.105, 0.016)}
PAPER_MEAN = (0.608, 0.129, 0.017)


def pairs(chosen: Chosen) -> list[Pair]:
    """The paper's combinations, every odometry with the scans of choice, and all scans with the odometry of choice."""
    paper = [pair for pair in PAPER if pair.odometry in chosen.odometry and pair.scans in chosen.scans]
    return [
        *paper,
        *(Pair(odometry, chosen.partner.scans) for odometry in chosen.odometry),
        *(Pair(chosen.partner.odometry, scans) for scans in chosen.scans),
    ]


def tables(study: Study) -> list[Table]:
    """SLAM's trajectories by each protocol."""
    label = {pair: {"odometry": pair.odometry, "scans": pair.scans} for pair in study.pairs}
    found = trajectory_tables(study, "slam", label, PAPER, "SLAM")
    for table, name in zip(found, study.protocols, strict=True):
        table.notes.append(
            "One back end with the same settings for all."
            if PROTOCOLS[name].equal_loops
            else "Loops are closed for our odometry alone: the paper's baselines ran without."
        )
    return found


def building_pairs(chosen: Chosen) -> list[Pair]:
    """Every odometry with the scans of choice."""
    return [Pair(odometry, chosen.partner.scans) for odometry in chosen.odometry]


def building_tables(study: Study) -> list[Table]:
    """Each building, then their mean, for every odometry by each protocol."""
    found = []
    for name in study.protocols:
        protocol, rows = PROTOCOLS[name], []
        for pair in study.pairs:
            which = "slam" if protocol.equal_loops or pair == study.chosen.partner else "open"
            for split, runs in [*((split, {split: runs}) for split, runs in study.of(pair).items()), ("mean", None)]:
                building = split.removeprefix("building-")
                figures = protocol.average(study, pair, which, runs)
                paper = PAPER_MEAN if building == "mean" else PAPER_BUILDINGS.get(building)
                paper = paper if pair == Pair(**BEST) and paper else (None,) * len(PAPER_COLUMNS)
                label = {"odometry": pair.odometry, "scans": pair.scans, "building": building}
                rows.append({**label, **figures, **dict(zip(PAPER_COLUMNS, paper, strict=True))})
        notes = [*protocol.notes, "Buildings are this data set's, not those of the paper that go by the same letter."]
        found.append(Table(f"SLAM in each building, {protocol.title}", rows, notes))
    return found
