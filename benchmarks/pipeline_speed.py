"""Milliseconds per frame of every stage from raw I/Q to map, on the office with the `radarize` preset, with networks
and without, beside the paper's table."""

import argparse
import tempfile
from pathlib import Path

from benchmarks.results import peak_memory_mb, publish
from radarize.benchmark.networks import Networks
from radarize.benchmark.runs import Pair, measure
from radarize.benchmark.runtime import NOTES, PAPER, PAPER_STAGES, stages
from radarize.methods.registry import BEST, CLASSICAL
from radarize.pipeline import BATCH
from radarize.recording import Recording
from radarsim.simulate import simulate

#: ms per frame that the whole may take on two cores.
TARGET = 17.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", nargs="?", type=Path, help="a recording; by default one is simulated")
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    networks = Networks() if options.weights is None else Networks("given", options.weights)
    columns = {}
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or simulate(
            "office", Path(folder) / "office.h5", duration=options.duration, seed=options.seed
        )
        with Recording(path) as source:
            frames = len(source)
            for methods in (BEST, CLASSICAL):
                title = f"{methods['odometry']}, {methods['scans']}: ms"
                columns[title] = stages(measure(source, Pair(**methods), networks, frames))
    rows = []
    for name in next(iter(columns.values())):
        paper = {
            f"paper, {device}: ms": figures[PAPER_STAGES.index(name)] if name in PAPER_STAGES else None
            for device, figures in PAPER.items()
        }
        rows.append({"stage": name, **{title: took[name] for title, took in columns.items()}, **paper})
    rows.append(dict.fromkeys(rows[0]) | {"stage": "to reach, whole", next(iter(columns)): TARGET})
    memory = f"{frames} frames in batches of {BATCH}; peak memory {peak_memory_mb():.0f} MB, the simulation included."
    publish(
        "pipeline_speed", "Pipeline speed per frame: office, preset radarize", rows, seed=options.seed,
        notes=[memory, *NOTES],
    )  # fmt: skip


if __name__ == "__main__":
    main()
