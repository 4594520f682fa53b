"""Speed and accuracy of the simulator on three scenes with the `radarize` preset.

The frames of the first scene are computed in three ways: by this simulator; from the same echoes by a direct sum in
float64; and from the paths of Sionna RT's solver at the same poses (`benchmarks.sionna`).
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.references.brute_force import direct_sum
from benchmarks.results import Data, Page, memory_mb, peak_memory_mb, script, timed, walked
from benchmarks.sionna import DEPTH, RAYS, SionnaScenario
from radarize.radar.presets import PRESETS
from radarsim.machine.threads import default_workers
from radarsim.recording.batches import TOGETHER, Batches
from radarsim.recording.simulate import planned, record
from radarsim.scenario import Scenario

CONFIG = PRESETS["radarize"]


def walk(name: str, times: np.ndarray, seed: int) -> Scenario:
    """Return the scenario of a handheld walk, after the simulation of its first frames."""
    scenario, *_ = planned(name, seed=seed, duration=len(times) * CONFIG.frame_period + 1)
    assert scenario.frames(times[:TOGETHER]).samples.any()
    return scenario


def pace(scenario: Scenario, times: np.ndarray) -> tuple[float, float, float]:
    """Measure the median run time per frame, and that of its paths, s; return them with the mean number of echoes."""
    spent, counts = [], []
    for batch in np.split(times, range(TOGETHER, len(times), TOGETHER)):
        frames = scenario.frames(batch)
        echoes, finding = timed(getattr, frames, "paths")
        _, rest = timed(getattr, frames, "samples")
        spent.append(((finding + rest) / len(batch), finding / len(batch)))
        counts += map(len, echoes)
    return *np.median(spent, axis=0), np.mean(counts)


def beside(scenario: Scenario, workers: int) -> tuple[float, float]:
    """Measure a recording by a number of processes: run time per frame after the first tenth, and time until that,
    s."""
    seen, frames = [], len(scenario.times)
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        record(
            Batches.of(scenario), Path(folder) / "walk.h5", workers=workers,
            progress=lambda done, total: seen.append((done, time.perf_counter())),
        )  # fmt: skip
    first, at = next(each for each in seen if each[0] >= frames / 10)
    return (seen[-1][1] - at) / (frames - first), at - begun


def summed(scenario: Scenario, times: np.ndarray) -> tuple[float, float]:
    """Compute the direct sum of the same echoes: median run time per frame, s, and largest error power of the fast
    synthesis, dB."""
    seconds, errors = [], []
    for t in times:
        (present,) = scenario.frames([t]).paths
        beat = present.lengths(CONFIG, scenario.motion, t), present.amplitude
        truth, spent = timed(direct_sum, CONFIG, *beat)
        seconds.append(spent)
        off = scenario.synthesize(*beat) - truth
        errors.append(10 * np.log10(np.sum(np.abs(off) ** 2) / np.sum(np.abs(truth) ** 2)))
    return float(np.median(seconds)), max(errors)


def memory_growth(scenario: Scenario, frames: int) -> str:
    """Return the resident memory early and late in a long run, MB, as text."""
    levels = []
    for k in range(0, frames, TOGETHER):
        times = np.arange(k, k + TOGETHER) * CONFIG.frame_period % (scenario.motion.duration - 1)
        assert scenario.frames(times).samples.any()
        levels.append(memory_mb())
    tenth = max(len(levels) // 10, 1)
    early, late = np.mean(levels[tenth : 2 * tenth]), np.mean(levels[-tenth:])
    return f"{early:.0f} MB early, {late:.0f} MB late, over {frames} frames"


@script(
    "Simulator speed, preset radarize",
    frames=(240, "frames of a walk"),
    recorded_frames=(1800, "frames of a recording by several processes"),
    direct_frames=(2, "frames of the direct sum"),
    sionna_frames=(20, "frames with Sionna's paths"),
    memory_frames=(0, "frames of a long run for the measurement of memory; 0: none"),
    seed=(0, "seed of walks and scenes"),
    scenes=(["office", "corridor", "floor"], "scenes; the first one in detail", {"nargs": "+", "type": str}),
)
def main(options: argparse.Namespace) -> Page:
    times, first = np.arange(options.frames) * CONFIG.frame_period, options.scenes[0]
    ways, notes, scenarios = [], [], {}  # ways: words, s per frame, echoes or paths, and what they give
    for name in options.scenes:
        scenarios[name], begun = timed(walk, name, times, options.seed)
        frame, finding, echoes = pace(scenarios[name], times)
        ways.append((f"{name}: radarsim", frame, echoes, "int16 I/Q with noise"))
        ways.append((f"{name}: thereof path finding", finding, echoes, "echoes"))
        memory = f"{peak_memory_mb():.0f} MB"
        notes.append(f"{name}: first {TOGETHER} frames after {begun:.1f} s; peak memory {memory} so far.")
    _, fastest, echoes, _ = ways[0]
    workers = default_workers()
    long, *_ = planned(first, seed=options.seed, duration=options.recorded_frames * CONFIG.frame_period)
    recorded, begun = beside(long, workers)
    ways.insert(2, (f"{first}: a recording by {workers} processes", recorded, echoes, "a file"))
    notes.append(
        f"{first}: by {workers} processes, the first tenth of {options.recorded_frames} frames after {begun:.1f} s."
    )

    few = np.linspace(0, len(times) - 1, options.direct_frames).astype(int)
    seconds, error = summed(scenarios[first], times[few])
    ways.append((f"{first}: direct sum, float64", seconds, echoes, "the same echoes, samples"))

    other, counts, spent = SionnaScenario.of(scenarios[first]), [], []
    assert other.frames(times[:1]).samples.any()  # its kernels are compiled now
    for t in np.linspace(0, times[-1], options.sionna_frames):
        frames = other.frames(np.array([t]))
        _, took = timed(getattr, frames, "samples")
        spent.append(took)
        counts.append(len(frames.paths[0]))
    ways.append((f"{first}: paths of Sionna RT", np.median(spent), np.mean(counts), "int16 I/Q with noise"))

    notes += [
        f"Error power of the fast synthesis against the direct sum of the same echoes: {error:.1f} dB (worst frame).",
        f"The frame rate of the radar is {CONFIG.frame_rate:.0f} Hz: {first} runs at "
        f"{1 / fastest / CONFIG.frame_rate:.2f} of real time in one process, at "
        f"{1 / recorded / CONFIG.frame_rate:.2f} in {workers}.",
        f"Medians over {options.frames}, {options.direct_frames} and {options.sionna_frames} frames.",
        f"Sionna RT's PathSolver: {RAYS:.0e} rays, depth {DEPTH}, diffuse reflection; its paths above the noise, "
        "turned into samples by the same synthesis.",
    ]
    if options.memory_frames:
        notes.append(f"{first}: memory {memory_growth(scenarios[first], options.memory_frames)}.")
    return Page(
        [
            {
                "way": way,
                "ms per frame": 1e3 * float(s),
                "frames/s": 1 / float(s),
                "times slower": float(s / fastest),
                "echoes or paths": int(count),
                "gives": gives,
            }
            for way, s, count, gives in ways
        ],
        data=Data(
            "handheld walks",
            tuple(walked(name, options.seed, scenario.motion) for name, scenario in scenarios.items()),
            options.seed,
        ),
        notes=notes,
    )
