"""Calibration from a walk (`radarize calibrate`): boards with random errors, and the ATE of odometry and SLAM with
them.

Errors are applied to the samples of simulated walks through furnished rooms, whose board is ideal: each channel is
multiplied by a complex factor, and a range bias is a frequency shift along the chirp.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.results import Data, Page, performed, script
from radarize.evaluation.benchmark.results import UsedNetwork
from radarize.evaluation.metrics import evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.jobs import Report
from radarize.io.recording import Clip, Recording
from radarize.io.tum import planar_poses
from radarize.pipeline.calibration.calibration import Calibration, calibrate, recalibrated
from radarize.pipeline.calibration.channels import centred
from radarize.pipeline.config import Configuration
from radarize.pipeline.method import Inputs, Weights
from radarize.pipeline.methods import BEST, ODOMETRY, SCANS, make_pipeline
from radarize.pipeline.session import batches
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig
from radarize.signal.batch import Preprocessor
from radarsim.receiver.frontend_config import FrontEndConfig
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene

#: Maximum errors of a board, uniformly distributed: phases (deg) and gains (dB) of all channels, range bias (m).
PHASE, GAIN, BIAS = 30.0, 2.0, 0.2
PLATFORMS, KINDS = ("handheld", "cart"), "ABCD"
#: Conditions that are compared.
USES = ("perfect", "uncalibrated", "calibrated")
#: Networks of the default methods.
NETWORKS = (*ODOMETRY[BEST["odometry"]].networks, *SCANS[BEST["scans"]].networks)


class Distorted(Recording):
    """A recording with the channel errors (tx, rx) and the range bias (m) of a board."""

    factors, bias = np.ones((1, 1)), 0.0

    def adc(self, start: int, stop: int) -> np.ndarray:
        """Return samples with the errors, rounded and saturated again."""
        c = self.config
        times = (np.arange(c.samples) - (c.samples - 1) / 2) / c.sample_rate
        shift = np.exp(4j * np.pi * c.slope * self.bias / SPEED_OF_LIGHT * times)
        error = (self.factors[c.channels][..., None] * shift).astype(np.complex64)
        iq = np.ascontiguousarray(super().adc(start, stop), np.float32).view(np.complex64)[..., 0] * error
        counts = np.clip(np.rint(iq.view(np.float32)), -32768, 32767).astype(np.int16)
        return counts.reshape(*iq.shape, 2)


class Trial(NamedTuple):
    """A walk with a seed, and the folder of its recording; the board's errors are drawn from the same seed."""

    seed: int
    platform: str
    kind: str
    folder: Path
    duration: float
    configuration: Configuration = Configuration()

    @property
    def path(self) -> Path:
        return self.folder / f"{self.kind.lower()}-{self.platform}-{self.seed}.h5"

    def record(self, _: Report) -> None:
        """Simulate the walk if its recording does not exist."""
        if not self.path.is_file():
            scene = Scene.of({"building": {"kind": self.kind, "seed": self.seed}}, f"{self.kind} of {self.seed}")
            front_end = FrontEndConfig.of("iwr1843boost", mismatch=None)
            simulate(
                scene, self.path, platform=self.platform, duration=self.duration, seed=self.seed, frontend=front_end
            )

    def distorted(self) -> Distorted:
        """Return the recording with the errors of a board."""
        rng, recording = np.random.default_rng((self.seed, 56)), Distorted(self.path)
        gain, phase = rng.uniform(-GAIN, GAIN, (3, 4)), np.radians(rng.uniform(-PHASE, PHASE, (3, 4)))
        recording.factors, recording.bias = 10 ** (gain / 20) * np.exp(1j * phase), float(rng.uniform(-BIAS, BIAS))
        return recording

    def outcome(self, _: Report) -> dict[str, object]:
        """Return errors of the calibration, and ATE under each condition; stored beside the recording."""
        kept = self.path.with_suffix(".json")
        if kept.is_file():
            return json.loads(kept.read_text())
        with self.distorted() as recording, Recording(self.path) as perfect:
            found = calibrate(recording)
            errors = self._errors(recording, found)
            clips = perfect[:], recording[:], recalibrated(recording[:], found.config)
            for use, clip in zip(USES, clips, strict=True):
                errors |= dict(zip((f"odometry {use}", f"SLAM {use}"), self._ate(clip), strict=True))
        errors = {name: value if isinstance(value, str) else float(value) for name, value in errors.items()}
        kept.write_text(json.dumps(errors))
        return errors

    def _errors(self, recording: Distorted, found: Calibration) -> dict[str, object]:
        leftover = (found.config.calibration * recording.factors).ravel()
        gain, phase = 20 * np.log10(np.abs(leftover)), centred(leftover)
        before, bias = centred(recording.factors.ravel()), found.values["range_bias"]
        estimated = np.sqrt(np.square(found.errors).mean(axis=(0, 1)))
        return {
            "walk": f"{self.kind}, {self.platform}, {self.seed}",
            "phase before deg": np.degrees(before.std()),
            "phase deg": np.degrees(phase.std()), "estimated phase deg": np.degrees(estimated[1]),
            "gain dB": gain.std(), "bias before cm": 100 * recording.bias,
            "bias cm": 100 * ((0.0 if bias.why else bias.value) - recording.bias),
            "estimated bias cm": 100 * bias.error, "warnings": len(found.warnings),
            "azimuth scale": found.values["azimuth_scale"].value,
            "yaw deg": np.degrees(found.values["yaw"].value), "lever arm m": found.values["lever_arm"].value,
            "height m": found.values["height"].value,
        }  # fmt: skip

    def _ate(self, frames: Clip) -> tuple[float, float]:
        """Return the mean ATE of odometry and of SLAM by the default methods, m."""
        config: RadarConfig = frames.config
        inputs = Inputs(config, self.configuration)
        pipeline, tracks = make_pipeline(inputs, **BEST), []
        for result in pipeline.run(batches(frames, Preprocessor(inputs.signal))):
            tracks.append(result.track)
        times, poses = (np.concatenate([getattr(track, name) for track in tracks]) for name in ("time", "pose"))
        truth = trajectory(*frames.recording.true_poses())
        odometry, slam = (
            evaluate_trajectory(trajectory(at, planar_poses(each)), truth).position.mean
            for at, each in ((times, poses), pipeline.slam.trajectory())
        )
        return odometry, slam


