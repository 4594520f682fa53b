"""Benchmark on the test set: errors and NEES of each method, and plots of the walks with the largest errors."""

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure

from radarize.evaluation.benchmark.frame_errors import FrameErrors, joined, true_poses
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Chosen, Study
from radarize.evaluation.benchmark.table import NONE, Table, with_error, with_median
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.evaluation.motion import velocity_errors
from radarize.evaluation.nees import nees
from radarize.evaluation.report.page import COLORS
from radarize.io.alignment import trajectory, yaws
from radarize.io.pose import Pose, between, wrap
from radarize.io.tum import planar
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.methods import CLASSICAL
from radarize.pipeline.runfolder import RunFolder

#: Lengths of the windows for the NEES of poses, s; walks of a minute have several of the longest.
SPANS = (1, 10, 50)
#: Mean position error of SLAM above which a walk counts as lost, m; ratio to the error of odometry above which SLAM
#: made it worse.
LOST, WORSE = 0.20, 1.05
#: Columns of the table: path of the metric in `Study.of`.
ERRORS = {
    "odometry m": "odometry.ate.position.mean",
    "odometry rad": "odometry.ate.rotation.mean",
    "SLAM m": "slam.ate.position.mean",
    "SLAM rad": "slam.ate.rotation.mean",
}
NOTES = (
    "odometry, SLAM: ATE (mean error after alignment), mean over walks +- standard error; columns with `more`: "
    "difference to the first method on the same walks +- standard error. NEES: normalised estimation error squared per "
    "dimension, mean over all frames or windows, 1 if covariances are consistent; in brackets the median over its "
    "expectation. NEES SLAM: of the motion since the start, mean and median over walks."
)


def pairs(chosen: Chosen) -> list[Pair]:
    """Return pairs: all odometry with the default scans, methods without networks, and the published methods."""
    alone = [Pair(**CLASSICAL), Pair("published", "published")]
    known = [pair for pair in alone if pair.odometry in chosen.odometry and pair.scans in chosen.scans]
    others = [pair for pair in chosen.by_odometry() if pair.odometry != "published"]
    return [chosen.partner, *(pair for pair in (*others, *known) if pair != chosen.partner)]


def tables(study: Study) -> list[Table]:
    """Return tables of each pair on all walks, and of the default pair by platform and building, and by walk."""
    ours, first = study.chosen.partner, study.of(study.chosen.partner)
    methods, groups = [], []
    for pair, group, runs in study.by_group():
        found = row(runs, [study.output / run.place for run in runs["run"]])
        if group["on"] == "all":
            about = {"odometry": pair.odometry, "scans": pair.scans, "recordings": group["recordings"]}
            methods.append(about | found | _against(first, runs))
        if pair == ours:
            groups.append({"methods": str(ours)} | group | found)
    walks = [
        {
            "methods": str(ours),
            "walk": one["recording"],
            "seed": one["run"].case.walk.seed,
            "walked m": one["odometry.distance"],
            **{name: one[path] for name, path in ERRORS.items()},
            "map F1 %": 100 * one["map.f1"],
        }
        for one in first.to_dict("records")
    ]
    return [
        Table("By method, all walks", methods, [NOTES]),
        Table("By platform and building", groups),
        Table("Walk by walk", walks),
    ]


def row(runs: pd.DataFrame, paths: list[Path]) -> dict[str, object]:
    """Return a row of metrics of walks and the folders of their runs; means +- standard errors over walks."""
    odometry, slam = runs[ERRORS["odometry m"]], runs[ERRORS["SLAM m"]]
    frames = joined([_frame_errors(path) for path in paths])
    velocity = velocity_errors(frames["velocity"], frames["true_velocity"], frames["covariance"])
    return {
        "odometry m": with_error(odometry),
        "odometry rad": runs[ERRORS["odometry rad"]].mean(),
        "SLAM m": with_error(slam),
        "SLAM rad": runs[ERRORS["SLAM rad"]].mean(),
        "worst SLAM m": slam.max(),
        f"lost (over {LOST:g} m) %": 100 * (slam > LOST).mean(),
        f"SLAM over {WORSE:g} x odometry": int((slam > WORSE * odometry).sum()),
        "map F1 %": 100 * runs["map.f1"].mean() if "map.f1" in runs else None,
        "NEES velocity (median)": with_median(velocity["nees"], velocity["nees_median"]),
        **{f"NEES pose {span} s (median)": with_median(*_mean_and_median(paths, span)) for span in SPANS},
        "NEES SLAM (median)": with_median(runs["slam.nees"].mean(), runs["slam.nees"].median()),
    }


