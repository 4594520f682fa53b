"""Whether odometry knows how wrong it is: squared errors of velocities and turns over the variances that it claims."""

import numpy as np

from radarize.benchmark.dataset import groups
from radarize.benchmark.followed import Followed, joined, turned
from radarize.benchmark.study import Study
from radarize.benchmark.table import Table
from radarize.evaluation.motion import velocity_errors

#: s: spans over which claims are added up; 0: from frame to frame.
HORIZONS = (0, 4 / 15, 1, 5, 15, 40)
NOTES = (
    "NEES: squared error over the claimed variance, per dimension, 1 if that is right, of all frames (no mean over "
    "recordings); median: over its expectation.",
    "Turns: the claims of their frames are added as if independent. They are not: a map that lags in a turn misleads "
    "many matches alike, so claims that fit minutes are too large for single steps.",
    "To reach: 0.9 to 1.1 for velocities, mean and median, on every platform.",
)


def tables(study: Study) -> list[Table]:
    """A row for every odometry on each platform, in each building and on all."""
    rows = []
    found = {
        pair: {run.case: Followed.read(study.output / run.place) for run in study.once(pair)} for pair in study.pairs
    }
    for name, members in groups(study.cases).items():
        for pair, followed in found.items():
            if here := [followed[case] for case in members if case in followed]:
                rows.append({"odometry": pair.odometry, "on": name, "recordings": len(here), **_row(here)})
    return [Table("Claimed uncertainty against errors", rows, list(NOTES))]


def _row(found: list[Followed]) -> dict[str, float]:
    frames = joined(found)
    velocity = velocity_errors(frames["velocity"], frames["true_velocity"], frames["covariance"])
    row = {"velocity": velocity["nees"], "velocity, median": velocity["nees_median"]}
    for seconds in HORIZONS:
        name = f"turn over {seconds:.2g} s" if seconds else "turn from frame to frame"
        errors, claims = turned(found, seconds)
        row[name] = float(np.mean(errors**2 / claims)) if len(errors) else np.nan
    return row
