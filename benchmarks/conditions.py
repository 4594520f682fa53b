"""Hard conditions (`benchmarks.hardships`): errors on the same walks without and with each condition."""

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
    """A walk of `WALKS` under a condition, with the folder of its recording; methods are jobs."""

    walk: dict
    condition: str
    folder: Path

    @property
    def recording(self) -> Path:
        """Path of the recording: that of the plain walk if the condition modifies samples only."""
        name = self.condition if CONDITIONS[self.condition].scenario else "plain"
        return self.folder / f"{self.walk['seed']}-{name.replace(' ', '-').replace('/', '-')}.h5"

    def record(self, _: Report) -> None:
        """Simulate the recording if it does not exist."""
        if self.recording.is_file():
            return
        seed, building = self.walk["seed"], self.walk["building"]
        scene = Scene.of({"building": building}, f"{building['kind']} of {building['seed']}")
        motion = Walk(self.walk["platform"], self.walk["duration"]).through(scene, seed)
        plain, harder = Scenario(scene, motion, PRESETS["radarize"], seed=seed), CONDITIONS[self.condition].scenario
        record(Batches.of(harder(plain) if harder else plain), self.recording)

    def outcome(self, _: Report) -> "Outcome":
        """Run the whole pipeline and compare it with the truth."""
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
    """Errors of both trajectories, estimated standard deviation of the last yaw of odometry (rad), and kinds of
    conditions reported by the health of odometry."""

    odometry: TrajectoryErrors
    slam: TrajectoryErrors
    yaw_deviation: float
    reported: set[str]


def row(name: str, found: Sequence[Outcome], plain: Sequence[Outcome]) -> dict[str, object]:
    """Return a row of errors over walks under a condition, relative to the plain walks."""
    odometry = pd.Series([each.odometry.position.mean for each in found])
    slam, before = (pd.Series([each.slam.position.mean for each in outcomes]) for outcomes in (found, plain))
    reported = Counter(kind for each in found for kind in each.reported)
    return {
        "condition": name,
        "odometry m": with_error(odometry),
        "SLAM m": with_error(slam),
        "worst SLAM m": slam.max(),
        "times the plain walks'": slam.mean() / before.mean(),
        "max yaw error deg": np.degrees(max(each.odometry.rotation.max for each in found)),
        "estimated std. of last yaw deg": np.degrees(np.mean([each.yaw_deviation for each in found])),
        f"health, number of {len(found)} walks": ", ".join(f"{k} {n}" for k, n in sorted(reported.items())) or NONE,
    }


@script(
    "Hard conditions",
    folder=(Path("conditions"), "folder of the recordings, which are made if missing"),
    only=("", "conditions, comma-separated; all if empty"),
    seconds=(30.0, "duration of each walk, s"),
    workers=(2, "number of processes"),
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
            f"odometry, SLAM: ATE, mean over {len(walks)} walks +- standard error. Yaw of odometry: largest error "
            "after alignment, and the estimated standard deviation of the last yaw given the first, mean over walks. "
            "health: reported kinds of conditions, and the number of walks with them. Sidestepping, corridor and hall "
            "are walks in other places.",
            "Target: at most three times the SLAM error of the plain walks, except where motion is unobservable, which "
            "health must report.",
        ],
    )
