"""`radarize benchmark real`: what methods make of a real radar's pictures, against the lidar beside it: points (here),
turns, trajectories and maps (`radarize.benchmark.realmotion`)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from radarize import polar
from radarize.benchmark.realmotion import (
    SMOOTH,
    SPAN,
    disturbed,
    drift,
    followed,
    mapped,
    network_rates,
    shifted_turns,
    smoothed,
    surface_of,
    turn_errors,
)
from radarize.benchmark.results import Data, Network, Results, command, machine
from radarize.benchmark.results import Walk as Facts
from radarize.benchmark.table import Table
from radarize.clouds import Apart
from radarize.features.windows import Windows
from radarize.methods.method import Weights
from radarize.methods.pictures.memory import Memory
from radarize.methods.pictures.network import PictureNet
from radarize.methods.pictures.points import first_surfaces, points
from radarize.methods.pictures.scans import on_bearings
from radarize.nets.weights import Header, load
from radarize.points import Cfar, level_around
from radarize.radar.presets import PRESETS
from radarize.walkposes import BEARINGS, lidar_poses, scan, stamps, true_poses
from radarize.walks import FIRST, PERIOD, Predictions, Walk

#: What stands in every picture, by name: all cells; the first one of each azimuth that stands out; all that do.
_CFAR = Cfar(window=8, guard=4, threshold=64.0)
_BEFORE = ("picture", "cfar")
NOTES = (
    "Medians over all frames from the 40th on, points through the authors' grid; +-: standard error, with as many "
    "independent frames as the errors' autocorrelation leaves.",
    "`network` has seen simulated walks alone, and nothing of it was chosen on test walks. Training walks of the set "
    "told what the model card names.",
    f"Turns over {SPAN * PERIOD:g} s, from pictures alone; `smoothed`: with those before and after them, by a Gaussian "
    f"of {SMOOTH * PERIOD:g} s standard deviation, so known later.",
    "ATE and map (F1 within 20 cm) of SLAM with each method's scans and an odometry whose errors are drawn; `lidar`: "
    "with the lidar's own first points, the best there is.",
)
MAP_NOTE = (
    "With the same odometry for all methods: the lidar's poses with errors added, see `radarize.benchmark.realmotion`; "
    "`alone`: odometry, too, is by matching scans, for `network` with the turns that its partner tells. Maps against "
    "the lidar's points at its poses, of which three frames have seen a cell of 5 cm. `odometry`: its ATE without SLAM."
)

#: Columns that a terminal shows.
SHOWN = ("walk", "method", "chamfer_m", "mod_hausdorff_m", "yaw_rmse_deg", "turns_rms_deg", "ate_m", "map_f1")

Cells = Bool[np.ndarray, "range column"]
Ranges = Float[np.ndarray, "bearing"]


@dataclass(frozen=True)
class Options:
    """What is compared.

    Attributes:
        walks: numbers; all that test if none.
        predictions: of other programs by name.
        weights: folder of the networks' weights; the shipped ones if None.
        poses: folder of true poses, NUMBER.tum; by SLAM with the lidar's scans if None.
        command: that the results name.
    """

    walks: Sequence[int] = ()
    predictions: dict[str, Path] = field(default_factory=dict)
    weights: Path | None = None
    poses: Path | None = None
    command: str = field(default_factory=lambda: command("radarize"))


def real(
    data: Path,
    output: Path,
    options: Options = Options(),  # noqa: B008
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Results:
    """Compare what methods make of real pictures with a lidar's points.

    Args:
        data: ``dataset_5`` of a clone of RadarHD's repository.
        output: folder to write: real.json and real.md.
        options: what is compared.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: no such walk, or a damaged picture.
    """
    machine()  # as things are now
    walks = [Walk.find(data, number) for number in options.walks] or Walk.tests(data)
    weights = Weights(options.weights)
    seen, turned = (weights.of(kind) for kind in ("pictures", "picture-turns"))
    scans = load(seen, PictureNet, PRESETS["radarhd"]) if seen.is_file() else None
    done, total = count(1), sum(walk.frames for walk in walks)
    rows, maps, errors = [], [], {}
    for walk in walks:
        poses = true_poses(options.poses, walk) if options.poses else lidar_poses(walk)
        others = {name: Predictions(folder).points(walk) for name, folder in options.predictions.items()}
        judged = _judged(walk, scans, others, lambda: progress(next(done), total))
        found = judged.apart
        errors |= {(walk.number, name): apart for name, apart in found.items()}
        told = {"shifted pictures": shifted_turns(judged.pictures)}
        rates = network_rates(weights, judged.pictures) if turned.is_file() else None
        if rates is not None:
            told["network"] = SPAN * PERIOD * rates[:, 0]
        told |= {f"{name}, smoothed": smoothed(each) for name, each in told.items()}
        moved = {name: turn_errors(each, poses) for name, each in told.items()}
        drawn = _maps(walk, judged, poses, rates)
        maps += drawn
        mapped_by = {row["method"]: row for row in drawn}
        for name in dict.fromkeys([*found, *moved, *mapped_by]):
            about = {"walk": walk.number, "part": walk.folder.name, "method": name}
            row = about | _row(errors.get((walk.number, name), [])) | moved.get(name, {})
            best = mapped_by.get(name, {})
            rows.append(row | {"ate_m": best.get("ate_m", np.nan), "map_f1": best.get("map_f1_20cm", np.nan)})
    data_of = Data("RadarHD's walks", tuple(Facts(f"radarhd {walk.number}", None, None, False) for walk in walks))
    tables = [
        Table("Real walks", rows, list(NOTES)),
        Table("Between methods", _paired(errors)),
        Table("SLAM and maps", maps, [MAP_NOTE]),
    ]
    networks = tuple(Network.of(path) for path in (seen, turned) if path.is_file())
    results = Results("In the real world", tables, data_of, networks, options.command)
    results.write(Path(output), "real")
    return results


class _Judged(NamedTuple):
    """A walk.

    Attributes:
        apart: of each method, how far its points are from the lidar's in every frame that is judged.
        ranges: scans of each method, and of the lidar.
        clouds: the lidar's points.
        pictures: the radar's.
    """

    apart: dict[str, list[Apart]]
    ranges: dict[str, Float[np.ndarray, "frame bearing"]]
    clouds: list[Float[np.ndarray, "point 2"]]
    pictures: UInt8[np.ndarray, "frame range azimuth"]


def _judged(
    walk: Walk,
    network: tuple[PictureNet, Header] | None,
    others: dict[str, dict[int, Float[np.ndarray, "point 2"]]],
    step: Callable[[], None],
) -> _Judged:
    """Go through a walk's frames once; `step` is called after each."""
    found = _Judged({}, {}, [], np.empty((walk.frames, polar.ROWS, polar.COLUMNS), np.uint8))
    for frame, picture, cells, first in _methods(walk, network):
        true = polar.cartesian(walk.lidar(frame))
        found.pictures[frame] = picture
        found.clouds.append(true)
        clouds = {name: polar.cartesian(each) for name, each in cells.items()}
        clouds |= {name: known[frame] for name, known in others.items() if frame in known}
        for name, each in clouds.items():
            if frame >= FIRST:
                found.apart.setdefault(name, []).append(Apart.of(each, true))
        # The nearest points; pictures and CFAR have many that stand before a surface.
        scans = {name: scan(each) for name, each in (clouds | {"lidar": true}).items() if name not in _BEFORE}
        for name, each in (scans | first).items():
            if name not in found.ranges:
                found.ranges[name] = np.full((walk.frames, len(BEARINGS)), np.nan)
            found.ranges[name][frame] = each
        step()
    return found


