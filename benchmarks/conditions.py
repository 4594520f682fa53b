"""Hard conditions (`benchmarks.hardships`): the same walks plain, and under each."""

import argparse
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import yaml

from benchmarks.hardships import CONDITIONS, Samples
from benchmarks.results import Data, Page, performed, script
from radarize.evaluation.benchmark.networks import Networks
from radarize.evaluation.benchmark.runs import Pair
from radarize.evaluation.benchmark.table import NONE, with_error
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.jobs import Report
from radarize.io.recording import Recording
from radarize.io.tum import planar_poses
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.health import Health
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import BEST, make_pipeline
from radarize.radar.presets import PRESETS
from radarize.signal.batch import Preprocessor
from radarize.signal.effort import BATCH
from radarsim.motion.walk import Walk
from radarsim.recording.batches import Batches
from radarsim.recording.simulate import record
from radarsim.scenario import Scenario
from radarsim.world.scene import Scene

WALKS = Path(__file__).with_suffix(".yaml")


class Trial(NamedTuple):
    """A walk of `WALKS` under a condition, and the folder of its recording; its methods are jobs."""

    walk: dict
    condition: str
    folder: Path

    @property
    def recording(self) -> Path:
        """That of the plain walk where samples are hurt afterwards."""
        name = self.condition if CONDITIONS[self.condition].scenario else "plain"
        return self.folder / f"{self.walk['seed']}-{name.replace(' ', '-').replace('/', '-')}.h5"

    def record(self, _: Report) -> None:
        """Make the recording if it is not there."""
        if self.recording.is_file():
            return
        seed, building = self.walk["seed"], self.walk["building"]
        scene = Scene.of({"building": building}, f"{building['kind']} of {building['seed']}")
        motion = Walk(self.walk["platform"], self.walk["duration"]).through(scene, seed)
        plain, harder = Scenario(scene, motion, PRESETS["radarize"], seed=seed), CONDITIONS[self.condition].scenario
        record(Batches.of(harder(plain) if harder else plain), self.recording)

    def outcome(self, _: Report) -> "Outcome":
        """Of the whole pipeline."""
        hurt, rng, tracks = CONDITIONS[self.condition].hurt, np.random.default_rng(0), []
        with Recording(self.recording) as recording:
            inputs = Inputs(recording.config)
            pipeline, preprocessor = make_pipeline(inputs, **BEST), Preprocessor(inputs.signal)
            health, truth = Health(recording.config), trajectory(*recording.true_poses())
            samples = (
                Samples(adc, recording.times[frames], recording.valid(frames.start, frames.stop))
                for frames, adc in recording.batches(BATCH)
            )
            batches = (preprocessor.process(*(hurt(each, rng) if hurt else each)) for each in samples)
            for result in pipeline.run(batches):
                health.add(result)
                tracks.append(result.track)
        times, poses = (np.concatenate([getattr(t, name) for t in tracks]) for name in ("time", "pose"))
        spread = ErrorModel.joined([track.errors for track in tracks]).since_start(poses)[-1]
        found = (times, poses), pipeline.slam.trajectory()
        errors = (evaluate_trajectory(trajectory(at, planar_poses(each)), truth) for at, each in found)
        return Outcome(*errors, float(np.sqrt(spread[2, 2])), {each.kind for each in health.found})


class Outcome(NamedTuple):
    """Errors of both trajectories, standard deviation of the last yaw that odometry claims (rad), and what was said."""

    odometry: TrajectoryErrors
    slam: TrajectoryErrors
    claimed: float
    said: set[str]


def row(name: str, found: Sequence[Outcome], plain: Sequence[Outcome]) -> dict[str, object]:
    """Errors over walks, beside those of the plain walks."""
    odometry = pd.Series([each.odometry.position.mean for each in found])
    slam, before = (pd.Series([each.slam.position.mean for each in outcomes]) for outcomes in (found, plain))
    said = Counter(kind for each in found for kind in each.said)
    return {
        "condition": name,
        "odometry m": with_error(odometry),
        "SLAM m": with_error(slam),
        "worst SLAM m": slam.max(),
        "times the plain walks'": slam.mean() / before.mean(),
        "yaw off by at most deg": np.degrees(max(each.odometry.rotation.max for each in found)),
        "claimed at the end deg": np.degrees(np.mean([each.claimed for each in found])),
        f"health, in so many of {len(found)}": ", ".join(f"{k} {n}" for k, n in sorted(said.items())) or NONE,
    }


@script(
    "Hard conditions",
    folder=(Path("conditions"), "of the recordings, which are made if they are not there"),
    only=("", "conditions, comma-separated; all if none"),
    seconds=(30.0, "of each walk"),
    workers=(2, "processes"),
)
def main(options: argparse.Namespace) -> Page:
    walks = [walk | {"duration": options.seconds} for walk in yaml.safe_load(WALKS.read_text())]
    wanted = options.only.split(",") if options.only else CONDITIONS
    names = [name for name in CONDITIONS if name == "plain" or name in wanted]
    trials = [Trial(walk, name, options.folder) for name in names for walk in walks]
    recordings = {str(trial.recording): trial.record for trial in trials}
    options.folder.mkdir(parents=True, exist_ok=True)
    performed(recordings, options.workers, "recordings")
    runs = {f"{trial.condition}, {trial.walk['seed']}": trial.outcome for trial in trials}
    found = performed(runs, options.workers, "runs")
    outcomes = {name: found[k * len(walks) : (k + 1) * len(walks)] for k, name in enumerate(names)}
    return Page(
        [row(name, each, outcomes["plain"]) for name, each in outcomes.items()],
        data=Data.of("walks of benchmarks/conditions.yaml and their hard versions", sorted(map(Path, recordings))),
        networks=Networks().used(Pair(**BEST).networks),
        notes=[
            f"Mean errors after alignment, of {len(walks)} walks, +- standard error; yaw: the largest error of "
            "odometry after alignment, and the standard deviation of the last yaw that it claims, given the first, "
            "mean over walks. Health: kinds of conditions that were told, and in how many of the walks. Sidestepping, "
            "corridor and hall are other walks in other places, the same for each.",
            "To reach: at most three times the plain walks' SLAM, but where nothing tells the motion; there health "
            "says so.",
        ],
    )
