"""`radarize benchmark real`: what methods make of a real radar's pictures, against the lidar beside it: points
(`radarize.baselines.real.points`), turns, trajectories and maps (`radarize.baselines.real.motion`).

The data set's measures compare pictures of one number, which are not of one instant (`radarize.baselines.walks.clock`).
Both are reported: by number, as published, and by instant.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from jaxtyping import Float

from radarize.baselines.real.motion import (
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
from radarize.baselines.real.networks import READERS, readers
from radarize.baselines.real.points import Distances, Judged, judge
from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.poses import matched_by_time, poses_of
from radarize.baselines.walks.walks import PERIOD, Predictions, Walk
from radarize.evaluation.benchmark.choices import NamedWalk as Facts
from radarize.evaluation.benchmark.results import Data, Results, UsedNetwork, command, machine
from radarize.evaluation.benchmark.table import Table
from radarize.io.errors import InputError
from radarize.io.jobs import Report, perform
from radarize.pipeline.method import Weights

NOTES = (
    "Medians over all frames from the 40th on, points through the authors' grid; +-: standard error, with as many "
    "independent frames as the errors' autocorrelation leaves.",
    "`network` has seen simulated walks alone, and nothing of it was chosen on test walks. Training walks of the set "
    "told what the model card names.",
    "`radarhd-simulated` is RadarHD's network, trained on the simulated walks that `network` has seen, with its rule "
    "for points: each cell above a probability. `RadarHD` is its authors' own, trained on 25 real walks.",
    "By number: with the lidar's picture of the same number, as the authors measure. By instant (`instant`): with the "
    "lidar's picture of the same time, see the table of clocks.",
    f"Turns over {SPAN * PERIOD:g} s, from pictures alone; `smoothed`: with those before and after them, by a Gaussian "
    f"of {SMOOTH * PERIOD:g} s standard deviation, so known later.",
    "ATE and map (F1 within 20 cm) of SLAM with each method's scans and an odometry whose errors are drawn; `lidar`: "
    "with the lidar's own first points, the best there is. Both by instant.",
)
MAP_NOTE = (
    "With the same odometry for all methods: the lidar's poses with errors added, of a size that SLAM is told, see "
    "`radarize.baselines.real.motion`; `alone`: odometry, too, is by matching scans, for `network` with the turns that "
    "its partner tells. Maps against the lidar's points at its poses, of which three frames have seen a cell of 5 cm. "
    "`odometry`: its ATE without SLAM."
)

CLOCK_NOTE = (
    "By how many seconds the lidar's picture is later than the radar's of the same number, at a walk's start and end; "
    "correlation of pictures of one number, and of one instant; by how much two halves of the walk differ. By pictures "
    "alone (`radarize.baselines.walks.clock`); without figures: too short, or nothing moved, and taken as numbered."
)
#: The network that tells turns.
TURNS = "picture-turns"
#: Columns that a terminal shows.
SHOWN = (
    "walk", "method", "chamfer_m", "mod_hausdorff_m", "instant_chamfer_m", "yaw_rmse_deg", "instant_yaw_rmse_deg",
    "ate_m", "map_f1",
)  # fmt: skip


#: Figures of a walk that are said as soon as it is done.
_SAID = ("chamfer_m", "yaw_rmse_deg", "ate_m")


@dataclass(frozen=True)
class RealOptions:
    """What is compared.

    Attributes:
        walks: numbers; all that test if none.
        predictions: of other programs by name.
        weights: folder of the networks' weights; the shipped ones if None.
        poses: folder of true poses, NUMBER.tum, on the lidar's clock; by SLAM with the lidar's scans if None.
        workers: walks at a time; as many as there are cores if None.
        ray: address of a Ray cluster to use instead.
        command: that the results name.
    """

    walks: Sequence[int] = ()
    predictions: dict[str, Path] = field(default_factory=dict)
    weights: Path | None = None
    poses: Path | None = None
    workers: int | None = None
    ray: str | None = None
    command: str = field(default_factory=lambda: command("radarize"))


def real(
    data: Path,
    output: Path,
    options: RealOptions = RealOptions(),  # noqa: B008
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    say: Callable[[str], None] = lambda line: None,
) -> Results:
    """Compare what methods make of real pictures with a lidar's points.

    Args:
        data: ``dataset_5`` of a clone of RadarHD's repository.
        output: folder to write: real.json and real.md.
        options: what is compared.
        progress: called with (frames done, frames in all).
        say: takes a line for every method on a walk that is done.

    Raises:
        InputError: no such walk, or a damaged picture.
    """
    machine()  # as things are now
    walks = [Walk.find(data, number) for number in options.walks] or Walk.tests(data)
    total = sum(walk.frames for walk in walks)
    done: dict[str, int] = {}
    found: dict[str, _Compared] = {}
    jobs = {f"walk {walk.number}": partial(_compare, walk, options) for walk in walks}
    for news in perform(jobs, options.workers, options.ray):
        if news.error is not None:
            raise InputError(news.error)
        if news.ended:
            found[news.name] = compared = cast(_Compared, news.result)
            for row in compared.rows:
                figures = (f"{name} {row[name]:.3g}" for name in _SAID if np.isfinite(row.get(name, np.nan)))
                say(f"{news.name}, {row['method']}: {', '.join(figures)}")
        else:
            done[news.name] = int(news.done)
        progress(sum(done.values()), total)
    each = [found[name] for name in jobs]
    errors = {key: apart for one in each for key, apart in one.apart.items()}
    data_of = Data("RadarHD's walks", tuple(Facts.radarhd(walk.number) for walk in walks))
    tables = [
        Table("Real walks", [row for one in each for row in one.rows], list(NOTES)),
        Table("Clocks", [one.clock for one in each], [CLOCK_NOTE]),
        Table("Between methods", _paired(errors)),
        Table("SLAM and maps", [row for one in each for row in one.maps], [MAP_NOTE]),
    ]
    kinds = [*(reader.network.kind for reader in READERS.values()), TURNS]
    paths = [Weights(options.weights).of(kind) for kind in kinds]
    networks = tuple(UsedNetwork.of(path) for path in paths if path.is_file())
    results = Results("In the real world", tables, data_of, networks, options.command)
    results.write(Path(output), "real")
    return results


class _Compared(NamedTuple):
    """What comes of a walk: rows of the tables, and how far each method's points are off, by walk and method."""

    rows: list[dict[str, Any]]
    clock: dict[str, float]
    maps: list[dict[str, Any]]
    apart: dict[tuple[int, str], list[Distances]]


