"""Milliseconds per frame of every stage from raw I/Q to map: the paper's table 6."""

from radarize.evaluation.benchmark.runs import TIMED, Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import PAPER, Table
from radarize.pipeline.methods import CLASSICAL
from radarize.signal.effort import BATCH

#: Stages as the paper lists them, of ours.
STAGES = {
    "preprocess": ("spectra", "maps", "points"),
    "translation": ("translation",),
    "rotation": ("rotation",),
    "map": ("scans",),
    "SLAM": ("slam",),
}
#: The paper's ms per frame, on a desktop with an RTX 3090 and on an AGX Orin.
DEVICES = {
    "RTX 3090": (9.53, 2.23, 6.60, 3.11, 0.93, 17.06),
    "AGX Orin": (11.76, 7.57, 14.78, 9.43, 4.68, 31.22),
}
DEVICE_STAGES = (*STAGES, "longest path")
NOTES = [
    "ms per frame. Preprocess: range and Doppler spectra, and the heat maps or points that methods read. Fused "
    "translation and rotation hold the classical estimators as well. Other: odometry that is not made of these two.",
    "Longest path: preprocessing, the slowest of translation, rotation and map beside each other, and SLAM, as the "
    "paper adds up; here stages run one after the other, so the whole is their sum and the reading.",
    "To reach: 17 ms for the whole on two cores.",
]


def pairs(chosen: Chosen) -> list[Pair]:
    """Methods of choice, those without networks, and each method with the methods of choice beside it."""
    first = [pair for pair in (chosen.partner, Pair(**CLASSICAL)) if pair.odometry in chosen.odometry]
    return [*first, *chosen.by_odometry(), *chosen.by_scans()]


def stages(found: dict) -> dict[str, float]:
    """The paper's stages, and what ours are beside them, of `radarize.evaluation.benchmark.runs.Timing`."""
    spent = dict(found["stages"])
    took = {name: sum(spent.pop(part, 0.0) for part in parts) for name, parts in STAGES.items()}
    slowest = max(took["translation"], took["rotation"], took["map"], *spent.values())
    path = took["preprocess"] + slowest + took["SLAM"]
    return {**took, "other": sum(spent.values()), "longest path": path, "whole, with reading": found["whole"]}


def tables(study: Study) -> list[Table]:
    """Stages of every pair, and of the paper's on its machines."""
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
