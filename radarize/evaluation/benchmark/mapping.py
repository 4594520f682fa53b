"""Benchmark of scans: errors of all methods, path types of wrong returns, and maps of SLAM with these scans."""

import pandas as pd

from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.benchmark.table import Table
from radarize.evaluation.stress import FIGURES, SOURCES

#: Columns of the table: path of the metric in `Study.of`, and its factor.
COLUMNS = {
    "within 10 cm %": ("scans.within_10cm", 100),
    "or of a bearing beside %": ("scans.beside", 100),
    "returned %": ("scans.returned", 100),
    "through a wall %": ("scans.through", 100),
    "ghosts left %": ("sources.ghosts", 100),
    "too near %": ("scans.short", 100),
    "map F1 %": ("map.f1", 100),
    "Chamfer m": ("map.chamfer", 1),
    "free IoU %": ("map.free_iou", 100),
    "SLAM ATE m": ("slam.ate.position.mean", 1),
    "SLAM ATE rad": ("slam.ate.rotation.mean", 1),
}
NOTES = (
    "Percentages of bearings with a return: within 10 cm of the true planar scan on the same bearing; or on one of the "
    "bearings beside it (1 deg); ghosts left: error over 10 cm, and the strongest echo of the cell is a ghost in the "
    "simulation; too near: too short by over 10 cm, or no surface in range. Percentages of bearings with a surface in "
    "range: returned; through a wall: the return is more than 20 cm behind the surface on this bearing and on those "
    "beside it, because at a glancing angle one degree moves a wall by as much.",
    "Map: F1 and Chamfer distance of occupied cells against the part of the floor plan visible to true beams, at "
    "10 cm; IoU of free space with the area that true beams passed.",
    "Targets: 85 % within 10 cm, less than 1 % through a wall, less than 3 % ghosts left.",
)


def tables(study: Study) -> list[Table]:
    """Return the table of metrics by platform, by building and over all recordings."""
    notes = [f"Means over recordings; odometry: {study.chosen.partner.odometry}.", *NOTES]
    paths = {name: path for name, (path, _) in COLUMNS.items()}
    factors = {name: factor for name, (_, factor) in COLUMNS.items()}
    rows = [
        {"scans": pair.scans, **group, **(figures_of(runs, paths).mean() * pd.Series(factors))}
        for pair, group, runs in study.by_group()
    ]
    for pair in study.pairs:
        shares = figures_of(study.of(pair), {name: FIGURES[name].path for name in SOURCES}).mean()
        if shares.notna().any():
            parts = ", ".join(f"{FIGURES[name].words} {100 * share:.1f}" for name, share in shares.items())
            notes.append(f"{pair.scans}: wrong returns by path type, % of all returns: {parts}.")
    return [Table("Scans and maps", rows, notes)]
