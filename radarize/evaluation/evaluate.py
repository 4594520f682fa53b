"""A whole run against the truth: trajectories, map, scans, velocities; written as metrics.json."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from evo.core.trajectory import PoseTrajectory3D

from radarize.errors import InputError
from radarize.evaluation.mapping import free_space_iou, map_errors, scan_endpoints
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory, without_nan
from radarize.evaluation.motion import velocity_errors
from radarize.evaluation.scans import scan_errors, true_ranges
from radarize.evaluation.trajectory import Association, load, matched, trajectory, yaws
from radarize.runfolder import RunFolder

#: Trajectories of a run by what the metrics call them, the best last.
TRAJECTORIES = ("odometry", "slam")


def trajectory_errors(
    run: Path | RunFolder, reference: Path | None = None, association: Association = "interpolate"
) -> dict[str, TrajectoryErrors]:
    """Errors of the run's trajectories, by ``odometry`` and ``slam``.

    Args:
        run: folder of a run.
        reference: TUM file of the truth; by default the run's ``reference.tum``.
        association: see `radarize.evaluation.trajectory.matched`.

    Raises:
        InputError: not a run, no reference, or nothing that matches.
    """
    run = run if isinstance(run, RunFolder) else RunFolder(run)
    path = reference or run.path / "reference.tum"
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected true poses (TUM); --reference names another file")
    truth = load(path)
    return {
        name: evaluate_trajectory(each, truth, association=association, names=(f"{run.path}: {name}", str(path)))
        for name, each in trajectories(run).items()
    }


def trajectories(run: RunFolder) -> dict[str, PoseTrajectory3D]:
    """Of odometry, if there is any, and of SLAM."""
    found = {"odometry": run.odometry, "slam": run.trajectory}
    return {name: trajectory(*poses) for name, poses in found.items() if poses is not None}


def true_scans(scans: Mapping[str, np.ndarray], truth: TrajectoryErrors) -> tuple[np.ndarray, ...] | None:
    """Positions, yaw, azimuths and ranges of what the radar could return, in the reference's frame; None if unknown."""
    if "truth/scan" not in scans or "truth/scan_azimuths" not in scans:
        return None
    azimuths = scans["truth/scan_azimuths"]
    inside = (azimuths >= scans["azimuths"].min()) & (azimuths <= scans["azimuths"].max())
    still = np.zeros((len(scans["time"]), 7))
    still[:, 6] = 1
    at, poses = matched(trajectory(scans["time"], still), truth.reference, names=("scans.h5", "the reference"))
    rows = np.isin(scans["time"], at.timestamps)
    return poses.positions_xyz[:, :2], yaws(poses), azimuths[inside], scans["truth/scan"][rows][:, inside]


def evaluate(run: Path | RunFolder, reference: Path | None = None) -> dict[str, object]:
    """`assess` a run, and write ``metrics.json`` into it."""
    run = run if isinstance(run, RunFolder) else RunFolder(run)
    metrics = assess(run, reference)
    run.write_metrics(metrics)
    return metrics


def assess(run: Path | RunFolder, reference: Path | None = None) -> dict[str, object]:
    """Compare a run with the truth; nothing is written.

    Args:
        run: a run, or its folder.
        reference: TUM file of the truth; by default the run's ``reference.tum``.

    Returns:
        ``slam`` and ``odometry``: `TrajectoryErrors.summary`. Where the run knows the truth about them, ``map``:
        `map_errors`, ``scans``: `scan_errors`, ``velocity``: `velocity_errors`. Numbers that do not exist are None.

    Raises:
        InputError: not a run, no truth, or nothing that matches.
    """
    run = run if isinstance(run, RunFolder) else RunFolder(run)
    errors = trajectory_errors(run, reference)
    metrics: dict[str, object] = {name: item.summary() for name, item in errors.items()}
    metrics["reference"] = Path(reference).name if reference else "reference.tum"
    scans, grid, best = run.scans, run.map, errors["slam"]
    if {"truth/scan", "truth/scan_azimuths"} <= scans.keys():
        there = true_ranges(scans["azimuths"], scans["truth/scan"], scans["truth/scan_azimuths"])
        metrics["scans"] = scan_errors(scans["ranges"], there)
    if {"velocity", "truth/velocity"} <= scans.keys():
        metrics["velocity"] = velocity_errors(
            scans["velocity"][:, :2], scans["truth/velocity"][:, :2], scans.get("velocity_covariance")
        )
    if "truth/floor_plan" in scans and grid is not None:
        true = true_scans(scans, best)
        seen = None if true is None else scan_endpoints(*true)
        metrics["map"] = map_errors(grid, scans["truth/floor_plan"], best.turn, best.shift, seen)
        if true is not None:
            metrics["map"]["free_iou"] = free_space_iou(grid, best.turn, best.shift, *true)
    return without_nan(metrics)


