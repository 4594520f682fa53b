"""Steps of a benchmark: a run of a pair of methods on a recording with its metrics, and its run time by stage."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarize.evaluation.benchmark.dataset import Case
from radarize.evaluation.benchmark.identity import of_code, of_file
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.benchmark.steps import Report
from radarize.evaluation.evaluate import evaluate, trajectory_errors
from radarize.evaluation.scans import true_ranges
from radarize.evaluation.stress import missed, sources
from radarize.io.recording import Recording
from radarize.pipeline import log
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import ODOMETRY, SCANS, make_pipeline
from radarize.pipeline.pipeline import Pipeline
from radarize.pipeline.runfolder import RunFolder
from radarize.pipeline.session import batches, run_recording
from radarize.signal.batch import Preprocessor
from radarize.signal.effort import BATCH
from radarize.slam.config import LoopConfig, SlamConfig

#: Subfolder of a run with the result of the back end without loop closure.
OPEN = "without-loops"
#: Number of quantiles of the position errors that are kept.
QUANTILES = 101
#: Number of frames whose run time is measured.
TIMED = 300


@dataclass(frozen=True)
class Pair:
    """A method of odometry and one of scans: keys of `radarize.pipeline.methods.ODOMETRY` and `SCANS`."""

    odometry: str
    scans: str

    def __str__(self) -> str:
        return f"{self.odometry}+{self.scans}"

    @property
    def networks(self) -> tuple[str, ...]:
        """Kinds of network that the methods need."""
        return tuple(dict.fromkeys((*ODOMETRY[self.odometry].networks, *SCANS[self.scans].networks)))


@dataclass(frozen=True)
class _Step:
    case: Case
    pair: Pair
    networks: Networks

    @property
    def _name(self) -> str:
        suffix = "" if self.networks.label == "shipped" else f"@{self.networks.label}"
        return f"{self.case.name}/{self.pair}{suffix}"

    def identity(self) -> dict[str, object]:
        return {
            "recording": of_file(self.case.path),
            "networks": self.networks.identity(self.pair.networks),
            "code": of_code(ODOMETRY[self.pair.odometry].make, SCANS[self.pair.scans].make),
        }


@dataclass(frozen=True)
class RunStep(_Step):
    """Run of the pipeline on a recording: the folder of `radarize run`, with a subfolder without loop closure."""

    alone = False

    @property
    def place(self) -> str:
        return f"runs/{self._name}"

    @property
    def frames(self) -> int:
        return self.case.frames

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Run the pipeline, and return `figures`."""
        share = 0.7  # of the time is spent on the trajectories
        with Recording(self.case.path) as recording:
            run_recording(
                recording[:], folder, {"odometry": self.pair.odometry, "scans": self.pair.scans},
                weights=self.networks.folder, progress=lambda done, total: report(share * done / total),
            )  # fmt: skip
        return figures(folder, self.case.path)


def figures(run: Path, recording: Path) -> dict[str, object]:
    """Compute all metrics of a run of a recording; None for values that do not exist.

    Returns:
        The result of `evaluate`, and ``nearest``: `TrajectoryErrors.summary` of ``odometry``, ``slam`` and ``open``
        (without loop closure) by the paper's association; ``quantiles`` of their position errors, m; ``sources`` and
        ``missed`` of `radarize.evaluation.stress`, if the recording has a true scan.

    Raises:
        InputError: the run has no truth.
    """
    found = evaluate(run)
    RunFolder(run).write_metrics(found)
    settings = SlamConfig.preset("radar")
    log.run(run, None, run / OPEN, config=settings.model_copy(update={"loop": LoopConfig(enabled=False)}))
    errors = trajectory_errors(run, association="nearest")
    errors["open"] = trajectory_errors(run / OPEN, association="nearest")["slam"]
    found["nearest"] = {name: each.summary() for name, each in errors.items()}
    levels = np.linspace(0, 1, QUANTILES)
    found["quantiles"] = {
        name: np.quantile(each.position_errors, levels).round(4).tolist() for name, each in errors.items()
    }
    scans = RunFolder(run).scans
    if {"truth/scan", "truth/scan_azimuths"} <= scans.keys():
        true = true_ranges(scans["azimuths"], scans["truth/scan"], scans["truth/scan_azimuths"])
        found["missed"] = missed(scans["ranges"], true)
        found["sources"] = sources(scans, true, recording)
    return found


@dataclass(frozen=True)
class Timing(_Step):
    """Run time of each stage of the pipeline on a recording's first frames, without other work on the cores."""

    alone = True

    @property
    def place(self) -> str:
        return f"timings/{self._name}"

    @property
    def frames(self) -> int:
        return min(self.case.frames, TIMED)

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Measure run times. Returns ``stages``: ms per frame by name; ``whole``: ms per frame, including reading;
        ``frames``."""
        with Recording(self.case.path) as source:
            inputs = Inputs(source.config, weights=self.networks.weights, recording=source)

            def run(frames: int, report: Report) -> tuple[Pipeline, float]:
                pipeline = make_pipeline(inputs, self.pair.odometry, self.pair.scans)
                preprocessor, start = Preprocessor(inputs.signal), time.perf_counter()
                for _ in pipeline.run(batches(source[:frames], preprocessor, lambda done, total: report(done / total))):
                    pass
                return pipeline, time.perf_counter() - start

            run(min(BATCH, self.frames), lambda share: None)  # compiles kernels
            timed, whole = run(self.frames, report)
        spent = {name: 1e3 * seconds / self.frames for name, seconds in timed.seconds.items()}
        return {"stages": spent, "whole": 1e3 * whole / self.frames, "frames": self.frames}
