"""Hard conditions (`benchmarks.hardships`): the same walks plain, and under each."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml

from benchmarks.hardships import CONDITIONS, Condition, Samples
from benchmarks.results import Data, command_line, publish
from radarize.batch import Intake
from radarize.benchmark.networks import Networks
from radarize.console import progress
from radarize.effort import BATCH
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory
from radarize.evaluation.trajectory import trajectory
from radarize.health import Health
from radarize.methods.method import Inputs
from radarize.methods.registry import BEST, ODOMETRY, SCANS, Workshop
from radarize.radar.presets import PRESETS
from radarize.recording import Recording
from radarize.tum import planar_poses
from radarsim.batches import Batches
from radarsim.scenario import Scenario
from radarsim.scene.scene import Scene
from radarsim.simulate import record
from radarsim.walk import Walk

WALKS = Path(__file__).with_suffix(".yaml")


def recorded(walk: Mapping[str, object], name: str, folder: Path) -> Path:
    """The recording of a walk under a condition, made if it is not there; that of the plain walk where it is hurt
    afterwards."""
    condition = CONDITIONS[name] if CONDITIONS[name].scenario else CONDITIONS["plain"]
    words = (name if condition.scenario else "plain").replace(" ", "-").replace("/", "-")
    path = folder / f"{walk['scene']}-{walk['platform']}-{walk['seed']}-{words}.h5"
    if not path.is_file():
        scene, seed = Scene.load(walk["scene"]), walk["seed"]
        motion = Walk(walk["platform"], walk["duration"]).through(scene, seed)
        plain = Scenario(scene, motion, PRESETS["radarize"], seed=seed)
        record(Batches.of(condition.scenario(plain) if condition.scenario else plain), path)
    return path


class Outcome(NamedTuple):
    """Errors of both trajectories, standard deviation of the last yaw that odometry claims (rad), and what was said."""

    odometry: TrajectoryErrors
    slam: TrajectoryErrors
    claimed: float
    said: set[str]


def outcome(path: Path, condition: Condition) -> Outcome:
    """Of the whole pipeline."""
    rng, tracks = np.random.default_rng(0), []
    with Recording(path) as recording:
        workshop = Workshop(Inputs(recording.config))
        pipeline, intake = workshop.pipeline(**BEST), Intake(workshop.inputs.signal)
        health, truth = Health(recording.config), trajectory(*recording.true_poses())
        for frames, adc in recording.batches(BATCH):
            samples = Samples(adc, recording.times[frames], recording.valid(frames.start, frames.stop))
            hurt = condition.hurt(samples, rng) if condition.hurt else samples
            if len(batch := intake.take(*hurt)):
                result = pipeline.push(batch)
                health.add(result)
                tracks.append(result.track)
        pipeline.finish()
    times, poses, spread = (
        np.concatenate([getattr(t, name) for t in tracks]) for name in ("time", "pose", "covariance")
    )
    found = (times, poses), pipeline.slam.trajectory()
    errors = (evaluate_trajectory(trajectory(at, planar_poses(each)), truth) for at, each in found)
    return Outcome(*errors, float(np.sqrt(spread[:, 2, 2].sum())), {each.kind for each in health.found})


def row(name: str, walk: Mapping[str, object], found: Outcome, plain: Outcome) -> dict[str, object]:
    """Errors, beside those of the plain walk."""
    off = np.degrees(found.odometry.rotation.max)
    return {
        "condition": name,
        "platform": walk["platform"],
        "odometry m": found.odometry.position.mean,
        "SLAM m": found.slam.position.mean,
        "times the plain walk's": found.slam.position.mean / plain.slam.position.mean,
        "yaw off by at most deg": off,
        "claimed at the end deg": np.degrees(found.claimed),
        "health": ", ".join(sorted(found.said)) or "-",
    }


PARSER = command_line(
    __doc__,
    folder=(Path("conditions"), "of the recordings, which are made if they are not there"),
    only=("", "conditions, comma-separated; all if none"),
)


def main() -> None:
    options = PARSER.parse_args()
    walks, wanted = yaml.safe_load(WALKS.read_text()), options.only.split(",") if options.only else CONDITIONS
    names = [name for name in CONDITIONS if name == "plain" or name in wanted]
    rows, paths = [], set()
    with progress("conditions") as report:
        for number, walk in enumerate(walks):
            for done, name in enumerate(names):
                report(number * len(names) + done, len(walks) * len(names))
                paths.add(path := recorded(walk, name, options.folder))
                found = outcome(path, CONDITIONS[name])
                plain = found if name == "plain" else plain
                rows.append(row(name, walk, found, plain))
    publish(
        "conditions",
        "Hard conditions",
        rows,
        data=Data.of("walks of benchmarks/conditions.yaml and their hard versions", sorted(paths)),
        networks=Networks().used((*ODOMETRY[BEST["odometry"]].networks, *SCANS[BEST["scans"]].networks)),
        notes=[
            "Mean errors after alignment; yaw: the largest error of odometry after alignment, and the standard "
            "deviation of the last yaw that it claims, given the first. Health: kinds of conditions that were told.",
        ],
    )


if __name__ == "__main__":
    main()
