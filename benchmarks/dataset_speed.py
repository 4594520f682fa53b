"""Speed of data sets: run time of sensors and writing relative to the simulation, furnished and bare buildings,
processes and threads, and the projected time for the paper's data set, from a sample of its recordings."""

import argparse
import os
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import psutil

from benchmarks.results import Data, Page, script, timed
from radarize.io.jobs import perform
from radarize.io.recording import RecordingWriter
from radarize.radar.presets import PRESETS
from radarsim.dataset.run import making
from radarsim.dataset.specification import Specification
from radarsim.dataset.task import Task
from radarsim.motion.walk import Walk
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.sensors.suite import ALWAYS, Suite, chosen
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
BIG = "radarize146"
BARE = {"clutter": 0, "unevenness": 0}


def steps(frames: int, seed: int, folder: Path) -> dict[str, float]:
    """Measure the run time of simulation, truth and writing, s per frame; medians over batches."""
    scene = Scene.of({"building": {"kind": "A", "seed": 1}}, "A")
    motion = Walk("handheld", frames * CONFIG.frame_period + 1).through(scene, seed)
    scenario = Scenario(scene, motion, CONFIG, seed=seed)
    suites = {"truth always there": Suite(scenario, ALWAYS)}
    suites["all truth sensors"] = Suite(scenario, (*ALWAYS, *chosen(["all"])))
    full, spent = suites["all truth sensors"], []
    with RecordingWriter(folder / "steps.h5", CONFIG, streams=full.streams, products=full.products) as writer:
        for first in range(0, frames, TOGETHER):
            batch = scenario.frames(np.arange(first, first + TOGETHER) * CONFIG.frame_period)
            _, simulation = timed(getattr, batch, "samples")
            took = {"simulation": simulation}
            for name, suite in suites.items():
                rows, took[name] = timed(suite.observe, batch, first)
            start = time.perf_counter()
            writer.append(batch.samples, batch.times, rows=rows)
            spent.append(took | {"writing all": time.perf_counter() - start})
    return dict(pd.DataFrame(spent[1:]).median() / TOGETHER)


def furnished_and_bare(frames: int, seed: int) -> dict[str, float]:
    """Measure the run time of simulation on the same walks through furnished and bare buildings, s per frame;
    medians."""
    share = {}
    for kind in "ABCD":
        building, scenarios = {"building": {"kind": kind, "seed": 1}}, {}
        furnished = Scene.of(building, kind)
        motion = Walk("handheld", frames * CONFIG.frame_period + 1).through(furnished, seed)
        for what, scene in (("furnished", furnished), ("bare", Scene.of(building | BARE, kind))):
            scenarios[f"{kind} {what}"] = Scenario(scene, motion, CONFIG, seed=seed)
        spent = []
        for first in range(0, frames, TOGETHER):
            times = np.arange(first, first + TOGETHER) * CONFIG.frame_period
            spent.append({name: timed(getattr, each.frames(times), "samples")[1] for name, each in scenarios.items()})
        share |= dict(pd.DataFrame(spent[1:]).median() / TOGETHER)
    return share


@dataclass
class Run:
    """Resources of a run of tasks.

    Attributes:
        wall: wall time including the start of processes, s.
        frame: time per frame of one worker, s.
        overhead: time per recording of one worker for scene, tour, first frames, and its share of the start, s.
        size: size on disk per frame, bytes.
        memory: peak memory of the largest worker, MB.
        frames: number of frames.
    """

    wall: float
    frame: float
    overhead: float
    size: float
    memory: float
    frames: int


def run(tasks: list[Task], folder: Path, workers: int) -> Run:
    """Make recordings on local processes, and measure the resources."""
    folder.mkdir()
    begin, first, last, memory = time.perf_counter(), {}, {}, 0.0
    for news in perform(making(tasks, folder), workers):
        if news.error:
            raise SystemExit(news.error)
        if not news.ended:
            last[news.name] = time.perf_counter(), news.done
            first.setdefault(news.name, last[news.name])
        workers_now = psutil.Process().children() or [psutil.Process()]
        memory = max(memory, *(process.memory_info().rss / 1e6 for process in workers_now))
    wall = time.perf_counter() - begin
    span = sum(last[name][0] - first[name][0] for name in first)
    frame = span / sum(last[name][1] - first[name][1] for name in first)
    frames = sum(task.frames for task in tasks)
    size = sum(task.path(folder).stat().st_size for task in tasks) / frames
    return Run(wall, frame, (workers * wall - frames * frame) / len(tasks), size, memory, frames)


