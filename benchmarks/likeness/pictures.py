"""Bursts of radar pictures along walks: RadarHD's real walks, and simulated cart walks with the same chirps.

A burst has five frames, for the effects of motion over 0.05 to 1.2 s. Pictures are those of `radarize.signal.polar`,
with one transmitter.
"""

import io
import lzma
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from radarize.io.jobs import Report
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.walk import Walk
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

#: Chirps of the real walks, one loop of a frame.
CONFIG = PRESETS["radarhd"].model_copy(update={"loops": 1})
#: Frame offsets of a burst, and number of bursts of a walk.
OFFSETS, BURSTS = np.array([0, 1, 4, 20, 24]), 40
#: Time offsets of a burst, s; duration of a simulated walk, s.
TIMES, DURATION = OFFSETS * CONFIG.frame_period, 60.0
#: Mean speed of the real walks (1,009 m in 42,116 frames) and speed of a cart, m/s. Only the radar moves, so time
#: offsets are scaled to give the distances of the real frames.
REAL_SPEED, CART_SPEED = 0.48, PLATFORMS["cart"].speed

Bursts = UInt8[np.ndarray, "burst frame range azimuth"]


def starts(frames: int) -> np.ndarray:
    """Return the first frames of the bursts of a walk, evenly spaced."""
    return np.linspace(0, frames - 1 - OFFSETS[-1], BURSTS).astype(int)


def real(folder: Path, part: str) -> dict[int, Bursts]:
    """Return the bursts of RadarHD's walks of a part (train, test), indexed by the number of the walk."""
    found = {}
    for path in sorted((folder / "walks").glob("*.npz.xz")):
        with np.load(io.BytesIO(lzma.open(path).read())) as walk:
            if str(walk["part"]) == part:
                pictures = walk["radar"]
                found[int(path.name.split(".")[0])] = pictures[starts(len(pictures))[:, None] + OFFSETS]
    return found


@dataclass(frozen=True)
class Simulated:
    """A simulated cart walk.

    Attributes:
        scene: fields of a scene file.
        seed: seed of walk and scene.
        surfaces: fields of the scene file that are set, e.g. ``clutter``.
    """

    scene: dict
    seed: int
    surfaces: dict[str, float] = field(default_factory=dict)

    def __call__(self, report: Report) -> Bursts:
        """Simulate its bursts."""
        scene = Scene.of(self.scene | self.surfaces, self.scene["name"])
        scenario = Scenario(scene, Walk("cart", DURATION).through(scene, self.seed), CONFIG, seed=self.seed)
        begin = np.linspace(0, scenario.motion.duration - TIMES[-1] - CONFIG.frame_period, BURSTS)
        times = np.ravel(begin[:, None] + TIMES * REAL_SPEED / CART_SPEED)
        pictures = []
        for k in range(0, len(times), TOGETHER):
            frames = scenario.frames(times[k : k + TOGETHER])
            pictures.append(polar.pictures(frames.samples, CONFIG, polar.MEASURED))
            report(k / len(times))
        return np.concatenate(pictures).reshape(BURSTS, len(TIMES), polar.ROWS, polar.COLUMNS)


def buildings(number: int, seed: int) -> list[dict]:
    """Return floors of generated buildings of all styles in turn."""
    return [
        {"name": f"building {'ABCD'[k % 4]} {seed + k}", "building": {"kind": "ABCD"[k % 4], "seed": seed + k}}
        for k in range(number)
    ]