def summary(rows: Sequence[dict]) -> dict[str, object]:
    """Return RMS errors of the calibration, and mean ATE over all walks."""
    last: dict[str, object] = {"walk": f"all {len(rows)}"}
    for name in list(rows[0])[1:]:
        values = np.array([row[name] for row in rows], float)
        if name.startswith(("odometry", "SLAM")):
            last[name] = values.mean()
        elif name == "warnings":
            last[name] = int(values.sum())
        elif name.startswith("estimated") or name.startswith(("phase", "gain", "bias")):
            last[name] = np.sqrt(np.mean(values**2))
        else:
            last[name] = np.nanmean(values) if np.isfinite(values).any() else None
    return last


@script(
    "Calibration from a walk",
    folder=(Path("calibration-walks"), "folder of the recordings, which are made if missing, and of their results"),
    walks=(12, "number of walks; their seeds count from --seed"),
    seed=(801, "seed of the first walk; 701 to 708 are the tuning set"),
    duration=(20.0, "duration of a walk, s"),
    workers=(2, "number of processes"),
)
def main(options: argparse.Namespace) -> Page:
    trials = [
        Trial(
            options.seed + k, PLATFORMS[(k + k // 4) % 2], KINDS[k % 4], options.folder, options.duration
        )
        for k in range(options.walks)
    ]  # fmt: skip
    options.folder.mkdir(parents=True, exist_ok=True)
    performed({trial.path.stem: trial.record for trial in trials}, options.workers, "walks")
    found = performed({trial.path.stem: trial.outcome for trial in trials}, options.workers, "boards")
    rows = [{k: None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()} for row in found]
    total = summary(found)
    ratio = {use: total[f"SLAM {use}"] / total["SLAM perfect"] for use in USES}
    odometry = {use: total[f"odometry {use}"] / total["odometry perfect"] for use in USES}
    return Page(
        [*rows, total],
        data=Data.of("simulated walks", [trial.path for trial in trials], options.seed),
        networks=tuple(UsedNetwork.of(Weights().of(kind)) for kind in NETWORKS),
        notes=[
            "phase, gain: standard deviation over the 12 channels after calibration, including slopes along the array; "
            f"errors are uniform within {PHASE:g} deg, {GAIN:g} dB and a range bias of {BIAS:g} m. estimated: standard "
            "errors estimated by the calibration. Last row: RMS of errors, means of the other columns.",
            "odometry, SLAM: mean ATE, m, by the default methods, with the ideal board, with errors, and with errors "
            "and the calibration from the same walk. Relative to the ideal board: odometry "
            f"{odometry['uncalibrated']:.2f} x uncalibrated, {odometry['calibrated']:.2f} x calibrated; SLAM "
            f"{ratio['uncalibrated']:.2f} x and {ratio['calibrated']:.2f} x.",
            "Mounting: on the cart 0.20 m in front of the axle, 0.95 m high, without yaw; handheld 1.2 m high.",
        ],
    )
