"""The twin of a recording: what the simulator makes of the same walk, in a model of the same place.

Frame by frame the twin has the recording's stamps, lost chirps, radar configuration and poses; what it has of its own
is the world: surfaces of the scene in place of the real ones, and other speckle and noise. `radarsim.twin.comparison`
tells how alike the two are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from radarize.errors import InputError
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig
from radarize.recording import Recording
from radarsim.motion.statistics import crossings
from radarsim.motion.trajectory import Motion, Mounting, motion_through
from radarsim.receiver.calibrate import calibrate
from radarsim.receiver.frontend_config import Channel, FrontEndConfig, Mismatch
from radarsim.recording.batches import Batches
from radarsim.recording.simulate import record
from radarsim.scenario import Scenario
from radarsim.sensors.suite import chosen
from radarsim.world.scene import Scene

#: s between two poses: over a longer gap nobody knows where the radar was, and frames there have no twin.
GAP = 0.5


@dataclass(frozen=True)
class Options:
    """How a twin is made.

    Attributes:
        origin: where the poses' origin is in the scene; default: they are the scene's own coordinates.
        mounting: of the radar on the body that the poses are of; default: they are the radar's own.
        at: the place of a radar at rest, instead of poses.
        frontend: front-end file (see `FrontEndConfig`); default: the board's, with channels that the recording's
            channel calibration makes equal.
        fit: fit the front end to the recording instead (`calibrate`), and keep it beside the output as ``.yaml``.
        every: simulate every so manieth frame.
        duration: s of the recording, from its first frame; default: all of it.
        seed: of speckle, noise and whatever differs from board to board.
        sensors: see `simulate`.

    Raises:
        InputError: options that do not go together, or an unusable one.
    """

    origin: Mounting | None = None
    mounting: Mounting | None = None
    at: Mounting | None = None
    frontend: Path | None = None
    fit: bool = False
    every: int = 1
    duration: float | None = None
    seed: int = 0
    sensors: Sequence[str] = ()

    def __post_init__(self):
        if self.frontend is not None and self.fit:
            raise InputError(f"--frontend {self.frontend} is given with --calibrate, expected one of the two")
        if self.every < 1:
            raise InputError(f"every is {self.every}, expected at least 1")


def make_twin(
    recording: Path,
    scene: str | Path | Scene,
    output: Path,
    options: Options = Options(),  # noqa: B008
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Simulate the twin of a recording.

    Args:
        recording: of a real radar, or of a simulated one that plays it, with poses.
        scene: model of the place: a scene, its YAML file, or the name of one that comes with the project.
        output: recording to write.
        options: how.
        progress: called with (frames done, frames in all).

    Returns:
        The path written. Its attribute ``warnings`` says what is doubtful.

    Raises:
        InputError: unusable recording or scene; no poses, or poses outside the scene.
    """
    world = scene if isinstance(scene, Scene) else Scene.load(scene)
    walk = _Walk.of(Path(recording), world, options)
    frontend = options.frontend
    if options.fit:
        frontend = Path(output).with_suffix(".yaml")
        calibrate(recording, frontend)
    config = walk.config
    settings = FrontEndConfig.load(frontend, config.board) if frontend else _calibrated(config)
    scenario = Scenario(world, walk.motion, config, settings, options.seed, tuple(chosen(options.sensors)))
    crossed = crossings(walk.motion, world)
    about = {
        "source": "radarsim twin",
        "twin_of": Path(recording).name,
        "warnings": "; ".join(filter(None, [walk.left_out, crossed and f"poses: {crossed}"])),
    }
    batches = Batches(scenario, walk.times, walk.start, walk.valid)
    return record(batches, output, cfg_text=walk.cfg_text, attributes=about, progress=progress)


@dataclass(frozen=True)
class _Walk:
    """What a twin takes from its recording.

    Attributes:
        config: radar configuration.
        cfg_text: its original text.
        start: stamp of the recording's first frame, s.
        times: of the frames to simulate since then, s.
        valid: their chirps that arrived.
        motion: of the radar in the scene.
        left_out: a sentence on frames without poses, or nothing.
    """

    config: RadarConfig
    cfg_text: str
    start: float
    times: Float[np.ndarray, "frame"]
    valid: Bool[np.ndarray, "frame loop tx"]
    motion: Motion
    left_out: str

    @classmethod
    def of(cls, path: Path, world: Scene, options: Options) -> "_Walk":
        """From a recording."""
        at = options.at
        with Recording(path) as recording:
            if not len(recording):
                raise InputError(f"{path}: has no whole frame, expected at least one")
            config, start = recording.config, float(recording.times[0])
            wanted = np.arange(0, len(recording), options.every)
            if options.duration is not None:
                wanted = wanted[recording.times[wanted] - start < options.duration]
            middles = recording.times[wanted] + config.burst_center
            if at is not None:
                span = float(recording.times[-1] - start) + config.frame_period
                yaw, pitch, roll = at.rotation.as_euler("ZYX")
                motion, known = Motion.still(at.lever_arm, yaw, pitch, roll, span), np.ones(len(wanted), bool)
            else:
                stamps, poses = _poses(recording, config.burst_time)
                poses = _moved(poses, options.origin)
                motion = motion_through(stamps, poses, start, options.mounting, f"{path}: /truth/pose")
                known = _between(middles, stamps)
            left = len(wanted) - int(known.sum())
            if left == len(wanted):
                raise InputError(
                    f"{path}: no frame lies between two of its poses (frames {middles[0]:.3f}...{middles[-1]:.3f} s, "
                    f"poses {stamps[0]:.3f}...{stamps[-1]:.3f} s), expected stamps of one clock"
                )
            wanted = wanted[known]
            times = recording.times[wanted] - start
            motion = motion.until(float(times[-1]) + config.frame_period)
            _require_inside(motion.position(times), world, path)
            return cls(
                config, recording.cfg_text, start, times, recording.valid(0, len(recording))[wanted], motion,
                f"{left} of {left + len(wanted)} frames have no pose within {GAP:g} s and are left out" if left else "",
            )  # fmt: skip


