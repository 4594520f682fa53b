"""Odometry by every method: trajectories (the paper's tables 2 and 3), velocities, turns, claimed uncertainties."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarize.benchmark.benchmark import Chosen, Study
from radarize.benchmark.dataset import groups
from radarize.benchmark.runs import Pair, Run
from radarize.benchmark.table import Table, mean
from radarize.benchmark.trajectories import trajectory_tables
from radarize.evaluation.motion import turn_errors, velocity_errors
from radarize.pose import wrap
from radarize.runfolder import RunFolder
from radarize.tum import planar

#: s: span that the paper's network tells a turn over.
WINDOW = 4 / 15
#: The paper's tables 2 and 3: ATE in m and rad, RE between frames in m.
PAPER = {
    "milliego": (4.100, 1.054, 0.059),
    "rnin": (2.993, 0.542, 0.018),
    "learned": (0.805, 0.366, 0.014),
    "fused": (0.805, 0.366, 0.014),
}
PAPER_PLATFORMS = {
    "milliego": (3.977, 0.817, 0.050),
    "rnin": (5.122, 1.927, 0.019),
    "learned": (1.121, 0.565, 0.013),
    "fused": (1.121, 0.565, 0.013),
}


def pairs(chosen: Chosen) -> list[Pair]:
    """Every odometry; the scans are the same."""
    return [Pair(odometry, chosen.partner.scans) for odometry in chosen.odometry]


def tables(study: Study, paper: dict[str, tuple[float, ...]] = PAPER) -> list[Table]:
    """Trajectories by each protocol; figures of all frames, by platform and building."""
    known = {pair: paper[pair.odometry] for pair in study.pairs if pair.odometry in paper}
    label = {pair: {"odometry": pair.odometry} for pair in study.pairs}
    return [*trajectory_tables(study, "odometry", label, known), steps_table(study)]


def platform_tables(study: Study) -> list[Table]:
    """The same beside the paper's table 3."""
    return tables(study, PAPER_PLATFORMS)


@dataclass(frozen=True)
class Followed:
    """One recording by one method, frame by frame.

    Attributes:
        velocity, velocity_covariance, true_velocity: (frame, ...) m/s, sensor frame.
        turns: (window,) errors of the yaw over `WINDOW`, rad; turn_variance: claimed, rad^2.
        steps, step_variance: the same from each frame to the next.
        path: `TrajectoryErrors.summary`.
    """

    velocity: np.ndarray
    velocity_covariance: np.ndarray
    true_velocity: np.ndarray
    turns: np.ndarray
    turn_variance: np.ndarray
    steps: np.ndarray
    step_variance: np.ndarray
    path: dict

    @classmethod
    def read(cls, run: Path, path: dict) -> "Followed":
        """From a run's folder, and the errors of its odometry.

        Raises:
            InputError: a damaged file.
        """
        folder = RunFolder(run)
        scans, (times, poses) = folder.scans, folder.odometry
        yaw = planar(poses)[:, 2]
        # Truth has a pose for every frame, a run one for every frame that was not lost.
        rows = (
            np.abs(scans["truth/time"][:, None] - times).argmin(axis=0)
            if len(times) != len(scans["truth/time"])
            else ...
        )
        true_yaw = planar(scans["truth/pose"])[rows, 2]
        steps, variance = wrap(np.diff(yaw, prepend=yaw[0])), scans["step_covariance"][:, 2, 2]
        window = max(round(WINDOW / float(np.median(np.diff(times)))), 1)
        claimed = np.concatenate([[0.0], np.cumsum(variance[1:])])
        return cls(
            scans["velocity"],
            scans["velocity_covariance"],
            scans["truth/velocity"][:, :2],
            turn_errors(steps, true_yaw, window),
            claimed[window:] - claimed[:-window],
            turn_errors(steps, true_yaw, 1),
            variance[1:],
            path,
        )


def steps_table(study: Study) -> Table:
    """Figures of all frames, by platform, by building and of all."""
    rows, cases, metres = [], {}, 0.0
    followed: dict[Run, Followed] = {}
    for pair in study.pairs:
        for run in study.once(pair):
            followed[run] = Followed.read(study.output / run.place, study.results[run]["odometry"])
            cases[run.case] = followed[run].path["distance"]
    metres = sum(cases.values())
    for name, members in groups(list(cases)).items():
        for pair in study.pairs:
            chosen = [followed[run] for run in study.once(pair) if run.case in members]
            if chosen:
                rows.append({"odometry": pair.odometry, "on": name, "recordings": len(chosen)} | row(chosen))
    return Table(
        "Steps and trajectories, by platform and building",
        rows,
        [
            f"{len(cases)} recordings, {metres:.0f} m in the plane. ATE: mean error after alignment without scale, "
            "mean over trajectories; RE: true relative errors, means. Bias: along the motion, positive: too fast.",
            "NEES: squared error over the claimed variance, per dimension, 1 if that is right; in brackets the median "
            f"over its expectation. Turns over {WINDOW:.2f} s: the claims of their frames are added as if independent.",
        ],
    )


def row(found: Sequence[Followed]) -> dict[str, object]:
    """Figures of several recordings: of all their frames, and means over trajectories."""

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in found])

    def relative(span: str) -> str:
        parts = [[one.path["re"][span][kind]["mean"] for one in found] for kind in ("position", "rotation")]
        return ", ".join(f"{mean(values):.4f}" for values in parts)

    velocity = velocity_errors(joined("velocity"), joined("true_velocity"), joined("velocity_covariance"))
    turns, steps = joined("turns"), joined("steps")
    return {
        "velocity RMSE m/s": velocity["rmse"],
        "median": velocity["median"],
        "90 %": velocity["p90"],
        "bias": velocity["bias"],
        "yaw over 0.27 s, RMSE deg": float(np.rad2deg(np.sqrt(np.mean(turns**2)))),
        "ATE m": mean([one.path["ate"]["position"]["mean"] for one in found]),
        "ATE rad": mean([one.path["ate"]["rotation"]["mean"] for one in found]),
        **{f"RE per {span}, m, rad": relative(span) for span in ("frame", "second", "metre")},
        "NEES velocity (median)": f"{velocity['nees']:.2f} ({velocity['nees_median']:.2f})",
        "NEES yaw step": float(np.mean(steps**2 / joined("step_variance"))),
        "NEES yaw over 0.27 s": float(np.mean(turns**2 / joined("turn_variance"))),
    }
