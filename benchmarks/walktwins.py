"""Twins of real walks: what the lidar saw of RadarHD's training walks as a scene, the same drive through it simulated,
and the radar's pictures side by side.

The lidar tells where surfaces are, at its own height alone. What they are made of, how high rooms are and what stands
in them is assumed, an assumption a row. What each is worth is told by how alike the twin's pictures are to those of the
same instants, compared with those of other instants and of another walk.
"""

import argparse
import tempfile
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from jaxtyping import Float, UInt8

from benchmarks.likeness.pictures import CONFIG
from benchmarks.likeness.statistics import shares
from benchmarks.results import CLONE, POSES, Page, radarhd, script, tracked
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.poses import BEARINGS, poses_of, scan, stamps
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.io.tum import planar_poses, write_tum
from radarize.io.yamlfile import read_yaml
from radarize.signal import polar
from radarsim.motion.trajectory import motion_from_tum
from radarsim.recording.batches import TOGETHER
from radarsim.scenario import Scenario
from radarsim.twin.likeness import DEPTH, correlation, similarity
from radarsim.world.importers import Options, import_scene
from radarsim.world.scene import Scene


class Assumed(NamedTuple):
    """What the lidar does not tell.

    Attributes:
        surfaces: see `radarsim.world.surface_settings.SurfaceSettings`.
        walls: their material.
        room: floor to ceiling, m.
        sensor: its height, m.
    """

    surfaces: dict[str, float] = {"clutter": 1.0, "unevenness": 1.0}  # noqa: RUF012
    walls: str = "plasterboard"
    room: float = 2.7
    sensor: float = 1.0


ASSUMED = {
    "walls alone": Assumed(surfaces={}),
    "clutter and unevenness": Assumed(),
    "clutter x 3": Assumed(surfaces={"clutter": 3.0, "unevenness": 1.0}),
    "walls of concrete": Assumed(walls="concrete"),
    "rooms of 4 m": Assumed(room=4.0),
    "sensor at 0.5 m": Assumed(sensor=0.5),
}
#: Rows by which the twin's pictures may have to be moved: the real radar reads up to 0.34 m too far.
_BIAS = range(9)
#: Frames at either end of a walk that are left out.
_MARGIN = 30

Pictures = UInt8[np.ndarray, "frame range azimuth"]


def lidar_log(walk: Walk, poses: Float[np.ndarray, "frame 3"], folder: Path) -> Path:
    """What the walk's lidar saw, as scenes are imported from."""
    ranges = np.stack([scan(polar.cartesian(walk.lidar(frame))) for frame in range(walk.frames)])
    log, step = folder / f"{walk.number}.scans.npz", BEARINGS[1] - BEARINGS[0]
    far = np.where(np.isfinite(ranges), ranges, 2 * polar.REACH)
    np.savez(log, ranges=far, angle_min=BEARINGS[0], angle_increment=step, range_max=polar.REACH)
    write_tum(folder / f"{walk.number}.truth.tum", stamps(walk.frames), planar_poses(poses))
    return log


def scene(log: Path, assumed: Assumed) -> Path:
    """The scene that a lidar saw."""
    path = import_scene(log, log.with_name(log.name.replace(".scans.npz", ".yaml")), Options(height=assumed.room)).path
    found = read_yaml(path)
    for part in found["objects"]:
        part["material"] = assumed.walls if part["name"] == "walls" else part["material"]
    path.write_text(yaml.safe_dump(found | assumed.surfaces, sort_keys=False))
    return path


def simulated(
    path: Path, poses: Float[np.ndarray, "frame 3"], height: float, frames: Float[np.ndarray, "shown"], seed: int
) -> Pictures:
    """Pictures of the same drive, at some frames of its poses, also between them."""
    drive = planar_poses(poses)
    drive[:, 2] = height
    tum = write_tum(path.with_suffix(".drive.tum"), stamps(len(poses)), drive)
    scenario = Scenario(Scene.load(str(path)), motion_from_tum(tum), CONFIG, seed=seed)
    parts = (frames[k : k + TOGETHER] for k in range(0, len(frames), TOGETHER))
    return np.concatenate(
        [polar.pictures(scenario.frames(PERIOD * part).samples, CONFIG, polar.MEASURED) for part in parts]
    )


