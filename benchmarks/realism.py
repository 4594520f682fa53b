"""How much of a picture simulated rooms fill beside real ones: RadarHD's walks (Prabhakara et al., ICRA 2023) and walks
by cart with the same chirps, both through the picture chain of that paper.

A picture is of one loop: the eight antennas in the azimuth row, Fourier transforms over samples and antennas without
windows and with the TDM slots as they are; kept are cells of at least 5 % of the frame's largest magnitude. Levels of
clutter and unevenness were chosen beside the training walks; the test walks are only reported.
"""

import io
import lzma
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Int16

from benchmarks.results import SHARED, Data, Walk, command_line, publish, walked
from radarize.console import progress
from radarize.radar.array import azimuth_row
from radarize.radar.config import RadarConfig
from radarize.yamlfile import read_yaml
from radarsim.motion import Motion
from radarsim.planner import plan_motion
from radarsim.scene.description import find
from radarsim.scene.scene import Scene
from radarsim.simulate import BATCH, Simulator

SCENES = "office", "buildings/a", "buildings/b", "buildings/c", "buildings/d"
#: Chirps of the real walks, one loop of a frame.
CONFIG = RadarConfig(
    start_frequency=77e9, slope=63.343e12, idle_time=10e-6, adc_start_time=6e-6, ramp_end_time=63.14e-6, samples=512,
    sample_rate=9.121e6, loops=1, frame_period=50e-3, tx_order=(0, 1, 2), rx_gain_db=30,
)  # fmt: skip
#: The pictures' polar grid: ranges to 10.8 m, azimuths over half a turn; cells in the first bins, and far aside, are
#: left out.
RANGES, AZIMUTHS, FARTHEST, FIRST, WIDEST = 256, 64, 10.8, 6, 70.0
#: Of the largest magnitude.
LEAST = 0.05


def picture(samples: Int16[np.ndarray, "loop tx rx sample 2"]) -> Bool[np.ndarray, "range azimuth"]:
    """Which cells of a frame's picture are kept."""
    row = samples[0].reshape(-1, *samples.shape[-2:])[azimuth_row(CONFIG)].astype(float)
    spectrum = np.fft.fft(row[..., 0] + 1j * row[..., 1], axis=1)
    size = np.abs(np.fft.fftshift(np.fft.fft(spectrum, AZIMUTHS, axis=0), axes=0)).T
    azimuth = np.rad2deg(np.arcsin(np.arange(-AZIMUTHS // 2, AZIMUTHS // 2) / (AZIMUTHS / 2)))
    size = size[:, np.abs(azimuth) <= WIDEST]
    rows = np.rint(CONFIG.range_resolution * np.arange(CONFIG.samples) / FARTHEST * (RANGES - 1)).astype(int)
    columns = np.rint((azimuth[np.abs(azimuth) <= WIDEST] / 180 + 0.5) * (AZIMUTHS - 1)).astype(int)
    seen = (np.arange(CONFIG.samples) > FIRST) & (rows < RANGES)
    size, rows = size[seen], rows[seen]
    kept = np.zeros((RANGES, AZIMUTHS), bool)
    i, j = np.nonzero(size >= LEAST * size.max())
    kept[rows[i], columns[j]] = True
    return kept


def shares(kept: Bool[np.ndarray, "frame range azimuth"]) -> tuple[float, float, float]:
    """Cells kept, ranges with any, and azimuths lit at such a range, each as a share."""
    lit = kept.any(axis=2)
    return kept.mean(), lit.mean(), kept.sum(axis=2)[lit].mean() / AZIMUTHS


def real(folder: Path, part: str, every: int) -> list[tuple[float, float, float]]:
    """Shares of each real walk of the ``train`` or ``test`` part, of every few frames."""
    found = []
    for path in sorted((folder / "walks").glob("*.npz.xz")):
        with np.load(io.BytesIO(lzma.open(path).read())) as walk:
            if str(walk["part"]) == part:
                found.append(shares(walk["radar"][::every] > 0))
    return found


def simulated(name: str, settings: dict[str, float], every: int, duration: float, seed: int) -> tuple[tuple, Motion]:
    """Shares of a walk by cart, of every few frames, and the walk.

    Args:
        name: scene.
        settings: of the scene, over those in its file.
        every: of so many frames one is simulated.
        duration: s.
        seed: of walk and world.
    """
    scene = Scene.of(read_yaml(find(name)) | settings, name)
    walk, world = np.random.default_rng(seed).spawn(2)
    motion = plan_motion(scene, "cart", duration, walk)
    simulator = Simulator(scene, motion, CONFIG, world)
    times = np.arange(0, duration, every * CONFIG.frame_period)
    frames = [simulator.frames(times[k : k + BATCH])[0] for k in range(0, len(times), BATCH)]
    return shares(np.stack([picture(frame) for frame in np.concatenate(frames)])), motion


def row(about: str, found: list[tuple[float, float, float]]) -> dict[str, object]:
    """A row of the table: means over walks, and the range of what is kept."""
    kept, ranges, azimuths = 100 * np.array(found).T
    return {
        "what": about, "walks": len(found), "cells kept %": kept.mean(), "least": kept.min(), "most": kept.max(),
        "ranges with any %": ranges.mean(), "azimuths lit there %": azimuths.mean(),
    }  # fmt: skip


#: What is added to the rooms, step by step.
STEPS = {
    "bare rooms": {"clutter": 0.0, "unevenness": 0.0},
    "uneven walls": {"clutter": 0.0},
    "clutter": {"unevenness": 0.0},
    "both": {},
}
PARSER = command_line(
    __doc__,
    recordings=(SHARED / "radarhd", "folder of the real walks"),
    every=(10, "of so many frames one is looked at"),
    duration=(15.0, "of simulated walks, s"),
    seed=(0, "of walks and worlds"),
)


def main() -> None:
    options = PARSER.parse_args()
    rows, walks = [], []
    with progress("walks") as report:
        for part in ("train", "test"):
            found = real(options.recordings, part, options.every)
            rows.append(row(f"real, {part}", found))
            walks += [Walk(f"RadarHD, {part}", None, None, simulated=False)] * len(found)
        for number, (about, settings) in enumerate(STEPS.items()):
            found = []
            for k, name in enumerate(SCENES):
                report(number * len(SCENES) + k, len(STEPS) * len(SCENES))
                kept, motion = simulated(name, settings, options.every, options.duration, options.seed)
                found.append(kept)
                walks.append(walked(name, options.seed, motion))
            rows.append(row(about, found))
    publish(
        "realism",
        "How much of a radar's picture is filled, in simulated rooms and real ones",
        rows,
        data=Data("RadarHD's walks and walks by cart with their chirps", tuple(walks), options.seed),
        networks=(),
        notes=[
            f"Cells of at least {100 * LEAST:g} % of the frame's largest magnitude, in the picture chain of RadarHD "
            "(one loop, 8 antennas, no windows, 256 ranges by 64 azimuths); means over walks, and the least and the "
            "most of any walk.",
            f"Simulated: {', '.join(SCENES)}. Levels of clutter were chosen beside the training walks; the test walks "
            "are only reported.",
        ],
    )


if __name__ == "__main__":
    main()
