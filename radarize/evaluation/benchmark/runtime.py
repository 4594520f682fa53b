"""Benchmark of the run time of every stage from raw I/Q to map, ms per frame: the paper's table 6."""

from radarize.evaluation.benchmark.runs import TIMED, Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import PAPER, Table
from radarize.pipeline.methods import CLASSICAL
from radarize.signal.effort import BATCH

#: Stages of the paper, and the stages of this pipeline that they consist of.
STAGES = {
    "preprocess": ("spectra", "maps", "points"),
    "translation": ("translation",),
    "rotation": ("rotation",),
    "map": ("scans",),
    "SLAM": ("slam",),
}
#: Run times of the paper on a desktop with an RTX 3090 and on an AGX Orin, ms per frame.
DEVICES = {
    "RTX 3090": (9.53, 2.23, 6.60, 3.11, 0.93, 17.06),
    "AGX Orin": (11.76, 7.57, 14.78, 9.43, 4.68, 31.22),
}
DEVICE_STAGES = (*STAGES, "longest path")
NOTES = [
    "Run times in ms per frame. preprocess: range and Doppler spectra, and heat maps or points. translation and "
    "rotation of `fused` include the estimators without networks. other: odometry without these two stages.",
    "longest path: preprocess, the slowest of translation, rotation and map in parallel, and SLAM, as summed by the "
    "paper. Here stages run in sequence, so the whole is the sum of all stages and the reading of samples.",
    "Target: 17 ms for the whole on two cores.",
]


def pairs(chosen: Chosen) -> list[Pair]:
    """Return pairs of methods: the default ones, those without networks, and each method with a default partner."""
    first = [pair for pair in (chosen.partner, Pair(**CLASSICAL)) if pair.odometry in chosen.odometry]
    return [*first, *chosen.by_odometry(), *chosen.by_scans()]


def stages(found: dict) -> dict[str, float]:
    """Sum the run times of `radarize.evaluation.benchmark.runs.Timing` to the stages of the paper, ms per frame."""
    spent = dict(found["stages"])
    took = {name: sum(spent.pop(part, 0.0) for part in parts) for name, parts in STAGES.items()}
    slowest = max(took["translation"], took["rotation"], took["map"], *spent.values())
    path = took["preprocess"] + slowest + took["SLAM"]
    return {**took, "other": sum(spent.values()), "longest path": path, "whole, with reading": found["whole"]}


def tables(study: Study) -> list[Table]:
    """Return the table of run times of every pair, and of the paper on its machines."""
    rows = []
    for timing in study.timings:
        found = study.results.get(timing)
        if isinstance(found, dict):
            rows.append({"odometry": timing.pair.odometry, "scans": timing.pair.scans, **stages(found)})
    columns = ("odometry", "scans", *STAGES, "other", "longest path", "whole, with reading")
    for device, figures in DEVICES.items():
        paper = dict.fromkeys(columns) | {"odometry": f"paper, {device}", "scans": ""}
        rows.append(paper | dict(zip(DEVICE_STAGES, figures, strict=True)))
    first = study.timings[0].case
    notes = [f"{min(first.frames, TIMED)} frames of {first.name}, in batches of {BATCH}, with all cores.", *NOTES]
    return [Table("Run time per frame", rows, notes, (PAPER,))]
