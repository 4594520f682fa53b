"""Whether the networks know how wrong they are, on recordings that no training saw."""

import argparse
from functools import partial
from pathlib import Path

import numpy as np
from radarize.mapping.segmentation import LEAST, NEAR, Segmentation, likeliest
from radarize.odometry.learned import LearnedRotation, LearnedVelocity

from benchmarks.evaluation import Case, add_options, cases, groups, through
from benchmarks.results import publish
from radarize.evaluation.motion import turn_errors, velocity_errors
from radarize.evaluation.scans import true_ranges
from radarize.mapping.scans import BEARINGS
from radarize.methods.registry import BEST, Inputs, Weights
from radarize.odometry.doppler import Velocities
from radarize.pipeline import BATCH
from radarize.pose import wrap
from radarize.recording import Recording
from radarize.tum import planar

#: Claimed probabilities of a range, from each to the next.
CLAIMS = (LEAST, 0.8, 0.9, 0.97, 1.0)
#: Frames over which the odometry's claims are added up: 0.03 s to 40 s.
HORIZONS = (1, 8, 30, 150, 450, 1200)


def judge(case: Case, weights: Path | None) -> dict[str, object]:
    """Claims and errors of one recording: networks alone, and the default odometry."""
    with Recording(case.path) as recording:
        inputs = Inputs(recording.config, Weights(weights), recording=recording)
        velocity = LearnedVelocity(inputs.maker, inputs.weights.of("translation"))
        rotation = LearnedRotation(inputs.maker, inputs.weights.of("rotation"))
        scans = Segmentation(inputs.maker, inputs.weights.of("segmentation"))
        odometry = inputs.odometry(BEST["odometry"])
        said, turns, ranges, steps = [], [], [], []
        for frames, adc in recording.batches(BATCH):
            spectrum = inputs.heatmaps.spectrum(adc, recording.valid(frames.start, frames.stop))
            times = recording.times[frames]
            found = velocity.estimate(spectrum, times)
            said.append(found)
            turns.append(rotation.turns(spectrum, times, found)[0])
            ranges.append(likeliest(scans.occupancy(spectrum)))
            steps.append(odometry.follow(spectrum, times))
        true_velocity, yaw = recording.read("truth/velocity")[:, :2], planar(recording.read("truth/pose"))[:, 2]
        scan, azimuths = recording.read("truth/scan"), recording.read("truth/scan_azimuths")
        period = recording.config.frame_period
    return {
        "velocity": _velocity(said, true_velocity),
        "turns": _turns(np.concatenate(turns, axis=1), rotation, yaw),
        "ranges": _ranges(*(np.concatenate(x) for x in zip(*ranges, strict=True)), inputs, scan, azimuths),
        "horizons": _horizons(steps, yaw),
        "period": period,
    }


def _velocity(said: list[Velocities], true: np.ndarray) -> dict[str, float]:
    mean, covariance = (np.concatenate([getattr(part, name) for part in said]) for name in ("velocity", "covariance"))
    return velocity_errors(mean, true, covariance)


def _turns(turns: np.ndarray, rotation: LearnedRotation, yaw: np.ndarray) -> dict[int, tuple[float, float]]:
    """By frames between the two maps: mean of squared error over claimed variance, and of squared error."""
    found = {}
    for spacing, told in zip(rotation.spacings, turns, strict=True):
        back = spacing * rotation.stride
        error = wrap(told[back:, 0] - wrap(yaw[back:] - yaw[:-back]))
        found[back] = float(np.mean(error**2 / told[back:, 1])), float(np.mean(error**2))
    return found


def _ranges(bins, claimed, inputs: Inputs, scan: np.ndarray, azimuths: np.ndarray) -> np.ndarray:
    """By class of `CLAIMS`: ranges, the sum of claimed probabilities, and how many are right."""
    axis = inputs.heatmaps.ranges
    true = true_ranges(BEARINGS, scan, azimuths)
    near = np.abs(axis[0] + bins * (axis[1] - axis[0]) - true) <= (NEAR + 0.5) * (axis[1] - axis[0])
    classes = np.digitize(claimed, CLAIMS[1:-1])
    used = claimed >= LEAST
    return np.array(
        [[(k := used & (classes == c)).sum(), claimed[k].sum(), near[k].sum()] for c in range(len(CLAIMS) - 1)]
    )


def _horizons(steps: list, yaw: np.ndarray) -> dict[int, float]:
    """Mean squared error of the default odometry's yaw over its claims, by frames over which both add up."""
    turned = np.concatenate([part.step for part in steps])[:, 2]
    claimed = np.concatenate([[0.0], np.cumsum(np.concatenate([part.covariance for part in steps])[1:, 2, 2])])
    return {
        frames: float(np.mean(turn_errors(turned, yaw, frames) ** 2 / (claimed[frames:] - claimed[:-frames])))
        for frames in HORIZONS
        if frames < len(yaw)
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_options(parser)
    parser.add_argument("--weights", type=Path, metavar="DIR", help="of the networks; by default the shipped ones")
    options = parser.parse_args()
    with cases(options.data) as found:
        judged = through(partial(judge, weights=options.weights), found, options.processes, "recordings")
    rows = []
    for name, members in groups(found).items():
        chosen = [judged[case] for case in members]
        row = {"on": name, "recordings": len(members), "velocity": np.mean([one["velocity"]["nees"] for one in chosen])}
        for back in chosen[0]["turns"]:
            row[f"turn over {back * chosen[0]['period']:.2f} s"] = np.mean([one["turns"][back][0] for one in chosen])
        counts = sum(one["ranges"] for one in chosen)
        for low, high, (count, claimed, right) in zip(CLAIMS[:-1], CLAIMS[1:], counts, strict=True):
            row[f"ranges of {100 * low:.0f} to {100 * high:.0f} %"] = (
                f"{100 * claimed / max(count, 1):.1f}: {100 * right / max(count, 1):.1f}"
            )
        for frames in HORIZONS:
            values = [one["horizons"][frames] for one in chosen if frames in one["horizons"]]
            row[f"yaw of {BEST['odometry']} over {frames * chosen[0]['period']:.3g} s"] = np.mean(values)
        rows.append(row)
    blank = dict.fromkeys(rows[0], "-")
    asked = [column for column in rows[0] if column == "velocity" or column.startswith("turn")]
    rows.append(blank | {"on": "to reach"} | dict.fromkeys(asked, "0.8 to 1.25"))
    publish(
        "uncertainty",
        "Claimed uncertainty against errors, on buildings that no training saw",
        rows,
        seed=1,
        notes=[
            "Velocity and turns: squared error of what a network says of a frame, or of two maps so far apart, over "
            "the variance that it claims, per dimension; 1 if that is right.",
            f"Ranges, by the probability claimed: its mean, %: share within {NEAR} cells of the true surface, %.",
            f"Yaw of {BEST['odometry']}: the same ratio for the whole odometry, steps' variances added as if "
            "independent. They are not: a map that lags in a turn misleads many matches alike, so claims that fit "
            "minutes are too large for single steps.",
        ],
    )


if __name__ == "__main__":
    main()