def _maps(
    walk: Walk,
    judged: _Judged,
    poses: Float[np.ndarray, "frame 3"],
    rates: Float[np.ndarray, "frame 2"] | None,
) -> list[dict[str, object]]:
    """A row for the scans of each method; `rates` of turning are those of our networks alone."""
    surface, odometry = surface_of(judged.clouds, poses), disturbed(poses, walk.number)
    off, rows = drift(odometry, poses), []
    for name, each in judged.ranges.items():
        matched, covariance = followed(each, rates if name == "network" else None)
        alone = mapped(each, poses, surface, matched, covariance)
        rows.append(
            {"walk": walk.number, "method": name, "odometry_ate_m": off}
            | mapped(each, poses, surface, odometry)
            | {"alone_odometry_ate_m": drift(matched, poses)}
            | {"alone_ate_m": alone["ate_m"], "alone_map_f1_20cm": alone["map_f1_20cm"]}
        )
    return rows


def _methods(
    walk: Walk, network: tuple[PictureNet, Header] | None
) -> Iterator[tuple[int, UInt8[np.ndarray, "range azimuth"], dict[str, Cells], dict[str, Ranges]]]:
    """A walk's pictures, frame by frame, where each method sees something in them, and scans of those that tell first
    surfaces themselves."""
    windows, memory = (network[1].windows(PRESETS["radarhd"]), Memory()) if network else (None, None)
    times = stamps(walk.frames)
    for frames, pictures in walk.batches():
        likely = _network(network[0], windows, memory, pictures, times[frames]) if network else None
        for k, picture in enumerate(pictures):
            stands = picture > level_around(picture.astype(float), _CFAR, 0, False) + _CFAR.threshold
            nearest = stands & (np.cumsum(stands, axis=0) == 1)
            cells, first = {"picture": picture > 0, "cfar": stands, "first-echo": nearest}, {}
            if likely:
                cells["network"], first["network"] = (each[k] for each in likely)
            yield frames.start + k, picture, cells, first


