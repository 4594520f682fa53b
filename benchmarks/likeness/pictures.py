"""Bursts of radar pictures along walks: RadarHD's real ones, and simulated ones by cart with the same chirps.

A burst is five frames, so that what motion does over 0.05 to 1.2 s is seen. Pictures are those of
`radarize.signal.polar`, of one transmitter.
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
#: Frames of a burst after its first one, and bursts of a walk.
OFFSETS, BURSTS = np.array([0, 1, 4, 20, 24]), 40
#: s, between frames of a burst; s, of a simulated walk.
TIMES, DURATION = OFFSETS * CONFIG.frame_period, 60.0
#: m/s, of the real walks on average (1,009 m in 42,116 frames), and of a cart. Nothing moves but the radar, so frames
#: as much nearer in time are as far apart in space as the real ones.
REAL_SPEED, CART_SPEED = 0.48, PLATFORMS["cart"].speed

Bursts = UInt8[np.ndarray, "burst frame range azimuth"]


def starts(frames: int) -> np.ndarray:
    """First frames of the bursts of a walk, evenly spread."""
    return np.linspace(0, frames - 1 - OFFSETS[-1], BURSTS).astype(int)


def real(folder: Path, part: str) -> dict[int, Bursts]:
    """Bursts of each of RadarHD's walks of a part (train, test), by number."""
    found = {}
    for path in sorted((folder / "walks").glob("*.npz.xz")):
        with np.load(io.BytesIO(lzma.open(path).read())) as walk:
            if str(walk["part"]) == part:
                pictures = walk["radar"]
                found[int(path.name.split(".")[0])] = pictures[starts(len(pictures))[:, None] + OFFSETS]
    return found


@dataclass(frozen=True)
class Simulated:
    """A simulated walk by cart.

    Attributes:
        scene: fields of a scene file.
        seed: of walk and world.
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
    """Floors of generated buildings of all styles, by turns."""
    return [
        {"name": f"building {'ABCD'[k % 4]} {seed + k}", "building": {"kind": "ABCD"[k % 4], "seed": seed + k}}
        for k in range(number)
    ]
