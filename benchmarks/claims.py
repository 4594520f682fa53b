"""Whether the networks themselves know how wrong they are: turns between maps, and ranges of a claimed probability.

`radarize benchmark uncertainty` says the same of odometry, which is made of them.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks.results import Page, script, tracked
from radarize.evaluation.benchmark.dataset import Case, DataSet, groups
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.scans import true_ranges
from radarize.io.pose import wrap
from radarize.io.recording import Recording
from radarize.io.tum import planar
from radarize.odometry.learned import LearnedRotation, LearnedVelocity
from radarize.pipeline.method import Inputs
from radarize.scans import echoes
from radarize.scans.segmentation import LEAST, NEAR, SegmentationScans, likeliest
from radarize.signal.batch import Preprocessor
from radarize.signal.bearings import BEARINGS
from radarize.signal.effort import BATCH

#: Claimed probabilities of a range, from each to the next.
CLAIMS = (LEAST, 0.8, 0.9, 0.97, 1.0)
KINDS = ("translation", "rotation", "segmentation")


def judge(case: Case, networks: Networks) -> tuple[dict[str, float], np.ndarray]:
    """Claims and errors on one recording.

    Returns:
        Mean of squared error over claimed variance, by the span of a turn; and by class of `CLAIMS` how many ranges
        there are, the sum of their claimed probabilities, and how many are right.
    """
    with Recording(case.path) as recording:
        inputs = Inputs(recording.config, weights=networks.weights, recording=recording)
        preprocessor = Preprocessor(inputs.signal)
        velocity, rotation = (
            network(inputs.radar, inputs.weights.of(kind))
            for network, kind in ((LearnedVelocity, "translation"), (LearnedRotation, "rotation"))
        )
        scans = SegmentationScans(inputs.radar, inputs.weights.of("segmentation"))
        turns, ranges = [], []
        for frames, adc in recording.batches(BATCH):
            batch = preprocessor.process(adc, recording.times[frames], recording.valid(frames.start, frames.stop))
            told, _ = rotation.turns(batch, velocity.estimate(batch))
            turns.append(told)
            ranges.append(likeliest(scans.occupancy(batch)))
        yaw = planar(recording.read("truth/pose"))[:, 2]
        true = true_ranges(BEARINGS, recording.read("truth/scan"), recording.read("truth/scan_azimuths"))
    spans = {}
    for spacing, told in zip(rotation.spacings, np.concatenate(turns, axis=1), strict=True):
        error = wrap(told[spacing:, 0] - wrap(yaw[spacing:] - yaw[:-spacing]))
        spans[f"turn over {spacing * case.config.frame_period:.2f} s"] = float(np.mean(error**2 / told[spacing:, 1]))
    bins, claimed = (np.concatenate(part) for part in zip(*ranges, strict=True))
    step = scans.ranges[1] - scans.ranges[0]
    right = np.abs(echoes.at(bins, scans.ranges) - true) <= (NEAR + 0.5) * step
    classes = np.where(claimed >= LEAST, np.digitize(claimed, CLAIMS[1:-1]), -1)
    chosen = [classes == k for k in range(len(CLAIMS) - 1)]
    return spans, np.array([[one.sum(), claimed[one].sum(), right[one].sum()] for one in chosen])


def row(name: str, found: list[tuple[dict[str, float], np.ndarray]]) -> dict[str, object]:
    """Means over recordings; ranges of all together."""
    spans, counts = [one for one, _ in found], sum(counts for _, counts in found)
    return {
        "on": name,
        "recordings": len(found),
        **{span: float(np.mean([one[span] for one in spans])) for span in spans[0]},
        **{
            f"ranges of {100 * low:.0f} to {100 * high:.0f} %": f"{100 * claimed / n:.1f}: {100 * right / n:.1f}"
            for low, high, (n, claimed, right) in zip(CLAIMS[:-1], CLAIMS[1:], counts.clip(1e-9), strict=True)
        },
    }


@script(
    "What networks claim against what they err",
    weights=(Path, "folder of the networks; by default the shipped ones"),
    data=(Path, "folder of recordings", {"required": True}),
)
def main(options: argparse.Namespace) -> Page:
    data = DataSet.load(options.data)
    networks = Networks("given", options.weights) if options.weights else Networks()
    judged = {case: judge(case, networks) for case in tracked(data.cases, "recordings")}
    return Page(
        [row(name, [judged[case] for case in members]) for name, members in groups(data.cases).items()],
        data=data.data(data.cases),
        networks=networks.used(KINDS),
        notes=[
            "Turns: squared error of what the network says of two maps so far apart over the variance that it claims; "
            "1 if that is right. To reach: 0.8 to 1.25.",
            f"Ranges, by the probability claimed: its mean, %: share within {NEAR} cells of the true surface, %.",
        ],
    )
