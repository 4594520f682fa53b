"""`radarize benchmark real`: errors of methods on a real radar's pictures, with the lidar of the same rig as reference:
point clouds (`radarize.baselines.real.points`), changes of yaw, trajectories and maps
(`radarize.baselines.real.motion`).

The data set's metrics compare pictures of equal frame index, whose times differ (`radarize.baselines.walks.clock`).
Errors are reported both ways: matched by frame index, as published, and matched by time.
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
    mapped,
    matched_scans,
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
    "Chamfer and modified Hausdorff distances: medians over all frames from the 40th on, m, with points on the "
    "authors' grid; +-: standard error of the median, which accounts for the autocorrelation of the errors.",
    "`network` was trained on simulated walks only; no setting was chosen on test walks. The model card lists what was "
    "chosen on training walks of this data set.",
    "`radarhd-simulated` is RadarHD's network, trained on the same simulated walks as `network`; each cell above a "
    "probability is a point, as in the original. `RadarHD` has its authors' weights, trained on 25 real walks.",
    "Columns without `instant`: matched with the lidar's picture of the same frame index, as the authors do. Columns "
    "with `instant`: matched by time, see the table of clocks.",
    f"yaw_rmse_deg: RMSE of the change of yaw over {SPAN * PERIOD:g} s, estimated from pictures alone; `smoothed`: "
    f"with a Gaussian of {SMOOTH * PERIOD:g} s standard deviation over frames before and after. turns_rms_deg: RMS of "
    "the true changes of yaw.",
    "ate_m and map_f1 (within 20 cm): SLAM with each method's scans and an odometry with simulated errors; `lidar`: "
    "with the lidar's first points, which is the lower bound of the errors. Both are matched by time.",
)
MAP_NOTE = (
    "All methods have the same odometry: the lidar's poses with simulated errors, whose covariance is known to SLAM "
    "(`radarize.baselines.real.motion`). Columns with `alone`: odometry is scan matching as well; for `network` with "
    "changes of yaw by the network `picture-turns`. The reference map has the cells of 5 cm in which the lidar has "
    "points in at least three frames. odometry_ate_m: ATE without SLAM, m."
)

CLOCK_NOTE = (
    "start_s, end_s: delay of the lidar's picture against the radar's of equal frame index, at start and end of a "
    "walk; mean correlation of pictures matched by frame index and by time; halves differ_s: largest difference "
    "between the clocks of two halves of the walk. Clocks are estimated from the pictures alone "
    "(`radarize.baselines.walks.clock`). Rows without figures: the walk is too short or has no motion, and is matched "
    "by frame index."
)
#: Kind of the network that estimates changes of yaw.
TURNS = "picture-turns"
#: Columns of the table in the terminal.
SHOWN = (
    "walk", "method", "chamfer_m", "mod_hausdorff_m", "instant_chamfer_m", "yaw_rmse_deg", "instant_yaw_rmse_deg",
    "ate_m", "map_f1",
)  # fmt: skip


#: Figures that are logged as soon as a walk is done.
_LOGGED = ("chamfer_m", "yaw_rmse_deg", "ate_m")


@dataclass(frozen=True)
class RealOptions:
    """Options of the comparison.

    Attributes:
        walks: numbers of the walks; all test walks if empty.
        predictions: folders of other programs' point clouds by name.
        weights: folder of the networks' weights; the shipped ones if None.
        poses: folder of true poses NUMBER.tum on the lidar's clock; estimated by SLAM with the lidar if None.
        workers: number of walks processed at a time; number of cores if None.
        ray: address of a Ray cluster to use instead.
        command: command that is printed with the results.
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
    log: Callable[[str], None] = lambda line: None,
) -> Results:
    """Compare methods on the pictures of real walks, with a lidar as reference.

    Args:
        data: ``dataset_5`` of a clone of RadarHD's repository.
        output: folder to write: real.json and real.md.
        options: walks, predictions and weights.
        progress: called with (frames done, frames in all).
        log: called with a line of figures for every method on a walk that is done.

    Raises:
        InputError: no such walk, or a damaged picture.
    """
    machine()  # read now, because sources may change during a long run
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
                figures = (f"{name} {row[name]:.3g}" for name in _LOGGED if np.isfinite(row.get(name, np.nan)))
                log(f"{news.name}, {row['method']}: {', '.join(figures)}")
        else:
            done[news.name] = int(news.done)
        progress(sum(done.values()), total)
    each = [found[name] for name in jobs]
    errors = {key: distances for one in each for key, distances in one.distances.items()}
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
    """Results of a walk: rows of the tables, and distances of each method's points by walk and method."""

    rows: list[dict[str, Any]]
    clock: dict[str, float]
    maps: list[dict[str, Any]]
    distances: dict[tuple[int, str], list[Distances]]


