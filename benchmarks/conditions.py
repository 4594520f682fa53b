"""Hard conditions: the same walks plain, with samples that are hurt, moved otherwise, or elsewhere."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from jaxtyping import Bool, Float, Int16
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

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
from radarsim.motion import Motion
from radarsim.scenario import Scenario
from radarsim.scene.scene import Scene
from radarsim.simulate import record
from radarsim.walk import Walk

WALKS = Path(__file__).with_suffix(".yaml")
#: Counts, of one chirp: as strong as furniture at 2 m.
_INTERFERER = 1000.0
#: m from the middle to the walls of a hall, and of its ceiling above the floor.
_HALL, _HIGH = 15.0, 8.0


class Samples(NamedTuple):
    """What is recorded: I/Q, start of each frame (s), and which chirps arrived."""

    adc: Int16[np.ndarray, "frame loop tx rx sample 2"]
    times: Float[np.ndarray, "frame"]
    valid: Bool[np.ndarray, "frame loop tx"]


class Condition(NamedTuple):
    """What is other than on the plain walk.

    Attributes:
        hurt: what becomes of its samples.
        scenario: what is simulated instead.
    """

    hurt: Callable[[Samples, np.random.Generator], Samples] | None = None
    scenario: Callable[[Scenario], Scenario] | None = None


# --- samples that are hurt --------------------------------------------------------------------------------------------
def _added(samples: Samples, wave: np.ndarray) -> Samples:
    counts = samples.adc + np.stack([wave.real, wave.imag], axis=-1)
    return samples._replace(adc=np.clip(np.rint(counts), -32768, 32767).astype(np.int16))


def phases_off(samples: Samples, rng: np.random.Generator) -> Samples:
    """Each channel by up to 20 deg, the same all along."""
    turn = np.exp(1j * np.radians(np.random.default_rng(1).uniform(-20, 20, samples.adc.shape[2:4])))
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    return _added(samples, signal * (turn[..., None] - 1))


def noisier(samples: Samples, rng: np.random.Generator) -> Samples:
    """By 6 dB: thrice the noise power, which is that of the last range bins, once more."""
    shape = samples.adc.shape[:-1]
    signal = samples.adc.astype(np.float32).view(np.complex64)[..., 0]
    bins = np.fft.fft(signal[:, ::8], axis=-1)[..., -shape[-1] // 4 : -shape[-1] // 8]
    sigma = np.sqrt(3 * np.median(np.abs(bins) ** 2) / np.log(2) / shape[-1] / 2)
    return _added(samples, sigma * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)))


def receiver_dead(samples: Samples, rng: np.random.Generator) -> Samples:
    """The second one, of which the converter's own noise is left."""
    adc = samples.adc.copy()
    adc[:, :, :, 1] = np.rint(rng.normal(0, 5, adc[:, :, :, 1].shape))
    return samples._replace(adc=adc)


def chirps_lost(samples: Samples, rng: np.random.Generator) -> Samples:
    """One in twenty."""
    valid = samples.valid & (rng.random(samples.valid.shape) >= 0.05)
    return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)


def interference(share: float) -> Callable[[Samples, np.random.Generator], Samples]:
    """A share of the chirps crossed by another radar's ramp, which sweeps the band within half a chirp."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        wave = np.zeros(samples.adc.shape[:-1], np.complex64)
        count = wave.shape[-1]
        for place in np.argwhere(rng.random(samples.valid.shape) < share):
            n = np.arange(count // 2)
            sweep = np.exp(1j * (2 * np.pi * (n**2 / count - n / 2) + rng.uniform(0, 2 * np.pi, (wave.shape[3], 1))))
            start = rng.integers(0, count - len(n))
            wave[(*place, slice(None), slice(start, start + len(n)))] = _INTERFERER * sweep
        return _added(samples, wave)

    return hurt


def frames_lost(seconds: float, when: tuple[float, ...]) -> Callable[[Samples, np.random.Generator], Samples]:
    """So many seconds, from each of some instants."""

    def hurt(samples: Samples, rng: np.random.Generator) -> Samples:
        kept = np.all([(samples.times < t) | (samples.times >= t + seconds) for t in when], axis=0)
        valid = samples.valid & kept[:, None, None]
        return samples._replace(adc=samples.adc * valid[..., None, None, None], valid=valid)

    return hurt


# --- walks of another kind --------------------------------------------------------------------------------------------
def _along(motion: Motion, clock: Callable[[np.ndarray], np.ndarray], duration: float) -> Motion:
    """The same way by another clock."""
    times = np.arange(-1.0, duration + 1.0, 0.02)
    there = clock(times)
    path, attitude = CubicSpline(times, motion.path(there)), RotationSpline(times, motion.attitude(there))
    return replace(motion, duration=duration, path=path, attitude=attitude)


def faster(speed: float) -> Callable[[Scenario], Scenario]:
    """All of it quicker, so that `speed` (m/s) is the fastest."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        fastest = np.linalg.norm(motion.velocity(np.arange(0, motion.duration, 0.02))[:, :2], axis=1).max()
        share = speed / fastest
        return replace(scenario, motion=_along(motion, lambda t: share * t, motion.duration / share))

    return changed