@torch.inference_mode()
def _network(
    net: PictureNet,
    windows: Windows,
    memory: Memory,
    pictures: UInt8[np.ndarray, "frame range azimuth"],
    times: Float[np.ndarray, "frame"],
) -> tuple[Bool[np.ndarray, "frame range column"], Float[np.ndarray, "frame bearing"]]:
    """Points of a batch's frames, and their scans."""
    shown = windows.push({"picture": pictures.astype(np.float16)}, times)[0]
    likely = net.estimate(shown.maps)
    # Maps average over time themselves: their scans are each frame's own.
    return points(memory.push(likely, times), net.dense).numpy(), on_bearings(first_surfaces(likely), BEARINGS)


def _row(found: Sequence[Apart]) -> dict[str, float]:
    chamfer, hausdorff = (np.array([getattr(one, name) for one in found]) for name in ("chamfer", "hausdorff"))
    known = np.isfinite(chamfer)
    return {
        "frames": len(found),
        "without points": int(np.count_nonzero(~known)),
        "chamfer_m": float(np.median(chamfer[known])) if known.any() else np.nan,
        "chamfer +-": median_error(chamfer[known]),
        "mod_hausdorff_m": float(np.median(hausdorff[known])) if known.any() else np.nan,
        "yaw_rmse_deg": np.nan,
        "turns_rms_deg": np.nan,
    }


def _paired(errors: dict[tuple[int, str], list[Apart]]) -> list[dict]:
    """Of each pair of methods, how much nearer the first one is, mean over walks of the mean over common frames."""
    names = list(dict.fromkeys(name for _, name in errors))
    rows = []
    for k, name in enumerate(names):
        for other in names[:k]:
            walks = [walk for walk, each in errors if each == name and (walk, other) in errors]
            if not walks:
                continue
            apart = []
            for walk in walks:
                a, b = errors[walk, name], errors[walk, other]
                common = min(len(a), len(b))  # predictions begin later, and end with the walk
                pairs = zip(a[-common:], b[-common:], strict=True)
                apart.append(np.nanmean([one.chamfer - two.chamfer for one, two in pairs]))
            spread = float(np.std(apart, ddof=1) / np.sqrt(len(apart))) if len(apart) > 1 else np.nan
            rows.append(
                {
                    "method": name,
                    "against": other,
                    "walks": len(walks),
                    "chamfer apart_m": float(np.mean(apart)),
                    "+-": spread,
                }
            )
    return rows


def median_error(values: Float[np.ndarray, "frame"]) -> float:
    """Standard error of the median of consecutive frames' errors: sqrt(pi / 2) that of the mean, which has as many
    independent frames as the sum of the autocorrelation until it first vanishes leaves (Geyer, 1992)."""
    if len(values) < 4 or not np.ptp(values):
        return np.nan
    centred = values - values.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * len(values))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(values)]
    correlation = correlation / correlation[0]
    vanishes = np.flatnonzero(correlation <= 0)
    time = 1 + 2 * correlation[1 : vanishes[0] if len(vanishes) else None].sum()
    return float(np.sqrt(np.pi / 2) * values.std(ddof=1) * np.sqrt(time / len(values)))