def _compare(walk: Walk, options: RealOptions, report: Report) -> _Compared:
    """All methods on a walk; `report` takes frames done."""
    weights = Weights(options.weights)
    poses = poses_of(walk, options.poses)
    others = {name: Predictions(folder).points(walk) for name, folder in options.predictions.items()}
    clock = Clock.of(walk)
    judged = judge(walk, clock, readers(weights), others, lambda done: report(done / 2))
    told = {"shifted pictures": shifted_turns(judged.pictures)}
    rates = network_rates(weights, judged.pictures) if weights.of(TURNS).is_file() else None
    if rates is not None:
        told["network"] = SPAN * PERIOD * rates[:, 0]
    told |= {f"{name}, smoothed": smoothed(each) for name, each in told.items()}
    moved = {name: clocked_turn_errors(each, poses, clock) for name, each in told.items()}
    maps, rows = _maps(walk, judged, poses, rates, lambda share: report(walk.frames * (1 + share) / 2)), []
    mapped_by = {str(row["method"]): row for row in maps}
    for name in dict.fromkeys([*judged.apart, *moved, *mapped_by]):
        about = {"walk": walk.number, "part": walk.folder.name, "method": name}
        row = about | _row(judged.apart.get(name, [])) | moved.get(name, {})
        best = mapped_by.get(name, {})
        rows.append(row | {"ate_m": best.get("ate_m", np.nan), "map_f1": best.get("map_f1_20cm", np.nan)})
    apart = {(walk.number, name): each for name, each in judged.apart.items()}
    return _Compared(rows, {"walk": walk.number} | clock.row(walk.frames), maps, apart)