def swinging(rate: float) -> Callable[[Scenario], Scenario]:
    """To and fro on the way, at `rate` (deg/s) at the fastest, every 2 s."""

    def changed(scenario: Scenario) -> Scenario:
        motion = scenario.motion
        times = motion.path.x
        swing = np.radians(rate) / np.pi * np.sin(np.pi * times) * np.clip(times - 0.5, 0, 1)
        attitude = Rotation.from_euler("z", swing[:, None]) * motion.attitude(times)
        return replace(scenario, motion=replace(motion, attitude=RotationSpline(times, attitude)))

    return changed


def standing(scenario: Scenario) -> Scenario:
    """Half a minute, in the middle."""
    motion, lasts = scenario.motion, 30.0
    middle = motion.duration / 2

    def clock(times: np.ndarray) -> np.ndarray:
        # It slows down and sets off again within half a second.
        fine = np.arange(-1.0, motion.duration + lasts + 1.0, 0.01)
        pace = np.clip(np.abs(fine - middle - lasts / 2) - lasts / 2 + 0.5, 0, 0.5) / 0.5
        return np.interp(times, fine, -1.0 + np.cumsum(pace) * 0.01)

    return replace(scenario, motion=_along(motion, clock, motion.duration + lasts))


def sidestepping(scenario: Scenario) -> Scenario:
    """To and fro, 1.3 m in front of a bare front of glass."""
    times = np.arange(-1.0, 31.0, 0.05)
    phase = 2 * np.pi / 20 * np.clip(times, 0, None)
    place = np.stack([4 - 2.4 * np.cos(phase), 3.7 + 0.1 * np.sin(3.1 * phase), np.full_like(times, 1.2)], axis=1)
    yaw = np.pi / 2 + np.radians(15) * np.sin(2.7 * phase)
    turns = RotationSpline(times, Rotation.from_euler("z", yaw[:, None]))
    return replace(scenario, scene=Scene.load("stress/people"), motion=Motion(30.0, CubicSpline(times, place), turns))


def hall(scenario: Scenario) -> Scenario:
    """Round the middle of a hall, whose walls are out of reach."""
    side, wall = 2 * _HALL, {"shape": "rectangle", "material": "concrete"}
    walls = {"west": (-1, 0), "east": (1, 0), "south": (0, -1), "north": (0, 1)}
    objects = [
        {"name": name, "size": [side, _HIGH], "position": [x * _HALL, y * _HALL, _HIGH / 2], "facing": [-x, -y, 0]}
        for name, (x, y) in walls.items()
    ] + [
        {"name": "floor", "size": [side, side], "position": [0, 0, 0], "facing": [0, 0, 1]},
        {"name": "ceiling", "size": [side, side], "position": [0, 0, _HIGH], "facing": [0, 0, -1]},
    ]
    scene = Scene.of({"clutter": 1.0, "objects": [wall | each for each in objects]}, "hall")
    times = np.arange(-1.0, 31.0, 0.05)
    course = 2 * np.pi / 25 * np.clip(times, 0, None)
    place = np.stack([4 * np.cos(course), 4 * np.sin(course), np.full_like(times, 1.2)], axis=1)
    turns = RotationSpline(times, Rotation.from_euler("z", (course + np.pi / 2)[:, None]))
    return replace(scenario, scene=scene, motion=Motion(30.0, CubicSpline(times, place), turns))


CONDITIONS: dict[str, Condition] = {
    "plain": Condition(),
    "phases off by 20 deg": Condition(phases_off),
    "noise + 6 dB": Condition(noisier),
    "a receiver dead": Condition(receiver_dead),
    "5 % of chirps lost": Condition(chirps_lost),
    "frames of 1 s lost": Condition(frames_lost(1.0, (9.0, 17.0, 24.0))),
    "frames of 5 s lost": Condition(frames_lost(5.0, (14.0,))),
    "interference in 1 %": Condition(interference(0.01)),
    "interference in 5 %": Condition(interference(0.05)),
    "people": Condition(scenario=lambda plain: replace(plain, scene=Scene.load("visitors"))),
    "1.8 m/s": Condition(scenario=faster(1.8)),
    "2.4 m/s": Condition(scenario=faster(2.4)),
    "150 deg/s": Condition(scenario=swinging(150.0)),
    "220 deg/s": Condition(scenario=swinging(220.0)),
    "standing for 30 s": Condition(scenario=standing),
    "sidestepping along glass": Condition(scenario=sidestepping),
    "hall": Condition(scenario=hall),
}


# --- figures ----------------------------------------------------------------------------------------------------------
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
