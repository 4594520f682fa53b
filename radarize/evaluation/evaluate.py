"""A whole run against the truth: trajectories, map, scans, velocities."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from evo.core.trajectory import PoseTrajectory3D

from radarize.evaluation.claims import pose_nees
from radarize.evaluation.mapping import free_space_iou, map_errors, scan_endpoints
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory, without_nan
from radarize.evaluation.motion import velocity_errors
from radarize.evaluation.scans import scan_errors, true_ranges
from radarize.io.alignment import Association, load, matched, trajectory, yaws
from radarize.io.errors import InputError
from radarize.pipeline.runfolder import RunFolder


def trajectory_errors(
    run: Path | RunFolder, reference: Path | None = None, association: Association = "interpolate"
) -> dict[str, TrajectoryErrors]:
    """Errors of the run's trajectories, by ``odometry`` and ``slam``.

    Args:
        reference: TUM file of the truth; by default the run's ``reference.tum``.
        association: see `radarize.io.alignment.matched`.

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


def true_scans(scans: Mapping[str, np.ndarray], truth: TrajectoryErrors) -> tuple[np.ndarray, ...]:
    """Positions, yaw, azimuths and ranges of what the radar could return, in the reference's frame."""
    azimuths = scans["truth/scan_azimuths"]
    inside = (azimuths >= scans["azimuths"].min()) & (azimuths <= scans["azimuths"].max())
    still = np.zeros((len(scans["time"]), 7))
    still[:, 6] = 1
    at, poses = matched(trajectory(scans["time"], still), truth.reference, names=("scans.h5", "the reference"))
    rows = np.isin(scans["time"], at.timestamps)
    return poses.positions_xyz[:, :2], yaws(poses), azimuths[inside], scans["truth/scan"][rows][:, inside]


def evaluate(
    run: Path | RunFolder, reference: Path | None = None, errors: dict[str, TrajectoryErrors] | None = None
) -> dict[str, object]:
    """Compare a run with the truth. Nothing is written, see `RunFolder.write_metrics`.

    Args:
        reference: TUM file of the truth; by default the run's ``reference.tum``.
        errors: of its trajectories (`trajectory_errors`), where they are at hand.

    Returns:
        ``slam`` and ``odometry``: `TrajectoryErrors.summary`, of SLAM with ``nees``, see
        `radarize.evaluation.claims.pose_nees`. Where the run knows the truth about them, ``map``:
        `map_errors`, ``scans``: `scan_errors`, ``velocity``: `velocity_errors`. Numbers that do not exist are None.
        Where the run tells it, ``blind``: `radarize.odometry.observability.UnobservableSpans`.

    Raises:
        InputError: not a run, no truth, or nothing that matches.
    """
    run = run if isinstance(run, RunFolder) else RunFolder(run)
    errors = errors or trajectory_errors(run, reference)
    summaries = {name: item.summary() for name, item in errors.items()}
    metrics: dict[str, object] = {**summaries}
    metrics["reference"] = Path(reference).name if reference else "reference.tum"
    scans, grid, best = run.scans, run.map, errors["slam"]
    if "trajectory_covariance" in scans:
        summaries["slam"]["nees"] = pose_nees(best, run.trajectory[0], scans["trajectory_covariance"])
    if scans_known := {"truth/scan", "truth/scan_azimuths"} <= scans.keys():
        there = true_ranges(scans["azimuths"], scans["truth/scan"], scans["truth/scan_azimuths"])
        metrics["scans"] = scan_errors(scans["ranges"], there)
    if {"velocity", "truth/velocity"} <= scans.keys():
        metrics["velocity"] = velocity_errors(
            scans["velocity"][:, :2], scans["truth/velocity"][:, :2], scans.get("velocity_covariance")
        )
    if "truth/floor_plan" in scans and grid is not None:
        true = true_scans(scans, best) if scans_known else None
        seen = scan_endpoints(*true) if true else None
        figures = map_errors(grid, scans["truth/floor_plan"], best.turn, best.shift, seen)
        if true:
            figures["free_iou"] = free_space_iou(grid, best.turn, best.shift, *true)
        metrics["map"] = figures
    if run.unobservable_spans:
        metrics["blind"] = run.unobservable_spans.model_dump()
    return without_nan(metrics)
