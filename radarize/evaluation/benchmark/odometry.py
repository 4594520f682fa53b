"""Benchmark of odometry: trajectories (the paper's tables 2 and 3), velocities, changes of yaw, and NEES."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pandas as pd

from radarize.evaluation.benchmark.frame_errors import FrameErrors, joined, joined_yaw_errors, yaw_nees
from radarize.evaluation.benchmark.protocol import figures_of
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.study import Study
from radarize.evaluation.benchmark.table import Table, with_median
from radarize.evaluation.benchmark.trajectories import trajectory_tables
from radarize.evaluation.metrics import Statistics
from radarize.evaluation.motion import velocity_errors

#: Time span of a change of yaw of the paper's network, s.
WINDOW = 4 / 15
#: The paper's tables 2 and 3: ATE in m and rad, RE between frames in m.
PAPER: dict[str, tuple[float, ...]] = {
    "milliego": (4.100, 1.054, 0.059),
    "rnin": (2.993, 0.542, 0.018),
    "learned": (0.805, 0.366, 0.014),
    "fused": (0.805, 0.366, 0.014),
}
PAPER_PLATFORMS: dict[str, tuple[float, ...]] = {
    "milliego": (3.977, 0.817, 0.050),
    "rnin": (5.122, 1.927, 0.019),
    "learned": (1.121, 0.565, 0.013),
    "fused": (1.121, 0.565, 0.013),
}
#: Columns of the table: path of the metric in `Study.of`.
ABSOLUTE = {"ATE m": "odometry.ate.position.mean", "ATE rad": "odometry.ate.rotation.mean"}
RELATIVE = {
    f"RE per {span}, m, rad": {kind: f"odometry.re.{span}.{kind}.mean" for kind in ("position", "rotation")}
    for span in ("frame", "second", "metre")
}
NOTES = (
    "ATE: mean error after alignment without scale, mean over trajectories; RE: mean relative errors. median, 90 %, "
    "bias: of the velocity error, m/s; the bias is along the motion, positive: estimated too fast.",
    "NEES: normalised estimation error squared per dimension, 1 if covariances are consistent; in brackets the median "
    "over its expectation.",
    "Targets: ATE 0.4 m and 0.18 rad, on unseen platforms 0.56 m and 0.28 rad; velocity RMSE 0.05 m/s, yaw over "
    "0.27 s 1 deg, NEES 0.8 to 1.25.",
)
SEEN = "Shipped networks were trained on handheld, cart and robot walks; with --train not on these platforms."


def tables(study: Study, paper: dict[str, tuple[float, ...]] = PAPER) -> list[Table]:
    """Return tables of trajectory errors by each protocol, and of frame errors by platform and building."""
    known = {pair: paper[pair.odometry] for pair in study.pairs if pair.odometry in paper}
    labels: dict[Pair, dict[str, object]] = {pair: {"odometry": pair.odometry} for pair in study.pairs}
    return [*trajectory_tables(study, "odometry", labels, known, "Odometry"), steps_table(study)]


def platform_tables(study: Study) -> list[Table]:
    """Return `tables` with the paper's figures for networks that were trained on the handheld platform only."""
    found = tables(study, PAPER_PLATFORMS)
    if study.options.shipped:
        found[0].notes.append(SEEN)
    return found


def steps_table(study: Study) -> Table:
    """Return the table of frame errors by platform, by building and over all recordings."""
    read = cache(lambda run: FrameErrors.read(study.output / run.place))
    rows = [
        {"odometry": pair.odometry, **group, **row(runs, list(map(read, runs["run"])))}
        for pair, group, runs in study.by_group()
    ]
    return Table("Steps and trajectories, by platform and building", rows, list(NOTES))


def row(runs: pd.DataFrame, found: Sequence[FrameErrors]) -> dict[str, object]:
    """Return a row of metrics of several recordings: over all frames, and means over trajectories."""
    frames, turns = joined(found), Statistics.of(joined_yaw_errors(found, WINDOW)[0])
    velocity = velocity_errors(frames["velocity"], frames["true_velocity"], frames["covariance"])
    relative = {name: figures_of(runs, columns).mean() for name, columns in RELATIVE.items()}
    known = np.isfinite(velocity["nees"])
    return {
        "velocity RMSE m/s": velocity["rmse"],
        "median": velocity["median"],
        "90 %": velocity["p90"],
        "bias": velocity["bias"],
        "yaw over 0.27 s, RMSE deg": float(np.rad2deg(turns.rmse)),
        **figures_of(runs, ABSOLUTE).mean(),
        **{name: ", ".join(f"{value:.4f}" for value in values) for name, values in relative.items()},
        "NEES velocity (median)": with_median(velocity["nees"], velocity["nees_median"]) if known else None,
        "NEES yaw step": yaw_nees(found, 0),
        "NEES yaw over 0.27 s": yaw_nees(found, WINDOW),
    }
