"""Scans by every method, what the wrong ones come from, and the maps that SLAM draws of them."""

import argparse
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.evaluation import Case, add_options, cases, groups, through
from benchmarks.results import publish
from radarize.evaluation.evaluate import evaluate
from radarize.evaluation.runfiles import read_scans
from radarize.evaluation.scans import true_ranges, wrong_by_cause
from radarize.methods import BEST, ODOMETRY, SCANS
from radarize.pipeline import run
from radarize.recording import Recording
from radarsim.sensors.causes import CAUSES

#: Columns of the table: of which metrics, which figure, in which unit.
COLUMNS = {
    "within 10 cm %": ("scans", "within_10cm", 100),
    "or of a bearing beside %": ("scans", "beside", 100),
    "returned %": ("scans", "returned", 100),
    "through a wall %": ("scans", "through", 100),
    "ghosts left %": ("causes", "ghosts", 100),
    "too near %": ("scans", "short", 100),
    "map F1 %": ("map", "f1", 100),
    "Chamfer m": ("map", "chamfer", 1),
    "free IoU %": ("map", "free_iou", 100),
    "SLAM ATE m": ("slam", "ate", 1),
    "SLAM ATE rad": ("slam", "ate_rotation", 1),
}
TARGET = {"within 10 cm %": "85", "ghosts left %": "< 3", "through a wall %": "< 1"}
#: Causes of wrong returns, by the names of the notes.
SOURCES = {
    "direct echoes beside or above": ("direct",),
    "floor and ceiling": ("floor_ceiling",),
    "ghosts": ("ghost_1", "ghost_2", "ghost_3"),
    "what is behind a slab": ("through_slab",),
    "leakage and noise": ("leakage", "noise"),
}


def judge(
    case: Case, methods: Sequence[str], odometry: str, weights: Path | None, runs: Path
) -> dict[str, dict[str, dict]]:
    """Metrics of a run by every method, with the causes of its scans' errors."""
    found = {}
    for method in methods:
        folder = runs / f"{case.path.stem}.{odometry}.{method}"
        if not (folder / "run.json").is_file():  # what a run writes last
            run(case.path, folder, scans=method, odometry=odometry, weights=weights)
        metrics = evaluate(folder)
        ate = metrics["slam"]["ate"]
        metrics["slam"] = {"ate": ate["position"]["mean"], "ate_rotation": ate["rotation"]["mean"]}
        metrics["causes"] = causes(case.path, read_scans(folder / "scans.h5"))
        found[method] = metrics
    return found


def causes(recording: Path, scans: dict[str, np.ndarray]) -> dict[str, float]:
    """Shares of returned bearings that are wrong, by `SOURCES`."""
    with Recording(recording) as source:
        if not source.has("truth/cause"):
            return dict.fromkeys(SOURCES, np.nan)
        axes = source.read("truth/cause_ranges"), source.read("truth/cause_azimuths")
        azimuths, true = (
            scans["azimuths"],
            true_ranges(scans["azimuths"], scans["truth/scan"], scans["truth/scan_azimuths"]),
        )
        wrong = wrong_by_cause(scans["ranges"], true, azimuths, source.read("truth/cause"), *axes, CAUSES)
    return {source: sum(wrong[name] for name in names) for source, names in SOURCES.items()}


def mean(found: Sequence[dict[str, dict]], part: str, name: str) -> float:
    """Over recordings that have the figure; an empty map has no Chamfer distance."""
    values = [one[part][name] for one in found if part in one and one[part].get(name) is not None]
    return float(np.mean(values)) if values else np.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--methods", nargs="+", choices=SCANS, default=tuple(reversed(SCANS)))
    parser.add_argument("--odometry", choices=ODOMETRY, default=BEST["odometry"], help="the same for all methods")
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    parser.add_argument("--runs", type=Path, metavar="DIR", help="keep the runs there, and use those that are there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary, cases(options.data) as found:
        runs = options.runs or Path(temporary)
        work = partial(judge, methods=options.methods, odometry=options.odometry, weights=options.weights, runs=runs)
        judged = through(work, found, options.processes, "recordings")
    rows = []
    for name, members in groups(found).items():
        for method in options.methods:
            chosen = [judged[i][method] for i in members]
            figures = {title: factor * mean(chosen, part, key) for title, (part, key, factor) in COLUMNS.items()}
            rows.append({"scans": method, "on": name, "recordings": len(members), **figures})
    rows.append(dict.fromkeys(rows[0], "-") | {"scans": "to reach", **TARGET})
    sources = [
        f"{method}: wrong returns, % of all, come from "
        + ", ".join(f"{s} {100 * mean([one[method] for one in judged], 'causes', s):.1f}" for s in SOURCES)
        + "."
        for method in options.methods
    ]
    publish(
        "mapping",
        "Scans and maps on buildings that no training saw",
        rows,
        seed=1,
        notes=[
            f"Means over recordings; odometry: {options.odometry}. Of returned bearings: within 10 cm of the true "
            "planar scan on their own bearing; there or one bearing (1 deg) to a side; ghosts left: not within 10 cm, "
            "and a ghost is the strongest cause of the cell (provenance); too near by over 10 cm, or nothing is there. "
            "Of bearings with a surface in reach: returned; through a wall: ending more than 20 cm behind the surface "
            "there and one bearing to a side, for at a glancing angle a degree moves a wall by as much.",
            "Map: F1 and Chamfer distance of occupied cells against the part of the floor plan that true beams met, at "
            "10 cm; IoU of free space with what they passed through.",
            *sources,
        ],
    )


if __name__ == "__main__":
    main()