def _compare(walk: Walk, options: RealOptions, report: Report) -> _Compared:
    """Evaluate all methods on a walk; `report` takes the number of frames done."""
    weights = Weights(options.weights)
    poses = poses_of(walk, options.poses)
    others = {name: Predictions(folder).points(walk) for name, folder in options.predictions.items()}
    clock = Clock.of(walk)
    judged = judge(walk, clock, readers(weights), others, lambda done: report(done / 2))
    turns = {"shifted pictures": shifted_turns(judged.pictures)}
    rates = network_rates(weights, judged.pictures) if weights.of(TURNS).is_file() else None
    if rates is not None:
        turns["network"] = SPAN * PERIOD * rates[:, 0]
    turns |= {f"{name}, smoothed": smoothed(each) for name, each in turns.items()}
    moved = {name: clocked_turn_errors(each, poses, clock) for name, each in turns.items()}
    maps, rows = _maps(walk, judged, poses, rates, lambda share: report(walk.frames * (1 + share) / 2)), []
    mapped_by = {str(row["method"]): row for row in maps}
    for name in dict.fromkeys([*judged.distances, *moved, *mapped_by]):
        about = {"walk": walk.number, "part": walk.folder.name, "method": name}
        row = about | _row(judged.distances.get(name, [])) | moved.get(name, {})
        best = mapped_by.get(name, {})
        rows.append(row | {"ate_m": best.get("ate_m", np.nan), "map_f1": best.get("map_f1_20cm", np.nan)})
    distances = {(walk.number, name): each for name, each in judged.distances.items()}
    return _Compared(rows, {"walk": walk.number} | clock.row(walk.frames), maps, distances)


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
    """Return a row of the table of maps for the scans of each method.

    Args:
        walk, judged: a walk, and the results of all methods on it.
        poses: true poses of the lidar's frames.
        rates: yaw rates by the network (rad/s) and their variances, for the method `network`.
        report: takes the share of methods that are done.
    """
    surface, there = surface_of(judged.clouds, poses), judged.partner >= 0
    poses = poses[judged.partner[there]]
    odometry, covariance = disturbed(poses, walk.number)
    off, rows = drift(odometry, poses), []
    for name, each in judged.ranges.items():
        ranges = each[there]
        matched, errors = matched_scans(ranges, rates[there] if name == "network" and rates is not None else None)
        alone = mapped(ranges, poses, surface, matched, errors)
        rows.append(
            {"walk": walk.number, "method": name, "odometry_ate_m": off}
            | mapped(ranges, poses, surface, odometry, covariance)
            | {"alone_odometry_ate_m": drift(matched, poses)}
            | {"alone_ate_m": alone["ate_m"], "alone_map_f1_20cm": alone["map_f1_20cm"]}
        )
        report(len(rows) / len(judged.ranges))
    return rows


def _row(found: Sequence[Distances]) -> dict[str, float]:
    chamfer = np.array([frame.by_index.chamfer for frame in found])
    known = chamfer[np.isfinite(chamfer)]
    return {
        "frames": len(found),
        "without points": len(chamfer) - len(known),
        "chamfer_m": _median(chamfer),
        "chamfer +-": median_error(known),
        "mod_hausdorff_m": _median([frame.by_index.hausdorff for frame in found]),
        "instant_chamfer_m": _median([frame.by_time.chamfer for frame in found]),
        "instant_mod_hausdorff_m": _median([frame.by_time.hausdorff for frame in found]),
        "yaw_rmse_deg": np.nan,
        "instant_yaw_rmse_deg": np.nan,
        "turns_rms_deg": np.nan,
    }


def _median(values: Iterable[float]) -> float:
    """Return the median of finite values; NaN without any."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else np.nan


def _paired(errors: dict[tuple[int, str], list[Distances]]) -> list[dict]:
    """Return the difference of Chamfer distances of each pair of methods: mean over walks of the mean over common
    frames, with its standard error over walks."""
    names = list(dict.fromkeys(name for _, name in errors))
    rows = []
    for k, name in enumerate(names):
        for other in names[:k]:
            walks = [walk for walk, each in errors if each == name and (walk, other) in errors]
            if not walks:
                continue
            row = {"method": name, "against": other, "walks": len(walks)}
            for by in Distances._fields:
                differences = []
                for walk in walks:
                    a, b = errors[walk, name], errors[walk, other]
                    common = min(len(a), len(b))  # predictions start later than the walk and end with it
                    pairs = zip(a[-common:], b[-common:], strict=True)
                    differences.append(
                        np.nanmean([getattr(one, by).chamfer - getattr(two, by).chamfer for one, two in pairs])
                    )
                count, matching = len(differences), {"by_index": "by frame index", "by_time": "by time"}[by]
                error = float(np.std(differences, ddof=1) / np.sqrt(count)) if count > 1 else np.nan
                row |= {f"chamfer difference {matching}_m": float(np.mean(differences)), f"+- {matching}": error}
            rows.append(row)
    return rows


def median_error(values: Float[np.ndarray, "frame"]) -> float:
    """Return the standard error of the median of errors of consecutive frames: sqrt(pi / 2) times that of the mean,
    with the integrated autocorrelation time up to the first zero of the autocorrelation (Geyer, 1992)."""
    if len(values) < 4 or not np.ptp(values):
        return np.nan
    centred = values - values.mean()
    spectrum = np.abs(np.fft.rfft(centred, 2 * len(values))) ** 2
    correlation = np.fft.irfft(spectrum)[: len(values)]
    correlation = correlation / correlation[0]
    vanishes = np.flatnonzero(correlation <= 0)
    time = 1 + 2 * correlation[1 : vanishes[0] if len(vanishes) else None].sum()
    return float(np.sqrt(np.pi / 2) * values.std(ddof=1) * np.sqrt(time / len(values)))
