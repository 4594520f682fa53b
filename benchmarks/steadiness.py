"""How steady echoes are from frame to frame on a walk, beside rays that stand ten times as dense in the way of mirrored
paths (`radarsim.propagation.fresnelzone`).

A frame's echoes have places in the world, so that their phases at the next frame's instant are known. What the next
frame's field differs by is what motion does not explain: flashes that come into sight, and amplitudes that hang on few
rays. The first the dense reference shows, too.
"""

import argparse
from unittest.mock import patch

import numpy as np
from jaxtyping import Complex, Float

from benchmarks.results import Data, Page, script, tracked, walked
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.motion.walk import Walk
from radarsim.propagation import fresnelzone
from radarsim.propagation.lattice import Lattice
from radarsim.propagation.paths import Paths
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

SCENES = "office", "buildings/a", "buildings/b", "buildings/c", "buildings/d"
CONFIG = PRESETS["radarize"]
#: Of the field's power, dB: changes above it are counted.
LIMIT = -10.0
#: Rays of the reference: to see whether a path is partly clear, how much of it, and for which amplitudes over noise.
DENSE = {
    "FEW": Lattice.fibonacci(89, 55),
    "MANY": Lattice.fibonacci(233, 144),
    "LEAST_SPLIT": fresnelzone.LEAST_SPLIT / 10,
    "LEAST_SMOOTH": fresnelzone.LEAST_SMOOTH / 10,
}
#: Hz, over the sweep.
TONES = CONFIG.center_frequency + CONFIG.bandwidth * np.linspace(-0.5, 0.5, 9)


def field(echoes: Paths, scenario: Scenario, time: float) -> Complex[np.ndarray, "virtual tone"]:
    """What is left of echoes behind the IF filters at the middle of the frame that starts then, over the sweep.

    The filters close where echoes are no longer looked for: one that leaves that range is no step for the radar.
    """
    paths = echoes.lengths(CONFIG, scenario.motion, time)[:, :, 0]
    received = echoes.amplitude * scenario.board.if_response(paths[:, 0] + 2 * CONFIG.range_bias)
    cycles = paths[..., None] * TONES / SPEED_OF_LIGHT
    return np.einsum("e,evt->vt", received, np.exp(2j * np.pi * cycles))


def changes(scenario: Scenario, times: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame-1"]:
    """Change of the field from each frame to the next that motion does not explain, dB of its power."""
    found: list[float] = []
    for first in range(0, len(times) - 1, TOGETHER - 1):
        some = times[first : first + TOGETHER]
        frames = scenario.frames(some).paths
        for before, after, time in zip(frames, frames[1:], some[1:], strict=False):
            expected, there = field(before, scenario, time), field(after, scenario, time)
            power = np.sum(np.abs(there - expected) ** 2) / np.sum(np.abs(expected) ** 2)
            found.append(10 * np.log10(max(power, 1e-12)))  # at rest
    return np.array(found)


@script(
    "How steady echoes are from frame to frame",
    frames=(60, "of each walk"),
    start=(5.0, "of them, s after the walk's"),
    seed=(3, "of walks and worlds"),
)
def main(options: argparse.Namespace) -> Page:
    rows, walks = [], []
    for name in tracked(SCENES, "scenes"):
        scene = Scene.load(name)
        scenario = Scenario(scene, Walk("cart", 30.0).through(scene, options.seed), CONFIG, seed=options.seed)
        times = options.start + np.arange(options.frames) * CONFIG.frame_period
        speed = np.linalg.norm(np.diff(scenario.motion.position(times), axis=0), axis=1) / CONFIG.frame_period
        own = changes(scenario, times)
        with patch.multiple(fresnelzone, **DENSE):
            dense = changes(scenario, times)
        walks.append(walked(name, options.seed, scenario.motion))
        rows.append({
            "scene": name, "m/s": f"{speed.min():.1f} to {speed.max():.1f}", "frames": len(own),
            "median dB": np.median(own), f"above {LIMIT:g} dB": int(np.sum(own > LIMIT)),
            "so by dense rays": int(np.sum(dense > LIMIT)),
            "not so by dense rays": int(np.sum((own > LIMIT) & (dense <= LIMIT))),
            "most beside dense rays dB": np.max(np.maximum(own, LIMIT) - np.maximum(dense, LIMIT)),
        })  # fmt: skip
    few, many = (
        f"{len(DENSE[name].nodes)} instead of {len(getattr(fresnelzone, name).nodes)}" for name in ("FEW", "MANY")
    )
    return Page(
        rows,
        data=Data("walks by cart", tuple(walks), options.seed),
        notes=(
            "Power of what a frame's field differs by from the echoes of the frame before, carried on to its instant, "
            "over the power of the field; all antennas, nine tones over the sweep. Most beside dense rays: by how much "
            f"it is above both {LIMIT:g} dB and the reference, at most.",
            f"Dense rays: {few} to see whether a mirrored path is partly clear, {many} for how much of it, and for "
            "echoes of a tenth of the amplitude.",
        ),
    )