def likeness(ones: Pictures, others: Pictures) -> float:
    """Mean correlation of pictures, pair by pair."""
    return float(np.nanmean(correlation(ones, others)))


def structure(ones: Pictures, others: Pictures) -> float:
    """Mean MS-SSIM of pictures, pair by pair."""
    a, b = (each * (DEPTH / 255) for each in (ones, others))
    return float(np.nanmean(similarity(a, b)))


def profile(pictures: Pictures) -> Float[np.ndarray, "range"]:
    """Share of cells that are kept, over range."""
    return (pictures > 0).mean(axis=(0, 2))


def farther(pictures: Pictures, rows: int) -> Pictures:
    """Read so many rows too far."""
    return np.concatenate([np.zeros_like(pictures[:, :rows]), pictures[:, : polar.ROWS - rows]], axis=1)


def compared(twin: Pictures, own: Pictures, other: Pictures) -> dict[str, float]:
    """How alike a twin is to its own walk and to another, and how full both are."""
    bias = max(_BIAS, key=lambda rows: likeness(farther(twin, rows), own))
    twin = farther(twin, bias)
    kept, ranges, azimuths = 100 * np.array(shares(twin > 0))
    count = min(len(twin), len(other))
    return {
        "own instant": likeness(twin, own), "other instants": likeness(twin, own[::-1]),
        "other walk": likeness(twin[:count], other[:count]), "bias m": bias * polar.RANGES[1],
        "MS-SSIM": structure(twin, own), "MS-SSIM other walk": structure(twin[:count], other[:count]),
        "range profile": float(np.corrcoef(profile(twin), profile(own))[0, 1]),
        "level": float(twin[twin > 0].mean() / 255), "level in reality": float(own[own > 0].mean() / 255),
        "kept %": kept, "ranges lit %": ranges, "azimuths lit %": azimuths, "kept in reality %": 100 * (own > 0).mean(),
    }  # fmt: skip


@script(
    "Twins of real walks",
    data=CLONE,
    walks=("112,113,120", "training walks, each beside the next one"),
    poses=POSES,
    every=(15, "of so many frames one is simulated"),
    seed=(0, "of clutter, unevenness and noise"),
)
def main(options: argparse.Namespace) -> Page:
    walks = [Walk.find(options.data, int(number)) for number in options.walks.split(",")]
    shown = [np.arange(_MARGIN, walk.frames - _MARGIN, options.every) for walk in walks]
    real = [np.stack([walk.radar(k) for k in some]) for walk, some in zip(walks, shown, strict=True)]
    # Poses are of the lidar's frames, and its clock is another.
    frames = [Clock.of(walk).lidar(some) for walk, some in zip(walks, shown, strict=True)]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number, (about, assumed) in tracked([*product(range(len(walks)), ASSUMED.items())], "twins"):
            poses, other = poses_of(walks[number], options.poses), real[(number + 1) % len(walks)]
            path = scene(lidar_log(walks[number], poses, Path(folder)), assumed)
            twin = simulated(path, poses, assumed.sensor, frames[number], options.seed)
            rows.append({"walk": walks[number].number, "assumed": about, **compared(twin, real[number], other)})
    return Page(
        rows,
        data=radarhd("RadarHD's training walks", walks),
        notes=[
            "Correlation of the twin's pictures (`radarize.signal.polar`, four antennas) with real ones of the same "
            "instants, of the same walk backwards, and of another walk; the twin's are moved by as much as fits best "
            "(bias). Instants are those of the radar, whose clock is not the lidar's (`baselines.walks.clock`).",
            "MS-SSIM: of the same instants, and of another walk. Range profile: correlation of shares of cells kept "
            "over range. Level: mean of the cells kept, between the least (0) and the largest (1) of a picture.",
            "The lidar's plane is all that is known of a room: nothing above or below it, no glass, no material.",
        ],
    )
