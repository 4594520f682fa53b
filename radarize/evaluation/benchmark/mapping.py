"""Scans by every method, what the wrong ones come from, and the maps that SLAM draws of them."""

import pandas as pd

from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.benchmark.table import Table
from radarize.evaluation.stress import FIGURES, SOURCES

#: Columns: where the figure stands in `Study.of`, and its factor.
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
    "Of returned bearings: within 10 cm of the true planar scan on their own bearing; there or one bearing (1 deg) to "
    "a side; ghosts left: not within 10 cm, and a ghost is the strongest cause of the cell (provenance); too near by "
    "over 10 cm, or nothing is there. Of bearings with a surface in reach: returned; through a wall: ending more than "
    "20 cm behind the surface there and one bearing to a side, for at a glancing angle a degree moves a wall by as "
    "much.",
    "Map: F1 and Chamfer distance of occupied cells against the part of the floor plan that true beams met, at 10 cm; "
    "IoU of free space with what they passed through.",
    "To reach: 85 % within 10 cm, less than 1 % through a wall, less than 3 % ghosts left.",
)


def tables(study: Study) -> list[Table]:
    """Figures by platform, by building and of all."""
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
            notes.append(f"{pair.scans}: wrong returns, % of all, come from {parts}.")
    return [Table("Scans and maps", rows, notes)]