def _against(first: pd.DataFrame, runs: pd.DataFrame) -> dict[str, str]:
    """Return the difference of a method's errors to those of the first one."""
    both = first.merge(runs, on="recording", suffixes=("", " then"))
    more = {name: both[f"{ERRORS[name]} then"] - both[ERRORS[name]] for name in ("odometry m", "SLAM m")}
    return {f"{name} more": NONE if (each == 0).all() else with_error(each) for name, each in more.items()}


@cache
def _frame_errors(run: Path) -> FrameErrors:
    return FrameErrors.read(run)


def motion_nees(poses: Pose, true: Pose, errors: ErrorModel, starts: range, length: int) -> Float[np.ndarray, "window"]:
    """Return the NEES per dimension of relative motions over windows.

    Args:
        poses, true: estimated and true pose of each frame.
        errors: error model of the relative motions between frames.
        starts: first frames of the windows.
        length: length of a window, frames.
    """
    first = np.array(starts)
    moved, truly = (between(some[first], some[first + length]) for some in (poses, true))
    return nees(between(truly, moved), errors.motions(poses, first, length))


@cache
def _nees(run: Path, span: float) -> np.ndarray:
    """Return the NEES of a run's odometry, with a window every second; empty for walks shorter than a window."""
    folder = RunFolder(run)
    assert folder.odometry is not None and folder.errors is not None  # every method of odometry leaves both
    times, poses = folder.odometry
    rate = 1 / np.median(np.diff(times))
    starts = range(0, len(times) - round(span * rate), max(round(rate), 1))
    return (
        motion_nees(planar(poses), true_poses(folder), folder.errors, starts, round(span * rate))
        if starts
        else np.empty(0)
    )


def _mean_and_median(runs: list[Path], span: float) -> tuple[float, float]:
    """Return the mean NEES of runs, and the median over its expectation: 2.366 for three dimensions."""
    found = np.concatenate([_nees(run, span) for run in runs])
    return (float(found.mean()), float(np.median(found) / (2.366 / 3))) if len(found) else (np.nan, np.nan)


def worst(study: Study) -> Figure | None:
    """Plot the walk with the largest error of SLAM for each platform: trajectories, heading error, share of returns."""
    runs = study.of(study.chosen.partner)
    if not len(runs):
        return None
    shown = runs.loc[runs.groupby(runs["run"].map(lambda run: run.case.platform))[ERRORS["SLAM m"]].idxmax()]
    figure, axes = plt.subplots(2, len(shown), figsize=(6 * len(shown), 8), height_ratios=(2, 1), squeeze=False)
    for (plan, below), run in zip(axes.T, shown["run"], strict=True):
        folder = RunFolder(study.output / run.place)
        truth = trajectory(folder.scans["truth/time"], folder.scans["truth/pose"])
        for x0, y0, x1, y1 in folder.scans.get("truth/floor_plan", ()):
            plan.plot((x0, x1), (y0, y1), color="0.6", lw=0.5)
        trajectories = (("odometry", folder.odometry), ("SLAM", folder.trajectory))
        for name, path in trajectories:
            color = COLORS[name.lower()]
            assert path is not None  # every method of odometry leaves it
            errors = evaluate_trajectory(trajectory(*path), truth)
            plan.plot(*errors.estimate.positions_xyz[:, :2].T, color=color, label=name)
            off = yaws(errors.estimate) - yaws(errors.reference)
            below.plot(errors.time - errors.time[0], np.degrees(wrap(off)), color=color)
        true = planar(folder.scans["truth/pose"])[:, :2]
        plan.plot(*true.T, "k--", label="true")
        (left, low), (right, high) = true.min(axis=0) - 3, true.max(axis=0) + 3
        plan.set(
            title=run.case.name, xlim=(left, right), ylim=(low, high), aspect="equal", xlabel="x, m", ylabel="y, m"
        )
        below.set(xlabel="time, s", ylabel="heading error, deg")
        seen = below.twinx()
        seen.plot(folder.scans["time"] - errors.time[0], 100 * np.isfinite(folder.scans["ranges"]).mean(axis=1), "0.7")
        seen.set(ylabel="bearings with a return, %", ylim=(0, 100))
    axes[0, 0].legend()
    figure.tight_layout()
    return figure
