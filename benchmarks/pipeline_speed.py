"""Milliseconds per frame of every stage from raw I/Q to map, on the office with the `radarize` preset."""

import argparse
import tempfile
import time
from pathlib import Path

from benchmarks.results import peak_memory_mb, publish
from radarize.pipeline import BATCH, Pipeline
from radarize.recording import Recording
from radarsim.simulate import simulate

#: Run time per frame in the paper (table 6), ms: desktop with RTX 3090, then AGX Orin, without its preprocessing's
#: split. Its translation, rotation and scans are networks.
PAPER = {"spectra": (9.53, 11.76), "maps": (9.53, 11.76), "translation": (2.23, 7.57), "rotation": (6.60, 14.78),
         "scans": (3.11, 9.43), "slam": (0.93, 4.68)}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", nargs="?", type=Path, help="a recording; by default one is simulated")
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or simulate(
            "office", Path(folder) / "office.h5", duration=options.duration, seed=options.seed
        )
        with Recording(path) as source:
            warm = Pipeline(source.config)
            warm.push(source.adc(0, BATCH), source.times[:BATCH])
            pipeline = Pipeline(source.config)
            start = time.perf_counter()
            for frames, adc in source.batches(BATCH):
                pipeline.push(adc, source.times[frames], source.valid(frames.start, frames.stop))
            pipeline.finish()
            total = time.perf_counter() - start
            frames = len(source)
    stages = {name: 1e3 * seconds / frames for name, seconds in pipeline.stage_seconds.items()}
    stages["whole, with reading"] = 1e3 * total / frames
    rows = [
        {
            "stage": name,
            "ms per frame": value,
            "frames/s": 1e3 / value,
            "paper, RTX 3090": PAPER.get(name, ("17.06 (longest path)",) * 2)[0],
            "paper, AGX Orin": PAPER.get(name, ("31.22 (longest path)",) * 2)[1],
        }
        for name, value in stages.items()
    ]
    publish(
        "pipeline_speed",
        "Pipeline speed: office, preset radarize",
        rows,
        seed=options.seed,
        notes=[
            f"{frames} frames in batches of {BATCH}; peak memory {peak_memory_mb():.0f} MB, the simulation included.",
            "The paper's preprocessing (9.53 / 11.76 ms) is spectra and maps together; its translation, rotation and "
            "scans are networks on a GPU, here they are the Doppler least squares, map matching and thresholds.",
        ],
    )


if __name__ == "__main__":
    main()