def show(metrics: dict) -> None:
    """Print what `evaluate` returned as tables."""
    from rich.console import Console
    from rich.table import Column, Table

    console = Console()
    names = [name for name in TRAJECTORIES if name in metrics]
    table = Table("trajectory", *(Column(name, justify="right") for name in names), header_style="bold")

    def row(label: str, unit: str, *path: str, factor: float = 1.0, digits: int = 3) -> None:
        values = []
        for name in names:
            value = metrics[name]
            for key in path:
                value = value[key]
            values.append("-" if value is None else f"{factor * value:.{digits}f} {unit}")
        table.add_row(label, *values)

    row("ATE position, mean", "m", "ate", "position", "mean")
    row("ATE position, rmse", "m", "ate", "position", "rmse")
    row("ATE position, max", "m", "ate", "position", "max")
    row("ATE rotation, mean", "rad", "ate", "rotation", "mean")
    for delta in ("frame", "second", "metre"):
        row(f"RE position over a {delta}, mean", "m", "re", delta, "position", "mean", digits=4)
        row(f"RE rotation over a {delta}, mean", "rad", "re", delta, "rotation", "mean", digits=4)
    row("mean ATE / distance", "%", "ate_share", factor=100, digits=2)
    row("end drift / distance", "%", "drift", factor=100, digits=2)
    row("distance travelled", "m", "distance", digits=1)
    console.print(table)
    for name, words in {"map": MAP_WORDS, "scans": SCAN_WORDS, "velocity": VELOCITY_WORDS}.items():
        if name in metrics:
            table = Table(name, Column("value", justify="right"), header_style="bold")
            for key, (label, unit, factor) in words.items():
                value = metrics[name].get(key)
                table.add_row(label, "-" if value is None else f"{factor * value:.3g} {unit}".strip())
            console.print(table)


#: Key of a figure to its label, unit and factor, for tables.
MAP_WORDS = {
    "precision": ("occupied cells within 10 cm of a wall (precision)", "%", 100),
    "recall": ("visible wall within 10 cm of an occupied cell (recall)", "%", 100),
    "f1": ("F1", "%", 100),
    "chamfer": ("Chamfer distance", "m", 1),
    "free_iou": ("free space, intersection over union", "%", 100),
}
SCAN_WORDS = {
    "within_10cm": ("returned bearings within 10 cm of the truth", "%", 100),
    "short": ("too near by more", "%", 100),
    "beyond": ("too far by more", "%", 100),
    "returned": ("bearings in reach that return anything", "%", 100),
    "through": ("bearings in reach that carve through a surface", "%", 100),
    "median": ("median range error", "m", 1),
}
VELOCITY_WORDS = {
    "median": ("median error", "m/s", 1),
    "p90": ("90 % within", "m/s", 1),
    "forward": ("forward, rms", "m/s", 1),
    "left": ("left, rms", "m/s", 1),
    "missing": ("frames without an estimate", "%", 100),
    "bias": ("mean along the motion", "m/s", 1),
    "nees": ("mean squared error over covariance (1 if it is honest)", "", 1),
    "nees_median": ("its median over that of honest ones", "", 1),
}
