"""How fast the simulator is, and how exact, on the office with the `radarize` preset.

Three ways to the same frames in one run: this simulator; the same echoes summed naively in float64 numpy; and Sionna
RT's own PathSolver at the same poses, which finds paths only and would still have to be turned into samples.
"""

import argparse
import time

import numpy as np

from benchmarks.results import peak_memory_mb, publish
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.motion import plan_motion
from radarsim.physics.synthesis import BurstClock
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


def sionna_paths(scene: Scene, position: np.ndarray, yaw: float, rays: int, seed: int) -> int:
    """Paths that Sionna RT's PathSolver finds between two antennas a centimetre apart; diffuse, depth 3."""
    import sionna.rt as rt

    world = scene.sionna
    for name in list(world.transmitters):
        world.remove(name)
    for name in list(world.receivers):
        world.remove(name)
    world.frequency = CONFIG.center_frequency
    world.tx_array = world.rx_array = rt.PlanarArray(num_rows=1, num_cols=1, pattern="iso", polarization="V")
    beside = 0.006 * np.array([-np.sin(yaw), np.cos(yaw), 0])
    world.add(rt.Transmitter("tx", [float(x) for x in position + beside]))
    world.add(rt.Receiver("rx", [float(x) for x in position - beside]))
    paths = rt.PathSolver()(
        world, max_depth=3, samples_per_src=rays, diffuse_reflection=True, refraction=False, seed=seed
    )
    return int(paths.a[0].numpy().size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--naive-frames", type=int, default=2)
    parser.add_argument("--sionna-frames", type=int, default=20)
    parser.add_argument("--rays", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    start = time.perf_counter()
    scene = Scene.load("office")
    route, physics = np.random.default_rng(options.seed).spawn(2)
    motion = plan_motion(scene, "handheld", options.frames * CONFIG.frame_period + 1, route)
    simulator = Simulator(scene, motion, CONFIG, physics)
    times = np.arange(options.frames) * CONFIG.frame_period
    simulator.frames(times[:BATCH])
    first = time.perf_counter() - start

    spent, echo_seconds, counts = [], [], []
    for k in range(0, options.frames, BATCH):
        start = time.perf_counter()
        _, echoes = simulator.frames(times[k : k + BATCH])
        spent.append((time.perf_counter() - start) / len(echoes))
        counts += [len(e) for e in echoes]
        start = time.perf_counter()
        simulator.echoes(times[k : k + BATCH])
        echo_seconds.append((time.perf_counter() - start) / len(echoes))
    ours, memory = float(np.median(spent)), peak_memory_mb()

    naive_seconds, error = [], []
    for t in times[:: max(options.frames // options.naive_frames, 1)][: options.naive_frames]:
        present = simulator.echoes([t])[0]
        lengths = present.lengths(CONFIG, motion, t)
        fast = simulator.synthesize(lengths, present.amplitude)
        start = time.perf_counter()
        truth = naive(lengths, present.amplitude)
        naive_seconds.append(time.perf_counter() - start)
        error.append(10 * np.log10(np.sum(np.abs(fast - truth) ** 2) / np.sum(np.abs(truth) ** 2)))

    sionna_seconds, found = [], []
    for k, t in enumerate(np.linspace(0, times[-1], options.sionna_frames + 2)):
        position, rotation = motion.position(np.array([t]))[0], motion.rotation(np.array([t]))
        forward = rotation.apply([1.0, 0.0, 0.0])[0]
        start = time.perf_counter()
        paths = sionna_paths(scene, position, float(np.arctan2(forward[1], forward[0])), options.rays, options.seed)
        if k >= 2:  # the first calls compile kernels
            sionna_seconds.append(time.perf_counter() - start)
            found.append(paths)

    def row(way: str, seconds: float, echoes: float, remark: str) -> dict[str, object]:
        return {
            "way": way,
            "ms per frame": 1e3 * seconds,
            "frames/s": 1 / seconds,
            "times slower": seconds / ours,
            "echoes or paths": int(echoes),
            "gives": remark,
        }

    publish(
        "simulator_speed",
        "Simulator speed: office, preset radarize",
        [
            row("radarsim", ours, np.mean(counts), "int16 I/Q with noise"),
            row("- of it, finding echoes", float(np.median(echo_seconds)), np.mean(counts), "echoes"),
            row("naive numpy, float64", float(np.median(naive_seconds)), np.mean(counts), "same echoes"),
            row("Sionna RT PathSolver", float(np.median(sionna_seconds)), np.mean(found), "paths, one antenna"),
        ],
        seed=options.seed,
        notes=[
            f"Fast synthesis against the naive sum of the same echoes: error power {max(error):.1f} dB (worst frame).",
            f"The radar makes {CONFIG.frame_rate:.0f} frames/s: the simulator runs at "
            f"{1 / ours / CONFIG.frame_rate:.2f} of real time. First {BATCH} frames, scene included: {first:.1f} s.",
            f"Medians over {options.frames}, {options.naive_frames} and {options.sionna_frames} frames; peak memory "
            f"{memory:.0f} MB before the references ran.",
            f"PathSolver: {options.rays:.0e} rays, depth 3, diffuse reflection.",
        ],
    )


if __name__ == "__main__":
    main()