def _poses(recording: Recording, margin: float) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]]:
    """Stamps and poses that a recording came with, continued at both ends for the part of a burst that sticks out."""
    if not (recording.has("truth/pose") and recording.has("truth/time")):
        raise InputError(
            f"{recording.path}: has no poses (/truth/pose and /truth/time), expected where the radar was: import it "
            "with --poses FILE.tum, or give the place of a radar at rest with --at"
        )
    stamps, poses = recording.read("truth/time"), recording.read("truth/pose")
    whole = min(len(stamps), len(poses))
    stamps, poses = stamps[:whole], poses[:whole]
    known = np.isfinite(poses).all(axis=1) & np.isfinite(stamps)  # a tracking camera may have been blind for a while
    stamps, poses = stamps[known], poses[known]
    if len(stamps) < 2:
        raise InputError(f"{recording.path}: has {len(stamps)} finite poses in /truth/pose, expected at least 4")
    if (np.diff(stamps) <= 0).any():
        raise InputError(f"{recording.path}: the stamps in /truth/time do not ascend, expected ascending ones")
    (before, first), (last, after) = (_continued(stamps[[a, b]], poses[[a, b]], margin) for a, b in ((1, 0), (-2, -1)))
    return np.array([before, *stamps, last]), np.array([first, *poses, after])


def _continued(
    stamps: Float[np.ndarray, "2"], poses: Float[np.ndarray, "2 7"], margin: float
) -> tuple[float, Float[np.ndarray, "7"]]:
    """Stamp and pose a margin (s) beyond the second of two poses, at constant speed and turn rate."""
    share = margin / abs(stamps[1] - stamps[0])
    there, here = Rotation.from_quat(poses[:, 3:])
    turn = Rotation.from_rotvec(share * (here * there.inv()).as_rotvec())
    place = poses[1, :3] + share * (poses[1, :3] - poses[0, :3])
    return float(stamps[1] + np.sign(stamps[1] - stamps[0]) * margin), np.array([*place, *(turn * here).as_quat()])


def _moved(poses: Float[np.ndarray, "pose 7"], origin: Mounting | None) -> Float[np.ndarray, "pose 7"]:
    """Poses in the scene."""
    if origin is None:
        return poses
    place = origin.rotation.apply(poses[:, :3]) + origin.lever_arm
    return np.hstack([place, (origin.rotation * Rotation.from_quat(poses[:, 3:])).as_quat()])


def _between(times: Float[np.ndarray, "frame"], stamps: Float[np.ndarray, "pose"]) -> Bool[np.ndarray, "frame"]:
    """Frames with poses on both sides, not more than `GAP` apart."""
    after = np.clip(np.searchsorted(stamps, times), 1, len(stamps) - 1)
    inside = (times >= stamps[0]) & (times <= stamps[-1])
    return inside & (stamps[after] - stamps[after - 1] <= GAP)


def _require_inside(places: Float[np.ndarray, "frame 3"], world: Scene, path: Path) -> None:
    """Some of the poses must lie in the scene."""
    low, high = world.bounds
    if not ((places >= low) & (places <= high)).all(axis=1).any():
        x, y, z = places.mean(axis=0)
        raise InputError(
            f"{path}: its poses, about ({x:.1f}, {y:.1f}, {z:.1f}) m, lie outside scene {world.name} "
            f"({low[0]:.1f}...{high[0]:.1f}, {low[1]:.1f}...{high[1]:.1f}, {low[2]:.1f}...{high[2]:.1f} m), expected "
            "poses in its coordinates, or --origin"
        )


def _calibrated(config: RadarConfig) -> FrontEndConfig:
    """The default board; where the recording has a channel calibration, a board of which that is the right one."""
    if config.channel_calibration is None:
        return FrontEndConfig.of(config.board)
    # The simulated board turns the receivers' signs by itself.
    channels = load_board(config.board).rx_sign / config.channel_factors
    return FrontEndConfig.of(config.board, mismatch=Mismatch(channels=tuple(map(Channel.of, channels.ravel()))))
