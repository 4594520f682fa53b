"""What the shipped networks gained when they went on learning from many radars: walks of `any-radar` that validate.

    radarsim dataset any-radar -o any-radar
    mkdir former && git archive 57c7245 radarize/learning/weights | tar -x --strip-components 2 -C former
    python -m benchmarks.any_radar --data any-radar --former former

The former networks had learned from the preset alone.
"""

import argparse
from itertools import product
from pathlib import Path

import torch

from benchmarks.results import Data, Page, script, tracked
from radarize.evaluation.benchmark.networks import Networks
from radarize.learning.nets.weights import load
from radarize.learning.task import Task, find_task
from radarize.learning.training.dataset import recordings

#: By network: what of its metrics is told, in which unit, and by how much that is more.
TOLD = {
    "translation": ("rmse_m_s", "velocity off by, m/s (RMS)", 1.0),
    "rotation": ("rmse_rad", "turn over 0.27 s off by, deg (RMS)", 180 / torch.pi),
    "segmentation": ("share_found_within_9_cm", "first surfaces within 9 cm, %", 100.0),
}
_ITEMS = 64


def judged(task: Task, weights: Path, path: Path) -> dict[str, float]:
    """Metrics of a network on all windows of a recording of any radar."""
    net, header = load(weights, task.network)
    table = task.table([path], grid=header.grid)
    spacing = max(task.spacings(table.frame_period))
    starts = table.starts((header.frames - 1) * spacing + 1)
    parts = []
    with torch.no_grad():
        for some in starts.split(_ITEMS):
            parts.append(task.judge(net, *task.items(table, some, torch.full_like(some, spacing), header.frames)))
    return task.metrics(torch.cat(parts).double().mean(dim=0))


@script(
    "What networks gained by learning from many radars",
    data=(Path, "data set any-radar"),
    former=(Path, "folder of the networks that had not learned from it"),
)
def main(options: argparse.Namespace) -> Page:
    paths, rows = recordings(options.data, "random-0", "validation"), []
    former, shipped = Networks("former", options.former), Networks()
    for kind, path in tracked([*product(TOLD, paths)], "any radar"):
        task, (name, title, factor) = find_task(kind), TOLD[kind]
        before, after = (factor * judged(task, one.weights.of(kind), path)[name] for one in (former, shipped))
        rows.append({"recording": path.stem, "what": title, "former": before, "shipped": after})
    return Page(
        rows,
        data=Data.of("any-radar, split random-0, validation", paths, 600),
        networks=(*former.used(TOLD), *shipped.used(TOLD)),
        notes=[
            "Recordings end in the name of their variant (scenes/datasets/any-radar.yaml). These walks chose the epoch "
            "of the shipped networks, and calibrated them. The former networks learned from bare buildings alone.",
        ],
    )