def clocked_turn_errors(
    found: Float[np.ndarray, "frame"], poses: Float[np.ndarray, "frame 3"], clock: Clock
) -> dict[str, float]:
    """Return errors of changes of yaw up to each frame (rad), with poses matched by frame index and by time."""
    same = turn_errors(found, matched_by_time(poses, clock))
    return turn_errors(found, poses) | {"instant_yaw_rmse_deg": same["yaw_rmse_deg"]}


def _maps(
    walk: Walk,
    judged: Judged,
    poses: Float[np.ndarray, "frame 3"],
    rates: Float[np.ndarray, "frame 2"] | None,
    report: Report,
) -> list[dict[str, object]]:
    """A row for the scans of each method; `rates` of turning are those of our networks alone. `report` takes the share
    of methods that are done."""
    surface, there = surface_of(judged.clouds, poses), judged.partner >= 0
    poses = poses[judged.partner[there]]
    odometry, claimed = disturbed(poses, walk.number)
    off, rows = drift(odometry, poses), []
    for name, each in judged.ranges.items():
        ranges = each[there]
        matched, errors = followed(ranges, rates[there] if name == "network" and rates is not None else None)
        alone = mapped(ranges, poses, surface, matched, errors)
        rows.append(
            {"walk": walk.number, "method": name, "odometry_ate_m": off}
            | mapped(ranges, poses, surface, odometry, claimed)
            | {"alone_odometry_ate_m": drift(matched, poses)}
            | {"alone_ate_m": alone["ate_m"], "alone_map_f1_20cm": alone["map_f1_20cm"]}
        )
        report(len(rows) / len(judged.ranges))
    return rows


def _row(found: Sequence[Distances]) -> dict[str, float]:
    chamfer = np.array([frame.number.chamfer for frame in found])
    known = chamfer[np.isfinite(chamfer)]
    return {
        "frames": len(found),
        "without points": len(chamfer) - len(known),
        "chamfer_m": _median(chamfer),
        "chamfer +-": median_error(known),
        "mod_hausdorff_m": _median([frame.number.hausdorff for frame in found]),
        "instant_chamfer_m": _median([frame.instant.chamfer for frame in found]),
        "instant_mod_hausdorff_m": _median([frame.instant.hausdorff for frame in found]),
        "yaw_rmse_deg": np.nan,
        "instant_yaw_rmse_deg": np.nan,
        "turns_rms_deg": np.nan,
    }


def _median(values: Iterable[float]) -> float:
    """Of those that are numbers."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else np.nan


def _paired(errors: dict[tuple[int, str], list[Distances]]) -> list[dict]:
    """Of each pair of methods, how much nearer the first one is, mean over walks of the mean over common frames."""
    names = list(dict.fromkeys(name for _, name in errors))
    rows = []
    for k, name in enumerate(names):
        for other in names[:k]:
            walks = [walk for walk, each in errors if each == name and (walk, other) in errors]
            if not walks:
                continue
            row = {"method": name, "against": other, "walks": len(walks)}
            for by in Distances._fields:
                apart = []
                for walk in walks:
                    a, b = errors[walk, name], errors[walk, other]
                    common = min(len(a), len(b))  # predictions begin later, and end with the walk
                    pairs = zip(a[-common:], b[-common:], strict=True)
                    apart.append(
                        np.nanmean([getattr(one, by).chamfer - getattr(two, by).chamfer for one, two in pairs])
                    )
                spread = float(np.std(apart, ddof=1) / np.sqrt(len(apart))) if len(apart) > 1 else np.nan
                row |= {f"chamfer apart by {by}_m": float(np.mean(apart)), f"+- by {by}": spread}
            rows.append(row)
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
