"""How much of a picture simulated rooms fill beside real ones: RadarHD's walks (Prabhakara et al., ICRA 2023) and walks
by cart with the same chirps, both through the picture chain of that paper.

A picture (`radarize.polar`) keeps cells of at least 5 % of the frame's largest magnitude. Levels of clutter and
unevenness were chosen beside the training walks; the test walks are only reported. The beam of the real pictures, too,
is told from training walks alone: what a row of four or of eight antennas makes of a lone echo is laid upon the row of
each frame's strongest cell.
"""

import argparse
import io
import lzma
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
from jaxtyping import Bool, UInt8

from benchmarks.results import SHARED, Data, Page, Walk, script, tracked, walked
from radarize import polar
from radarize.radar.presets import PRESETS
from radarize.yamlfile import read_yaml
from radarsim.motion.trajectory import Motion
from radarsim.motion.walk import Walk as WayThrough
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.world.description import find
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import IDEAL, SurfaceSettings

SCENES = "office", "buildings/a", "buildings/b", "buildings/c", "buildings/d"
#: dB, that a picture shows below its largest.
DEPTH = -20 * np.log10(polar.THRESHOLD)
#: Chirps of the real walks, one loop of a frame.
CONFIG = PRESETS["radarhd"].model_copy(update={"loops": 1})


def shares(kept: Bool[np.ndarray, "frame range azimuth"]) -> tuple[float, float, float]:
    """Cells kept, ranges with any, and azimuths lit at such a range, each as a share."""
    lit = kept.any(axis=2)
    return kept.mean(), lit.mean(), kept.sum(axis=2)[lit].mean() / polar.COLUMNS


def real(folder: Path, part: str, every: int) -> tuple[list[tuple[float, float, float]], dict[int, list[float]]]:
    """Shares of each real walk of a part (train, test), of every few frames, and the misfits of both beams."""
    found, misfits = [], {4: [], 8: []}
    for path in sorted((folder / "walks").glob("*.npz.xz")):
        with np.load(io.BytesIO(lzma.open(path).read())) as walk:
            if str(walk["part"]) == part:
                pictures = walk["radar"][::every]
                found.append(shares(pictures > 0))
                for antennas, each in misfits.items():
                    each.append(beam_misfit(pictures, antennas))
    return found, misfits


def beam_misfit(pictures: UInt8[np.ndarray, "frame range azimuth"], antennas: int) -> float:
    """Median over frames of the RMS difference, dB, between the row of the strongest cell and the beam of so many
    antennas half a wavelength apart that points anywhere near it."""
    sines, misfits = np.sin(polar.AZIMUTHS), []
    for picture in pictures:
        row, column = np.unravel_index(picture.argmax(), picture.shape)
        kept = picture[row] > 0
        level = DEPTH * (picture[row, kept] / 255 - 1)
        off = sines[kept] - (sines[column] + np.linspace(-0.08, 0.08, 17))[:, None]
        beam = np.abs(np.sinc(antennas * off / 2) / np.sinc(off / 2))
        beam = np.maximum(20 * np.log10(np.maximum(beam, 1e-6)), -DEPTH)
        misfits.append(np.sqrt(np.mean((beam - level) ** 2, axis=1)).min())
    return float(np.median(misfits))


def simulated(
    name: str,
    surfaces: tuple[SurfaceSettings, SurfaceSettings],
    transmitters: tuple[int, ...],
    every: int,
    duration: float,
    seed: int,
) -> tuple[tuple, Motion]:
    """Shares of a walk by cart, of every few frames, and the walk.

    Args:
        name: scene.
        surfaces: settings of its geometry (small objects), and of what physics adds (points, unevenness).
        transmitters: of the pictures.
        every: of so many frames one is simulated.
        duration: s.
        seed: of walk and world.
    """
    drawn, added = surfaces
    scene = Scene.of(read_yaml(find(name)) | asdict(drawn), name)
    scene = Scene(name, scene.objects, scene.movers, added)
    scenario = Scenario(scene, WayThrough("cart", duration).through(scene, seed), CONFIG, seed=seed)
    times = np.arange(0, duration, every * CONFIG.frame_period)
    parts = (times[k : k + TOGETHER] for k in range(0, len(times), TOGETHER))
    kept = [polar.pictures(scenario.frames(part).samples, CONFIG, transmitters) > 0 for part in parts]
    return shares(np.concatenate(kept)), scenario.motion


def row(about: str, found: list[tuple[float, float, float]]) -> dict[str, object]:
    """A row of the table: means over walks, and the range of what is kept."""
    kept, ranges, azimuths = 100 * np.array(found).T
    return {
        "what": about, "walks": len(found), "cells kept %": kept.mean(), "least": kept.min(), "most": kept.max(),
        "ranges with any %": ranges.mean(), "azimuths lit there %": azimuths.mean(),
    }  # fmt: skip


#: What is added to the rooms, step by step, and the transmitters of the pictures.
STEPS = {
    "bare rooms, eight antennas as published": ((IDEAL, IDEAL), polar.PUBLISHED),
    "bare rooms, four antennas as measured": ((IDEAL, IDEAL), polar.MEASURED),
    "uneven walls": ((IDEAL, SurfaceSettings(unevenness=1.0)), polar.MEASURED),
    "small objects": ((SurfaceSettings(clutter=1.0), IDEAL), polar.MEASURED),
    "points": ((IDEAL, SurfaceSettings(clutter=1.0)), polar.MEASURED),
    "clutter: small objects and points": ((SurfaceSettings(clutter=1.0), SurfaceSettings(clutter=1.0)), polar.MEASURED),
    "clutter and uneven walls": ((SurfaceSettings(1.0, 1.0), SurfaceSettings(1.0, 1.0)), polar.MEASURED),
}


@script(
    "How much of a radar's picture is filled, in simulated rooms and real ones",
    recordings=(SHARED / "radarhd", "folder of the real walks"),
    every=(10, "of so many frames one is looked at"),
    duration=(15.0, "of simulated walks, s"),
    seed=(0, "of walks and worlds"),
)
def main(options: argparse.Namespace) -> Page:
    rows, walks = [], []
    for part in ("train", "test"):
        found, misfits = real(options.recordings, part, options.every)
        rows.append(row(f"real, {part}", found))
        if part == "train":
            beams = {antennas: float(np.median(misfit)) for antennas, misfit in misfits.items()}
        walks += [Walk(f"RadarHD, {part}", None, None, simulated=False)] * len(found)
    kept = []
    for (surfaces, transmitters), name in tracked([*product(STEPS.values(), SCENES)], "walks"):
        found, motion = simulated(name, surfaces, transmitters, options.every, options.duration, options.seed)
        kept.append(found)
        walks.append(walked(name, options.seed, motion))
    rows += [row(about, kept[k * len(SCENES) : (k + 1) * len(SCENES)]) for k, about in enumerate(STEPS)]
    return Page(
        rows,
        data=Data("RadarHD's walks and walks by cart with their chirps", tuple(walks), options.seed),
        notes=[
            f"Cells of at least {100 * polar.THRESHOLD:g} % of the frame's largest magnitude, in RadarHD's picture "
            "chain (one loop, no windows, 256 ranges by 64 azimuths); means over walks, and the least and the "
            "most of any walk.",
            f"Rows of strong echoes in the training walks fit the beam of four antennas within {beams[4]:.1f} dB, "
            f"of eight within {beams[8]:.1f} dB: the published pictures are of one transmitter.",
            f"Simulated: {', '.join(SCENES)}. Levels of clutter were chosen beside the training walks; the test walks "
            "are only reported.",
        ],
    )
