"""`radarize benchmark real`: points from a real radar's pictures against the lidar beside it (`radarize.walks`)."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from radarize import polar
from radarize.benchmark.results import Data, Network, Results, command, machine
from radarize.benchmark.results import Walk as Facts
from radarize.benchmark.table import Table
from radarize.clouds import Apart
from radarize.features.windows import Windows
from radarize.methods.method import Weights
from radarize.methods.pictures.network import PictureNet
from radarize.methods.pictures.points import points
from radarize.nets.weights import Header, load
from radarize.points import Cfar, level_around
from radarize.radar.presets import PRESETS
from radarize.walks import FIRST, PERIOD, Predictions, Walk

#: What stands in every picture, by name: all cells; the first one of each azimuth that stands out; all that do.
_CFAR = Cfar(window=8, guard=4, threshold=64.0)
NOTES = (
    "Medians over all frames from the 40th on, points through the authors' grid; +-: standard error, with as many "
    "independent frames as the errors' autocorrelation leaves.",
    "`network` has seen simulated walks alone, and nothing of it was chosen on test walks. Training walks of the set "
    "told how far the radar reads beyond the lidar (0.17 to 0.34 m) and which share of a picture's cells is lit (6 to "
    "14 %), which the roughening of its training spans.",
)

Cells = Bool[np.ndarray, "range column"]


@dataclass(frozen=True)
class Options:
    """What is compared.

    Attributes:
        walks: numbers; all that test if none.
        predictions: of other programs by name.
        weights: folder of the network's weights; the shipped ones if None.
        command: that the results name.
    """

    walks: Sequence[int] = ()
    predictions: dict[str, Path] = field(default_factory=dict)
    weights: Path | None = None
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
    weights = Weights(options.weights).of("pictures")
    network = load(weights, PictureNet, PRESETS["radarhd"]) if weights.is_file() else None
    total, done, rows, errors = sum(walk.frames for walk in walks), 0, [], {}
    for walk in walks:
        found: dict[str, list[Apart]] = {}
        others = {name: Predictions(folder).points(walk) for name, folder in options.predictions.items()}
        for frame, cells in _methods(walk, network):
            done += 1
            progress(done, total)
            if frame < FIRST:
                continue
            true = polar.cartesian(walk.lidar(frame))
            clouds = {name: polar.cartesian(each) for name, each in cells.items()}
            clouds |= {name: known[frame] for name, known in others.items() if frame in known}
            for name, each in clouds.items():
                found.setdefault(name, []).append(Apart.of(each, true))
        for name, apart in found.items():
            errors[walk.number, name] = apart
            rows.append({"walk": walk.number, "part": walk.folder.name, "method": name, **_row(apart)})
    data_of = Data("RadarHD's walks", tuple(Facts(f"radarhd {walk.number}", None, None, False) for walk in walks))
    tables = [Table("Points of real walks", rows, list(NOTES)), Table("Between methods", _paired(errors))]
    results = Results("In the real world", tables, data_of, (Network.of(weights),) if network else (), options.command)
    results.write(Path(output), "real")
    return results


def _methods(walk: Walk, network: tuple[PictureNet, Header] | None) -> Iterator[tuple[int, dict[str, Cells]]]:
    """Where each method sees something in a walk's frames, frame by frame."""
    windows = network[1].windows(PRESETS["radarhd"]) if network else None
    for frames, pictures in walk.batches():
        stamps = PERIOD * np.arange(frames.start, frames.stop)
        likely = _network(network[0], windows, pictures, stamps) if network else None
        for k, picture in enumerate(pictures):
            stands = picture > level_around(picture.astype(float), _CFAR, 0, False) + _CFAR.threshold
            first = stands & (np.cumsum(stands, axis=0) == 1)
            cells = {"picture": picture > 0, "cfar": stands, "first-echo": first}
            yield frames.start + k, cells | ({"network": likely[k]} if network else {})


@torch.inference_mode()
def _network(
    net: PictureNet, windows: Windows, pictures: UInt8[np.ndarray, "frame range azimuth"], stamps: np.ndarray
) -> Bool[np.ndarray, "frame range column"]:
    shown = windows.push({"picture": pictures.astype(np.float16)}, stamps)[0]
    return points(net.estimate(shown.maps), net.least).numpy()


def _row(found: Sequence[Apart]) -> dict[str, float]:
    chamfer, hausdorff = (np.array([getattr(one, name) for one in found]) for name in ("chamfer", "hausdorff"))
    known = np.isfinite(chamfer)
    return {
        "frames": len(found),
        "without points": int(np.count_nonzero(~known)),
        "chamfer_m": float(np.median(chamfer[known])) if known.any() else np.nan,
        "chamfer +-": median_error(chamfer[known]),
        "mod_hausdorff_m": float(np.median(hausdorff[known])) if known.any() else np.nan,
    }


def _paired(errors: dict[tuple[int, str], list[Apart]]) -> list[dict]:
    """Of each pair of methods, how much nearer the first one is, mean over walks of the mean over common frames."""
    names = list(dict.fromkeys(name for _, name in errors))
    rows = []
    for name in names:
        for other in names:
            walks = [walk for walk, each in errors if each == name and (walk, other) in errors]
            if name == other or not walks:
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
