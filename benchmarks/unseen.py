"""Walks on which nothing was chosen: `unseen.yaml`, in five buildings of the generator and two real floor plans.

The plans are made of lidar logs (`radarsim scene import`), which `benchmarks.slam_backend` reads, too; the back end's
preset `lidar` was chosen on their scans, but nothing of the radar's was.
"""

import argparse
import shutil
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from jaxtyping import Float
from matplotlib.figure import Figure

from benchmarks.results import FOLDER, SHARED, script
from radarize.evaluation.benchmark.dataset import DataSet
from radarize.evaluation.benchmark.followed import FrameErrors, joined, true_poses
from radarize.evaluation.benchmark.results import command
from radarize.evaluation.benchmark.study import Benchmark, Chosen, Options, Study, carry_out
from radarize.evaluation.benchmark.table import Table, with_error, with_median
from radarize.evaluation.claims import normalised
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.evaluation.motion import velocity_errors
from radarize.io.alignment import trajectory, yaws
from radarize.io.console import progress
from radarize.io.pose import Pose, between, wrap
from radarize.io.tum import planar
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.methods import BEST
from radarize.pipeline.runfolder import RunFolder
from radarsim.dataset.run import make
from radarsim.dataset.specification import Specification
from radarsim.world.importers import import_scene

#: Lidar logs by the name of the building that is made of them.
PLANS = {name: SHARED / "radish" / f"{name}-corrected.log.gz" for name in ("intel", "orebro")}
#: s: spans over which claims of poses are followed; the longest that a walk of a minute has a few of.
SPANS = (1, 10, 50)
WORST = "![The worst walk of each platform, its headings, and how many bearings see anything]({})"
#: m: no walk is to be off by more; and as a share of odometry's error, no SLAM.
LOST, WORSE = 0.30, 1.05
GOALS = (
    f"To reach: odometry 0.20 m, 0.04 rad, by hand 0.30 m; SLAM 0.08 m, 0.02 rad, no walk over {LOST:g} m, none over "
    f"{WORSE:g} x odometry; map F1 85 %; NEES 0.9 to 1.1 of velocities, 0.8 to 1.25 of poses."
)


def recorded(walks: Path, folder: Path, workers: int | None) -> DataSet:
    """The recordings that a specification lists, and the plans that it names, made as far as they are not there."""
    plans = folder / "plans"
    plans.mkdir(parents=True, exist_ok=True)
    listed = walks.read_text()
    for name, log in PLANS.items():
        if f"{name}.yaml" in listed and not (plans / f"{name}.yaml").is_file():
            import_scene(log, plans)
    specification = Specification.load(shutil.copy(walks, plans))
    with progress("recordings") as report:
        make(specification, folder, workers=workers, progress=report)
    return DataSet.load(folder)


def pose_nees(poses: Pose, true: Pose, errors: ErrorModel, starts: range, length: int) -> Float[np.ndarray, "window"]:
    """Squared error of a motion over windows of some frames over what it claims, per dimension.

    Args:
        poses, true: of each frame.
        errors: of the steps between poses.
        starts: of the windows.
        length: of each, frames.
    """
    first = np.array(starts)
    moved, truly = (between(some[first], some[first + length]) for some in (poses, true))
    return normalised(between(truly, moved), errors.motions(poses, first, length))


def row(runs: pd.DataFrame, paths: list[Path]) -> dict[str, object]:
    """Figures of some walks and of their runs' folders; means with standard errors over walks."""
    odometry, slam = runs["odometry.ate.position.mean"], runs["slam.ate.position.mean"]
    frames = joined([_followed(path) for path in paths])
    velocity = velocity_errors(frames["velocity"], frames["true_velocity"], frames["covariance"])
    return {
        "odometry m": with_error(odometry),
        "odometry rad": runs["odometry.ate.rotation.mean"].mean(),
        "SLAM m": with_error(slam),
        "SLAM rad": runs["slam.ate.rotation.mean"].mean(),
        "worst SLAM m": slam.max(),
        f"over {LOST:g} m": int((slam > LOST).sum()),
        f"SLAM over {WORSE:g} x odometry": int((slam > WORSE * odometry).sum()),
        "map F1 %": 100 * runs["map.f1"].mean(),
        "NEES velocity (median)": with_median(velocity["nees"], velocity["nees_median"]),
        **{f"NEES pose {span} s (median)": with_median(*_mean_and_median(paths, span)) for span in SPANS},
        "NEES SLAM (median)": with_median(runs["slam.nees"].mean(), runs["slam.nees"].median()),
    }


@cache
def _followed(run: Path) -> FrameErrors:
    return FrameErrors.read(run)


@cache
def _nees(run: Path, span: float) -> np.ndarray:
    """Of odometry, a window a second."""
    folder = RunFolder(run)
    times, poses = folder.odometry
    rate = 1 / np.median(np.diff(times))
    starts = range(0, len(times) - round(span * rate), round(rate))
    return pose_nees(planar(poses), true_poses(folder), folder.errors, starts, round(span * rate))


