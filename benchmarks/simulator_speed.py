"""How fast the simulator is, and how exact, on three scenes with the `radarize` preset.

Three ways to the frames of the first scene in one run: this simulator; the same echoes as a direct sum in float64; and
`--engine sionna`, the paths of Sionna RT's own solver at the same poses.
"""

import numpy as np

from benchmarks.results import Data, command_line, memory_mb, peak_memory_mb, publish, timed, walked
from radarize.radar.presets import PRESETS
from radarsim.physics.direct import DirectSum
from radarsim.physics.pathsolver import DEPTH, RAYS
from radarsim.planner import plan_motion
from radarsim.scene.scene import Scene
from radarsim.simulate import BATCH, Simulator

CONFIG = PRESETS["radarize"]


def walk(name: str, times: np.ndarray, seed: int, **options: object) -> Simulator:
    """A simulator on a handheld walk, its first batch of frames made."""
    route, physics = np.random.default_rng(seed).spawn(2)
    scene = Scene.load(name)
    motion = plan_motion(scene, "handheld", len(times) * CONFIG.frame_period + 1, route)
    simulator = Simulator(scene, motion, CONFIG, physics, **options)
    simulator.frames(times[:BATCH])
    return simulator


def pace(simulator: Simulator, times: np.ndarray) -> tuple[float, float, float]:
    """Medians over a walk: s per frame, s per frame for its echoes; and the mean number of echoes."""
    spent, counts = [], []
    for batch in np.split(times, range(BATCH, len(times), BATCH)):
        (_, echoes), whole = timed(simulator.frames, batch)
        _, finding = timed(simulator.echoes, batch)
        spent.append((whole / len(batch), finding / len(batch)))
        counts += map(len, echoes)
    return *np.median(spent, axis=0), np.mean(counts)


def summed(simulator: Simulator, times: np.ndarray) -> tuple[float, float]:
    """The direct sum of the same echoes: median s per frame, and the fast synthesis' worst error power, dB."""
    direct, seconds, errors = DirectSum(CONFIG), [], []
    for t in times:
        (present,) = simulator.echoes([t])
        beat = present.lengths(CONFIG, simulator.motion, t), present.amplitude
        truth, spent = timed(direct, *beat)
        seconds.append(spent)
        off = simulator.synthesize(*beat) - truth
        errors.append(10 * np.log10(np.sum(np.abs(off) ** 2) / np.sum(np.abs(truth) ** 2)))
    return float(np.median(seconds)), max(errors)


def memory_growth(simulator: Simulator, frames: int) -> str:
    """Resident memory early and late in a long run, MB."""
    levels = []
    for k in range(0, frames, BATCH):
        simulator.frames((np.arange(k, k + BATCH) * CONFIG.frame_period) % (simulator.motion.duration - 1))
        levels.append(memory_mb())
    tenth = max(len(levels) // 10, 1)
    early, late = np.mean(levels[tenth : 2 * tenth]), np.mean(levels[-tenth:])
    return f"{early:.0f} MB early, {late:.0f} MB late, over {frames} frames"


PARSER = command_line(
    __doc__,
    frames=(240, "of a walk"),
    direct_frames=(2, "summed directly"),
    sionna_frames=(20, "by Sionna's paths"),
    memory_frames=(0, "frames of a long run that watches memory"),
    seed=(0, "of walks and worlds"),
)
PARSER.add_argument("--scenes", nargs="+", default=["office", "corridor", "floor"], help="the first in detail")


def main() -> None:
    options = PARSER.parse_args()
    times, first = np.arange(options.frames) * CONFIG.frame_period, options.scenes[0]
    ways, notes, simulators = [], [], {}  # ways: words, s per frame, echoes or paths, and what they give
    for name in options.scenes:
        simulators[name], begun = timed(walk, name, times, options.seed)
        frame, finding, echoes = pace(simulators[name], times)
        ways.append((f"{name}: radarsim", frame, echoes, "int16 I/Q with noise"))
        ways.append((f"{name}: of it, finding echoes", finding, echoes, "echoes"))
        notes.append(f"{name}: first {BATCH} frames after {begun:.1f} s; peak memory {peak_memory_mb():.0f} MB so far.")
    _, fastest, echoes, _ = ways[0]

    few = np.linspace(0, len(times) - 1, options.direct_frames).astype(int)
    seconds, error = summed(simulators[first], times[few])
    ways.append((f"{first}: direct sum, float64", seconds, echoes, "the same echoes, samples"))

    other, counts, spent = walk(first, times, options.seed, engine="sionna"), [], []  # its kernels are compiled now
    for t in np.linspace(0, times[-1], options.sionna_frames):
        (_, (paths,)), took = timed(other.frames, np.array([t]))
        spent.append(took)
        counts.append(len(paths))
    ways.append((f"{first}: --engine sionna", np.median(spent), np.mean(counts), "int16 I/Q with noise"))

    notes += [
        f"Fast synthesis against the direct sum of the same echoes: error power {error:.1f} dB (worst frame).",
        f"The radar makes {CONFIG.frame_rate:.0f} frames/s: {first} runs at {1 / fastest / CONFIG.frame_rate:.2f} of "
        "real time.",
        f"Medians over {options.frames}, {options.direct_frames} and {options.sionna_frames} frames.",
        f"Sionna RT's PathSolver: {RAYS:.0e} rays, depth {DEPTH}, diffuse reflection; its paths above the noise, "
        "turned into samples by the same synthesis.",
    ]
    if options.memory_frames:
        notes.append(f"{first}: memory {memory_growth(simulators[first], options.memory_frames)}.")
    publish(
        "simulator_speed",
        "Simulator speed, preset radarize",
        [
            {"way": way, "ms per frame": 1e3 * float(s), "frames/s": 1 / float(s), "times slower": float(s / fastest),
             "echoes or paths": int(count), "gives": gives}
            for way, s, count, gives in ways
        ],
        data=Data(
            "handheld walks",
            tuple(walked(name, options.seed, simulator.motion) for name, simulator in simulators.items()),
            options.seed,
        ),
        networks=(),
        notes=notes,
    )  # fmt: skip


if __name__ == "__main__":
    main()
