"""Odometry by every method: velocities, turns, trajectories, and whether the claimed uncertainties are honest."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.evaluation import Case, add_options, cases, groups, through
from benchmarks.results import publish
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory
from radarize.evaluation.motion import turn_errors, velocity_errors
from radarize.evaluation.trajectory import trajectory
from radarize.methods import BEST, ODOMETRY, Inputs, Weights
from radarize.pipeline import BATCH
from radarize.recording import Recording
from radarize.tum import planar, planar_poses

#: Frames that the paper's network tells a turn over: 0.27 s.
WINDOW = 8
#: What the paper's odometry reached on its recordings, and what this one is to reach: mean ATE in m and rad.
PAPER = {"whole": (0.805, 0.366), "platforms": (1.121, 0.565)}
TARGET = {"whole": (0.40, 0.18), "platforms": (0.56, 0.28)}


@dataclass(frozen=True)
class Followed:
    """One recording by one method: errors of every frame.

    Attributes:
        velocity, velocity_covariance, true_velocity: (frame, ...) m/s, sensor frame.
        turns: (window,) errors of the yaw over `WINDOW` frames, rad; turn_variance: claimed, rad^2.
        steps, step_variance: the same from each frame to the next.
        path: errors of the trajectory.
    """

    velocity: np.ndarray
    velocity_covariance: np.ndarray
    true_velocity: np.ndarray
    turns: np.ndarray
    turn_variance: np.ndarray
    steps: np.ndarray
    step_variance: np.ndarray
    path: TrajectoryErrors


def follow(case: Case, methods: Sequence[str], weights: Path | None) -> dict[str, Followed]:
    """A recording by every method; they share its spectra and maps."""
    with Recording(case.path) as recording:
        inputs = Inputs(recording.config, Weights(weights), BEST["scans"], recording)
        odometries = {method: inputs.odometry(method) for method in methods}
        tracks = {method: [] for method in methods}
        for frames, adc in recording.batches(BATCH):
            spectrum = inputs.heatmaps.spectrum(adc, recording.valid(frames.start, frames.stop))
            for method, odometry in odometries.items():
                tracks[method].append(odometry.follow(spectrum, recording.times[frames]))
        poses, velocity = recording.read("truth/pose"), recording.read("truth/velocity")[:, :2]
        times = recording.read("truth/time")
    reference, yaw = trajectory(times, poses), planar(poses)[:, 2]
    found = {}
    for method, track in tracks.items():
        joined = {name: np.concatenate([getattr(part, name) for part in track]) for name in vars(track[0])}
        steps, variance = joined["step"][:, 2], joined["covariance"][:, 2, 2]
        claimed = np.concatenate([[0.0], np.cumsum(variance[1:])])
        found[method] = Followed(
            joined["velocity"],
            joined["velocity_covariance"],
            velocity,
            turn_errors(steps, yaw, WINDOW),
            claimed[WINDOW:] - claimed[:-WINDOW],
            turn_errors(steps, yaw, 1),
            variance[1:],
            evaluate_trajectory(trajectory(joined["time"], planar_poses(joined["pose"])), reference),
        )
    return found


def row(found: Sequence[Followed]) -> dict[str, object]:
    """Figures of several recordings: of all their frames, and means over trajectories."""

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(one, name) for one in found])

    def over_paths(part: str, delta: str | None = None) -> float:
        errors = [getattr(one.path, part) for one in found]
        return float(np.mean([(each[delta] if delta else each).mean for each in errors]))

    velocity = velocity_errors(joined("velocity"), joined("true_velocity"), joined("velocity_covariance"))
    turns, steps = joined("turns"), joined("steps")
    relative = {
        f"RE per {delta}, m, rad": f"{over_paths('relative_position', delta):.4f}, "
        f"{over_paths('relative_rotation', delta):.4f}"
        for delta in ("frame", "second", "metre")
    }
    return {
        "velocity RMSE m/s": velocity["rmse"],
        "median": velocity["median"],
        "90 %": velocity["p90"],
        "bias": velocity["bias"],
        "yaw over 0.27 s, RMSE deg": float(np.rad2deg(np.sqrt(np.mean(turns**2)))),
        "ATE m": over_paths("position"),
        "ATE rad": over_paths("rotation"),
        **relative,
        "NEES velocity (median)": f"{velocity['nees']:.2f} ({velocity['nees_median']:.2f})",
        "NEES yaw step": float(np.mean(steps**2 / joined("step_variance"))),
        "NEES yaw over 0.27 s": float(np.mean(turns**2 / joined("turn_variance"))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--methods", nargs="+", choices=ODOMETRY, default=tuple(ODOMETRY))
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    which.add_argument(
        "--platform-weights", type=Path, metavar="DIR", help="trained by hand only: tested on cart and robot"
    )
    options = parser.parse_args()
    setting = "platforms" if options.platform_weights else "whole"
    with cases(options.data) as found:
        if options.platform_weights:
            found = [case for case in found if case.platform != "handheld"]
        work = partial(follow, methods=options.methods, weights=options.platform_weights or options.weights)
        followed = through(work, found, options.processes, "recordings")
    rows = [
        {"method": method, "on": name, "recordings": len(members)} | row([followed[i][method] for i in members])
        for name, members in groups(found).items()
        for method in options.methods
    ]
    blank = dict.fromkeys(rows[0], "-")
    paper, target = PAPER[setting], TARGET[setting]
    rows.append(blank | {"method": "paper", "on": "its own recordings", "ATE m": paper[0], "ATE rad": paper[1]})
    rows.append(
        blank
        | {"method": "to reach", "ATE m": target[0], "ATE rad": target[1], "velocity RMSE m/s": 0.05}
        | {"yaw over 0.27 s, RMSE deg": 1.0}
        | dict.fromkeys(("NEES velocity (median)", "NEES yaw step", "NEES yaw over 0.27 s"), "0.8 to 1.25")
    )
    metres = sum(one[options.methods[0]].path.distance for one in followed)
    publish(
        "odometry" if setting == "whole" else "odometry_platforms",
        "Odometry on buildings that no training saw"
        + (", networks trained by hand only" if setting == "platforms" else ""),
        rows,
        seed=1,
        notes=[
            f"{len(found)} recordings, {metres:.0f} m in the plane. ATE: mean error after alignment without scale, "
            "mean over trajectories; RE: true relative errors, means. Bias: along the motion, positive: too fast.",
            "NEES: squared error over the claimed variance, per dimension, 1 if that is right; in brackets the median "
            "over its expectation. Turns over 0.27 s: eight frames whose claims are added as if independent.",
            "The paper's figures are of real recordings of its own buildings.",
        ],
    )


if __name__ == "__main__":
    main()
