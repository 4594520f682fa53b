"""Milliseconds per frame of every stage from raw I/Q to map, on the office with the `radarize` preset, with networks
and without, beside the paper's table."""

import argparse
import tempfile
import time
from pathlib import Path

from benchmarks.results import peak_memory_mb, publish
from radarize.methods import BEST, CLASSICAL, Weights
from radarize.pipeline import BATCH, Pipeline
from radarize.recording import Recording
from radarsim.simulate import simulate

#: Stages as the paper lists them (table 6), of ours; and its ms per frame, on a desktop with an RTX 3090 and on an AGX
#: Orin. Its longest path is preprocessing, the slowest of the three networks beside each other, and SLAM.
STAGES = {"preprocess": ("spectra", "maps"), "translation": ("translation",), "rotation": ("rotation",),
          "map": ("scans",), "SLAM": ("slam",)}  # fmt: skip
PAPER = {"preprocess": (9.53, 11.76), "translation": (2.23, 7.57), "rotation": (6.60, 14.78), "map": (3.11, 9.43),
         "SLAM": (0.93, 4.68), "longest path": (17.06, 31.22)}  # fmt: skip
#: ms per frame that the whole may take on two cores.
TARGET = 17.0


def measure(source: Recording, methods: dict[str, str], weights: Weights) -> dict[str, float]:
    """ms per frame of each stage, of the longest path if the middle three ran beside each other, and of the whole."""
    Pipeline(source.config, weights=weights, **methods).push(source.adc(0, BATCH), source.times[:BATCH])  # compiles
    pipeline = Pipeline(source.config, weights=weights, **methods)
    start = time.perf_counter()
    for frames, adc in source.batches(BATCH):
        pipeline.push(adc, source.times[frames], source.valid(frames.start, frames.stop))
    pipeline.finish()
    total = time.perf_counter() - start
    per_frame = 1e3 / len(source)
    took = {name: per_frame * sum(pipeline.stage_seconds[part] for part in parts) for name, parts in STAGES.items()}
    slowest = max(took["translation"], took["rotation"], took["map"])
    return took | {
        "longest path": took["preprocess"] + slowest + took["SLAM"],
        "whole, with reading": per_frame * total,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", nargs="?", type=Path, help="a recording; by default one is simulated")
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    columns = {}
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or simulate(
            "office", Path(folder) / "office.h5", duration=options.duration, seed=options.seed
        )
        with Recording(path) as source:
            for methods in (BEST, CLASSICAL):
                title = f"{methods['odometry']}, {methods['scans']}: ms"
                columns[title] = measure(source, methods, Weights(options.weights))
            frames = len(source)
    rows = []
    for name in next(iter(columns.values())):
        values = {title: took[name] for title, took in columns.items()}
        desktop, board = PAPER.get(name, ("-", "-"))
        rows.append({"stage": name, **values, "paper, RTX 3090: ms": desktop, "paper, AGX Orin: ms": board})
    rows.append(dict.fromkeys(rows[0], "-") | {"stage": "to reach, whole", next(iter(columns)): TARGET})
    publish(
        "pipeline_speed",
        "Pipeline speed per frame: office, preset radarize",
        rows,
        seed=options.seed,
        notes=[
            f"{frames} frames in batches of {BATCH}; peak memory {peak_memory_mb():.0f} MB, the simulation included.",
            "Preprocess: range and Doppler spectra, and the heat maps that networks or thresholds read. The fused "
            "translation and rotation hold the classical estimators as well.",
            "Stages run one after the other here, so the whole is their sum and the reading; the paper's longest path "
            "lets its three networks run beside each other.",
        ],
    )


if __name__ == "__main__":
    main()
