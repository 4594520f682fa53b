"""A recording by a pair of methods: the run, and its figures; and how long each stage takes."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from radarize import log
from radarize.batch import Intake
from radarize.benchmark.dataset import Case
from radarize.benchmark.identity import of_code, of_file
from radarize.benchmark.networks import Networks
from radarize.benchmark.steps import Report
from radarize.effort import BATCH
from radarize.errors import InputError
from radarize.evaluation.evaluate import evaluate, trajectory_errors
from radarize.evaluation.scans import true_ranges
from radarize.evaluation.stress import missed, sources
from radarize.methods.registry import ODOMETRY, SCANS, Inputs, Workshop
from radarize.pipeline import Pipeline
from radarize.recording import Recording
from radarize.runfolder import RunFolder
from radarize.session import run_each
from radarize.slam.config import LoopConfig, SlamConfig

#: Folder in a run's with the back end's result where no loops were closed.
OPEN = "without-loops"
#: Errors of a trajectory are kept as so many quantiles.
QUANTILES = 101
#: Frames that are timed.
TIMED = 300


@dataclass(frozen=True)
class Pair:
    """Methods of odometry and of scans, keys of `radarize.methods.ODOMETRY` and `SCANS`."""

    odometry: str
    scans: str

    def __str__(self) -> str:
        return f"{self.odometry}+{self.scans}"

    @property
    def networks(self) -> tuple[str, ...]:
        """Kinds of weights that they need."""
        return tuple(dict.fromkeys((*ODOMETRY[self.odometry].networks, *SCANS[self.scans].networks)))


@dataclass(frozen=True)
class _Step:
    case: Case
    pair: Pair
    networks: Networks
    together = None

    @property
    def _name(self) -> str:
        suffix = "" if self.networks.label == "shipped" else f"@{self.networks.label}"
        return f"{self.case.name}/{self.pair}{suffix}"

    def identity(self) -> dict[str, object]:
        return {
            "recording": of_file(self.case.path),
            "networks": self.networks.identity(self.pair.networks),
            "code": of_code(ODOMETRY[self.pair.odometry].maker, SCANS[self.pair.scans].maker),
        }


@dataclass(frozen=True)
class Run(_Step):
    """The pipeline on a recording: a folder as `radarize run` writes it, and one without loop closure in it."""

    alone = False

    @property
    def place(self) -> str:
        return f"runs/{self._name}"

    @property
    def frames(self) -> int:
        return self.case.frames

    @property
    def together(self) -> object:
        """With the recording's other runs: what methods have in common is made once."""
        return self.case, self.networks

    def do_each(self, places: "dict[Path, Run]", report: Report) -> dict[Path, dict[str, object] | str]:
        """Of one recording and the same networks; see `figures`."""
        pairs = {folder: (run.pair.odometry, run.pair.scans) for folder, run in places.items()}
        share = 0.7  # of the time, until trajectories are there

        def running(done: int, total: int) -> None:
            report(share * done / total)

        found: dict[Path, dict[str, object] | str] = {}
        with Recording(self.case.path) as recording:
            failed = run_each(recording[:], pairs, weights=self.networks.folder, progress=running)
        for folder in places:
            try:
                found[folder] = str(failed[folder]) if folder in failed else figures(folder, self.case.path)
            except InputError as error:
                found[folder] = str(error)
            report(share + (1 - share) * len(found) / len(places))
        return found


def figures(run: Path, recording: Path) -> dict[str, object]:
    """All figures of a run of a recording; None for numbers that do not exist.

    Returns:
        What `evaluate` returns, and ``nearest``: `TrajectoryErrors.summary` of ``odometry``, ``slam`` and ``open``
        (without loop closure) by the paper's association; ``quantiles``: of the same trajectories' position errors, m;
        ``sources`` and ``missed``: see `radarize.evaluation.stress`, where the recording knows.

    Raises:
        InputError: no truth.
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
    """Stages of the pipeline on a recording's first frames, on cores that do nothing else."""

    alone = True

    @property
    def place(self) -> str:
        return f"timings/{self._name}"

    @property
    def frames(self) -> int:
        return min(self.case.frames, TIMED)

    def do(self, folder: Path, report: Report) -> dict[str, object]:
        """Returns: ``stages``: ms per frame by name, ``whole``: ms per frame, reading included; ``frames``."""
        with Recording(self.case.path) as source:
            inputs = Inputs(source.config, weights=self.networks.weights, recording=source)

            def run(frames: int, report: Report) -> tuple[Pipeline, float]:
                pipeline = Workshop(inputs).pipeline(self.pair.odometry, self.pair.scans)
                intake, start = Intake(inputs.signal), time.perf_counter()
                for first in range(0, frames, BATCH):
                    stop = min(first + BATCH, frames)
                    samples = source.adc(first, stop), source.times[first:stop], source.valid(first, stop)
                    pipeline.push(intake.take(*samples))
                    report(stop / frames)
                pipeline.finish()
                return pipeline, time.perf_counter() - start

            run(min(BATCH, self.frames), lambda share: None)  # compiles
            timed, whole = run(self.frames, report)
        spent = {name: 1e3 * seconds / self.frames for name, seconds in timed.seconds.items()}
        return {"stages": spent, "whole": 1e3 * whole / self.frames, "frames": self.frames}
