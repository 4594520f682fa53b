"""How fast the simulator is, and how exact, on three scenes with the `radarize` preset.

Three ways to the frames of the first scene in one run: this simulator; the same echoes summed naively in float64
numpy; and `--engine sionna`, the paths of Sionna RT's own solver at the same poses.
"""

import time
from dataclasses import dataclass

import numpy as np

from benchmarks.results import Data, command_line, memory_mb, peak_memory_mb, publish, walked
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.physics.pathsolver import DEPTH, RAYS
from radarsim.physics.surface import DENSITY, Surface
from radarsim.physics.synthesis import BurstClock
from radarsim.planner import plan_motion
from radarsim.scene.scene import Scene
from radarsim.simulate import Simulator

CONFIG = PRESETS["radarize"]
BATCH = 8


def naive(lengths: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """The beat signal as everybody writes it first: float64, one matrix of phases per trace."""
    loops, tx, rx, samples, _ = CONFIG.frame_shape
    clock = BurstClock.of(CONFIG)
    n = (np.arange(samples) - (samples - 1) / 2) / CONFIG.sample_rate
    out = np.empty((loops, tx, rx, samples), complex)
    for loop in range(loops):
        for k in range(tx):
            s = (CONFIG.chirp_times[loop, k] - clock.middle) / clock.half
            for r in range(rx):
                c0, c1, c2 = lengths[:, k * rx + r].T
                length, rate = c0 + s * (c1 + s * c2), (c1 + 2 * s * c2) / clock.half
                beat = (CONFIG.slope * length + CONFIG.center_frequency * rate) / SPEED_OF_LIGHT
                cycles = CONFIG.center_frequency / SPEED_OF_LIGHT * length[:, None] + beat[:, None] * n
                out[loop, k, r] = amplitudes @ np.exp(2j * np.pi * cycles)
    return out


def walk(scene: Scene, frames: int, seed: int) -> tuple[Simulator, np.ndarray]:
    """A simulator on a handheld walk, and the frames' stamps."""
    route, physics = np.random.default_rng(seed).spawn(2)
    motion = plan_motion(scene, "handheld", frames * CONFIG.frame_period + 1, route)
    return Simulator(scene, motion, CONFIG, physics), np.arange(frames) * CONFIG.frame_period


@dataclass
class Pace:
    """Medians over a walk.

    Attributes:
        frame, finding: s per frame, in all and for its echoes.
        echoes: mean number.
        first: s from nothing to the first frames.
        memory: peak of the process so far, MB.
    """

    frame: float
    finding: float
    echoes: float
    first: float
    memory: float


def pace(name: str, frames: int, seed: int) -> tuple[Pace, Simulator, np.ndarray]:
    """Speed on one scene."""
    start = time.perf_counter()
    simulator, times = walk(Scene.load(name), frames, seed)
    simulator.frames(times[:BATCH])
    first = time.perf_counter() - start
    spent, finding, counts = [], [], []
    for k in range(0, frames, BATCH):
        start = time.perf_counter()
        _, echoes = simulator.frames(times[k : k + BATCH])
        spent.append((time.perf_counter() - start) / len(echoes))
        counts += [len(e) for e in echoes]
        start = time.perf_counter()
        simulator.echoes(times[k : k + BATCH])
        finding.append((time.perf_counter() - start) / len(echoes))
    found = Pace(float(np.median(spent)), float(np.median(finding)), np.mean(counts), first, peak_memory_mb())
    return found, simulator, times


def memory_growth(simulator: Simulator, frames: int) -> str:
    """Resident memory early and late in a long run, MB."""
    levels = []
    for k in range(0, frames, BATCH):
        simulator.frames((np.arange(k, k + BATCH) * CONFIG.frame_period) % (simulator.motion.duration - 1))
        levels.append(memory_mb())
    tenth = max(len(levels) // 10, 1)
    early, late = np.mean(levels[tenth : 2 * tenth]), np.mean(levels[-tenth:])
    return f"{early:.0f} MB early, {late:.0f} MB late, over {frames} frames"


def cell_powers(simulator: Simulator, times: np.ndarray) -> np.ndarray:
    """Diffuse power by cell, a range bin by a sixth of sin(azimuth) = -0.9...0.9, mean over frames.

    The sum of the echoes' powers: that of their field, but for what the scatterers' random phases add or take away. So
    draws of a world differ by where its scatterers are, not by speckle, and few of them are enough.
    """
    edges = np.arange(0.5, CONFIG.max_range, CONFIG.range_resolution), np.linspace(-0.9, 0.9, 7)
    power = 0.0
    middle = times + CONFIG.burst_center
    poses = simulator.motion.position(middle), simulator.motion.rotation(middle).as_matrix()
    for present, position, rotation in zip(simulator.echoes(times), *poses, strict=True):
        way = present.points - position
        distance = np.linalg.norm(way, axis=2)
        side = (way[:, 1] @ rotation[:, 1]) / distance[:, 1]
        strength = np.abs(present.amplitude[: len(way)]) ** 2
        power += np.histogram2d(distance.mean(axis=1), side, edges, weights=strength)[0] / len(times)
    return power.ravel()


def density_error(name: str, draws: int, seed: int, frames: int = 8, factor: int = 10) -> str:
    """Mean power per cell against that of ten times the scatterers, over independent draws of both worlds."""
    scene = Scene.load(name)
    simulator, times = walk(scene, 60 * frames, seed)
    powers = []
    for density in (DENSITY, factor * DENSITY):
        worlds = np.random.default_rng([seed, int(density)]).spawn(draws)
        found = []
        for world in worlds:
            simulator.finder.surface = Surface(scene, world, density)
            found.append(np.concatenate([cell_powers(simulator, times[k : k + 1]) for k in range(0, len(times), 60)]))
        powers.append(np.array(found).reshape(draws, frames, -1).mean(axis=1))
        simulator.finder.threshold /= np.sqrt(factor)  # each of the more scatterers is weaker
    # cells that hold a hundredth of the mean or more
    powers = np.array(powers)[:, :, (np.mean(powers, axis=(0, 1)) > 0.01 * np.mean(powers))]
    decibel = 10 / np.log(10)

    def compared(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Difference of the means over draws and its standard error, dB."""
        share = p.std(axis=1, ddof=1) / p.mean(axis=1) / np.sqrt(draws)
        return decibel * np.log(p[0].mean(axis=0) / p[1].mean(axis=0)), decibel * np.hypot(*share)

    whole, whole_error = compared(powers.sum(axis=2, keepdims=True))
    off, error = compared(powers)
    rest = np.sqrt(max(np.mean(off**2) - np.mean(error**2), 0.0))
    verdict = "within" if rest < 0.5 and abs(whole[0]) + 2 * whole_error[0] < 0.5 else "not within"
    return (
        f"{whole[0]:+.2f} +- {whole_error[0]:.2f} dB in all; {np.sqrt(np.mean(off**2)):.2f} dB RMS from cell to cell, "
        f"where {draws} draws leave a standard error of {np.sqrt(np.mean(error**2)):.2f} dB, so {rest:.2f} dB of it "
        f"are real: {verdict} 0.5 dB ({powers.shape[2]} cells, {frames} frames along a walk)"
    )


def row(way: str, seconds: float, echoes: float, gives: str) -> dict[str, object]:
    """A row of the table, from seconds a frame; how many times slower it is than the first is for later."""
    pace = {"way": way, "ms per frame": 1e3 * float(seconds), "frames/s": 1 / float(seconds), "times slower": 1.0}
    return pace | {"echoes or paths": int(echoes), "gives": gives}


PARSER = command_line(
    __doc__,
    frames=(240, "of a walk"),
    naive_frames=(2, "summed naively"),
    sionna_frames=(20, "by Sionna's paths"),
    memory_frames=(0, "frames of a long run that watches memory"),
    draws=(0, "worlds compared with as many of ten times the scatterers"),
    seed=(0, "of walks and worlds"),
)
PARSER.add_argument("--scenes", nargs="+", default=["office", "corridor", "floor"], help="the first in detail")


def main() -> None:
    options = PARSER.parse_args()

    rows, notes, walks = [], [], []
    for name in options.scenes:
        found, *rest = pace(name, options.frames, options.seed)
        walks.append(walked(name, options.seed, rest[0].motion))
        if not rows:
            main_pace, simulator, times = found, *rest
        rows.append(row(f"{name}: radarsim", found.frame, found.echoes, "int16 I/Q with noise"))
        rows.append(row(f"{name}: of it, finding echoes", found.finding, found.echoes, "echoes"))
        notes.append(
            f"{name}: first {BATCH} frames after {found.first:.1f} s; peak memory {found.memory:.0f} MB so far."
        )

    naive_seconds, error = [], []
    for t in times[:: max(options.frames // options.naive_frames, 1)][: options.naive_frames]:
        present = simulator.echoes([t])[0]
        lengths = present.lengths(CONFIG, simulator.motion, t)
        fast = simulator.synthesize(lengths, present.amplitude)
        start = time.perf_counter()
        truth = naive(lengths, present.amplitude)
        naive_seconds.append(time.perf_counter() - start)
        error.append(10 * np.log10(np.sum(np.abs(fast - truth) ** 2) / np.sum(np.abs(truth) ** 2)))
    first = options.scenes[0]
    seconds = np.median(naive_seconds)
    rows.append(row(f"{first}: naive float64 numpy", seconds, main_pace.echoes, "the same echoes, samples"))

    _, physics = np.random.default_rng(options.seed).spawn(2)
    other = Simulator(Scene.load(first), simulator.motion, CONFIG, physics, engine="sionna")
    seconds, counts = [], []
    for k, t in enumerate(np.linspace(0, times[-1], options.sionna_frames + 2)):
        start = time.perf_counter()
        _, paths = other.frames(np.array([t]))
        if k >= 2:  # the first calls compile kernels
            seconds.append(time.perf_counter() - start)
            counts.append(len(paths[0]))
    rows.append(row(f"{first}: --engine sionna", np.median(seconds), np.mean(counts), "int16 I/Q with noise"))
    for each in rows:
        each["times slower"] = each["ms per frame"] / rows[0]["ms per frame"]

    notes += [
        f"Fast synthesis against the naive sum of the same echoes: error power {max(error):.1f} dB (worst frame).",
        f"The radar makes {CONFIG.frame_rate:.0f} frames/s: {first} runs at "
        f"{1 / main_pace.frame / CONFIG.frame_rate:.2f} of real time.",
        f"Medians over {options.frames}, {options.naive_frames} and {options.sionna_frames} frames.",
        f"Sionna RT's PathSolver: {RAYS:.0e} rays, depth {DEPTH}, diffuse reflection; its paths above the noise, "
        "turned into samples by the same synthesis.",
    ]
    if options.memory_frames:
        notes.append(f"{first}: memory {memory_growth(simulator, options.memory_frames)}.")
    if options.draws:
        off = density_error(first, options.draws, options.seed)
        notes.append(f"{first}: diffuse power per cell against ten times the scatterers {off}.")
    data = Data("handheld walks", tuple(walks), options.seed)
    publish("simulator_speed", "Simulator speed, preset radarize", rows, data=data, networks=(), notes=notes)


if __name__ == "__main__":
    main()