def shortened(tasks: Iterable[Task], seconds: float, storage: str) -> list[Task]:
    """Return the tasks of the same recordings with a shorter duration."""
    shorter = {"duration": seconds, "frames": CONFIG.frames_within(seconds)}
    return [replace(task, storage=storage, **(shorter if seconds < task.duration else {})) for task in tasks]


def row(what: str, seconds: float) -> dict[str, object]:
    """Return a row of the table from the time per frame, s; its other columns are empty."""
    pace = {"what": what, "ms per frame": 1e3 * seconds, "frames/s": 1 / seconds}
    return pace | dict.fromkeys(("of simulation", "kB per frame", "MB per worker"), "")


@script(
    "Data sets: speed and size",
    every=(10, f"every N-th recording of {BIG} is made"),
    seconds=(60.0, "maximum duration of each, s"),
    frames=(240, "frames of the comparisons of single steps and of bare buildings"),
    few=(4, "recordings of the comparisons of workers and storage"),
    seed=(0, "seed of the walks in the comparisons"),
)
def main(options: argparse.Namespace) -> Page:
    cores = len(os.sched_getaffinity(0))
    tasks = Specification.load(BIG).tasks
    sample = tasks[:: options.every]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        share = steps(options.frames, options.seed, folder)
        for what, seconds in share.items():
            rows.append(row(f"one process: {what}", seconds) | {"of simulation": seconds / share["simulation"]})
        for what, seconds in furnished_and_bare(options.frames, options.seed).items():
            rows.append(row(f"one process: simulation, building {what}", seconds))
        runs = {}
        few = sample[:: max(1, len(sample) // options.few)][: options.few]
        short = min(options.seconds, 10.0)
        for label, chosen, seconds, storage, workers in (
            (f"1 worker x {cores} threads, raw", few, short, "raw", 1),
            (f"{cores} workers x 1 thread, raw", few, short, "raw", cores),
            (f"{cores} workers x 1 thread, heatmaps", few, short, "heatmaps", cores),
            (f"{cores} workers: sample of {BIG}, raw", sample, options.seconds, "raw", cores),
        ):
            made = runs[label] = run(shortened(chosen, seconds, storage), folder / str(len(runs)), workers)
            size = {"kB per frame": made.size / 1e3, "MB per worker": made.memory}
            rows.append(row(label, made.frame / workers) | size)
        heat, measured = list(runs.values())[-2:]
        data = Data.of(f"sample of {BIG}", sorted((folder / "3").glob("*.h5")), options.seed)
    total = sum(task.frames for task in tasks)
    hours = (total * measured.frame + len(tasks) * measured.overhead) / cores / 3600
    extra = (share["all truth sensors"] + share["writing all"]) / share["simulation"]
    return Page(
        rows,
        data=data,
        notes=[
            f"Run time of all truth sensors and writing: {extra:.2f} of the simulation (target: at most 0.33).",
            f"{BIG} on this machine, projected from {len(sample)} of its {len(tasks)} recordings, "
            f"{measured.frames / len(sample) * CONFIG.frame_period:.0f} s each ({measured.frames} of {total} frames, "
            f"made in {measured.wall / 60:.1f} minutes): {hours:.1f} hours, {total * measured.size / 1e9:.1f} GB raw "
            f"with all sensors; heat maps with all sensors {total * heat.size / 1e9:.1f} GB.",
            f"Overhead per recording: {measured.overhead:.1f} s for scene, tour and first frames.",
            "Rates are from the first to the last batch of a recording. kB per frame: size of the file with its truth.",
        ],
    )