def _mean_and_median(runs: list[Path], span: float) -> tuple[float, float]:
    """Of `pose_nees`; the median over that of honest claims, 2.366 of three dimensions."""
    found = np.concatenate([_nees(run, span) for run in runs])
    return float(found.mean()), float(np.median(found) / (2.366 / 3))


def tables(study: Study) -> list[Table]:
    """By platform, building and of all; then walk by walk."""
    groups = [
        {**group, **row(runs, [study.output / run.place for run in runs["run"]])} for _, group, runs in study.by_group()
    ]
    walks = [
        {
            "walk": one["recording"],
            "seed": one["run"].case.walk.seed,
            "walked m": one["odometry.distance"],
            "odometry m": one["odometry.ate.position.mean"],
            "odometry rad": one["odometry.ate.rotation.mean"],
            "SLAM m": one["slam.ate.position.mean"],
            "SLAM rad": one["slam.ate.rotation.mean"],
            "map F1 %": 100 * one["map.f1"],
        }
        for one in study.of(study.chosen.partner).to_dict("records")
    ]
    notes = [
        "Mean error after alignment, mean over walks +- its standard error. NEES: squared error over the claimed "
        "variance, per dimension, of all frames and windows, 1 if that is right; in brackets the median over its "
        "expectation. Of SLAM: of poses since the start, mean and median over walks.",
        study.benchmark.about,
    ]
    first = Table(f"{study.benchmark.title}, by platform and building", groups, notes)
    return [first, Table("Walk by walk", walks, [])]


def draw(study: Study) -> Figure:
    """The walk of each platform on which SLAM is worst: its plan, and how far headings are off."""
    runs = study.of(study.chosen.partner)
    worst = runs.loc[runs.groupby(runs["run"].map(lambda run: run.case.platform))["slam.ate.position.mean"].idxmax()]
    figure, axes = plt.subplots(2, len(worst), figsize=(6 * len(worst), 8), height_ratios=(2, 1), squeeze=False)
    for (plan, below), run in zip(axes.T, worst["run"], strict=True):
        folder = RunFolder(study.output / run.place)
        truth = trajectory(folder.scans["truth/time"], folder.scans["truth/pose"])
        for x0, y0, x1, y1 in folder.scans["truth/floor_plan"]:
            plan.plot((x0, x1), (y0, y1), color="0.6", lw=0.5)
        for name, path, color in (("odometry", folder.odometry, "C1"), ("SLAM", folder.trajectory, "C0")):
            errors = evaluate_trajectory(trajectory(*path), truth)
            plan.plot(*errors.estimate.positions_xyz[:, :2].T, color, label=name)
            off = yaws(errors.estimate) - yaws(errors.reference)
            below.plot(errors.time - errors.time[0], np.degrees(wrap(off)), color)
        true = planar(folder.scans["truth/pose"])[:, :2]
        plan.plot(*true.T, "k--", label="true")
        (left, low), (right, high) = true.min(axis=0) - 3, true.max(axis=0) + 3
        plan.set(title=run.case.name, xlim=(left, right), ylim=(low, high), aspect="equal")
        below.set(xlabel="s", ylabel="heading off, deg")
        seen = below.twinx()
        seen.plot(folder.scans["time"] - errors.time[0], 100 * np.isfinite(folder.scans["ranges"]).mean(axis=1), "0.7")
        seen.set(ylabel="bearings that see anything, %", ylim=(0, 300))
    axes[0, 0].legend()
    figure.tight_layout()
    return figure


def judge(goals: str, title: str, name: str, options: argparse.Namespace) -> None:
    """Make the recordings of the specification of a script's name, run the pipeline on them, and write the page."""
    data = recorded(Path(__file__).with_name(f"{name}.yaml"), options.folder, options.workers)
    benchmark = Benchmark(title, goals, Chosen.by_odometry, tables)
    chosen = Options(tuple(BEST.values()), workers=options.workers, command=command(f"python -m benchmarks.{name}"))
    study = Study.plan(benchmark, data, options.output, chosen)
    with progress("runs") as report:
        carry_out([study], report)
    draw(study).savefig(FOLDER / f"{name}.png", dpi=70)
    results = study.publish()
    results.notes.append(WORST.format(f"{name}.png"))
    print(results.write(FOLDER, name).read_text())


def options_of(name: str) -> dict[str, tuple]:
    """Options of a script of that name."""
    return {
        "folder": (Path(name), "of the recordings, which are made if they are not there"),
        "output": (Path(f"{name}-runs"), "folder of the runs"),
        "workers": (2, "processes"),
    }


@script("Walks never looked at", **options_of("unseen"))
def main(options: argparse.Namespace) -> None:
    judge(GOALS, "Walks never looked at", "unseen", options)
