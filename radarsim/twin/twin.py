"""Digital twin of a recording: the same walk, simulated in a model of the same place.

Each frame of the twin has the recording's time stamp, lost chirps, radar configuration and pose. The world differs:
surfaces of the scene replace the real ones, and speckle and noise are different.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarize.radar.boards import load_board
from radarize.radar.config import RadarConfig
from radarsim.motion.statistics import crossings
from radarsim.motion.trajectory import Motion, Mounting, motion_through
from radarsim.receiver.calibrate import calibrate
from radarsim.receiver.frontend_config import Channel, FrontEndConfig, Mismatch
from radarsim.recording.batches import Batches
from radarsim.recording.simulate import record
from radarsim.scenario import Scenario
from radarsim.sensors.suite import chosen
from radarsim.world.scene import Scene

#: Longest time between two poses, s; frames in longer gaps are not simulated.
GAP = 0.5


@dataclass(frozen=True)
class Options:
    """Options of a twin.

    Attributes:
        origin: pose of the poses' origin in the scene; default: they are in the scene's coordinates.
        mounting: mounting of the radar on the body that the poses describe; default: they are the radar's own.
        at: pose of a radar at rest, instead of poses.
        frontend: front-end file (see `FrontEndConfig`); default: the board's, with channels that the recording's
            channel calibration makes equal.
        fit: fit the front end to the recording instead (`calibrate`), and write it beside the output as ``.yaml``.
        every: simulate every N-th frame.
        duration: s of the recording, from its first frame; default: all of it.
        seed: seed of speckle, noise and variation from board to board.
        sensors: see `simulate`.

    Raises:
        InputError: options that exclude each other, or an unusable one.
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
        if self.duration is not None and not self.duration > 0:
            raise InputError(f"duration is {self.duration:g} s, expected more than 0")


def make_twin(
    recording: Path,
    scene: str | Path | Scene,
    output: Path,
    options: Options = Options(),  # noqa: B008
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Simulate the twin of a recording.

    Args:
        recording: of a real radar, or of a simulated one in its place, with poses.
        scene: model of the place: a scene, its YAML file, or the name of a scene of the project.
        output: recording to write.
        options: options of the twin.
        progress: called with (frames done, total frames).

    Returns:
        The path written. Its attribute ``warnings`` lists doubts about the data.

    Raises:
        InputError: unusable recording or scene; no poses, or poses outside the scene.
    """
    world = scene if isinstance(scene, Scene) else Scene.load(scene)
    with Recording(recording) as real:
        if not len(real):
            raise InputError(f"{recording}: has no whole frame, expected at least one")
        config, cfg_text, start = real.config, real.cfg_text, float(real.times[0])
        wanted = np.arange(0, len(real), options.every)
        if options.duration is not None:
            wanted = wanted[real.times[wanted] - start < options.duration]
        motion, known = _motion(real, real.times[wanted] + config.burst_center, options)
        frames = wanted[known]
        times, valid = real.times[frames] - start, real.valid(0, len(real))[frames]
    motion = motion.until(float(times[-1]) + config.frame_period)
    _require_inside(motion.position(times), world, recording)
    frontend = options.frontend
    if options.fit:
        frontend = Path(output).with_suffix(".yaml")
        calibrate(recording, frontend)
    settings = FrontEndConfig.load(frontend, config.board) if frontend else _calibrated(config)
    scenario = Scenario(world, motion, config, settings, options.seed, tuple(chosen(options.sensors)))
    doubts = []
    if left := len(wanted) - len(frames):
        doubts.append(f"{left} of {len(wanted)} frames have no pose within {GAP:g} s and are left out")
    if crossed := crossings(motion, world):
        doubts.append(f"poses: {crossed}")
    about = {"source": "radarsim twin", "twin_of": Path(recording).name, "warnings": "; ".join(doubts)}
    batches = Batches(scenario, times, start, valid)
    return record(batches, output, cfg_text=cfg_text, attributes=about, progress=progress)


def _motion(
    recording: Recording, middles: Float[np.ndarray, "frame"], options: Options
) -> tuple[Motion, Bool[np.ndarray, "frame"]]:
    """Motion of the radar in the scene, and which frames, with bursts centred at these times (s), lie between poses."""
    config, start = recording.config, float(recording.times[0])
    if options.at is not None:
        span = float(recording.times[-1] - start) + config.frame_period
        yaw, pitch, roll = options.at.rotation.as_euler("ZYX")
        return Motion.still(options.at.lever_arm, yaw, pitch, roll, span), np.ones(len(middles), bool)
    stamps, poses = _poses(recording, config.burst_time)
    if (origin := options.origin) is not None:
        place = origin.rotation.apply(poses[:, :3]) + origin.lever_arm
        poses = np.hstack([place, (origin.rotation * Rotation.from_quat(poses[:, 3:])).as_quat()])
    after = np.clip(np.searchsorted(stamps, middles), 1, len(stamps) - 1)
    known = (middles >= stamps[0]) & (middles <= stamps[-1]) & (stamps[after] - stamps[after - 1] <= GAP)
    motion = motion_through(stamps, poses, start, options.mounting, f"{recording.path}: /truth/pose")
    if not known.any():
        raise InputError(
            f"{recording.path}: no frame lies between two of its poses (frames {middles[0]:.3f}...{middles[-1]:.3f} s, "
            f"poses {stamps[0]:.3f}...{stamps[-1]:.3f} s), expected stamps of one clock"
        )
    return motion, known


def _poses(recording: Recording, margin: float) -> tuple[Float[np.ndarray, "pose"], Float[np.ndarray, "pose 7"]]:
    """Time stamps and poses of a recording, extrapolated at both ends for the part of a burst that lies outside."""
    if not (recording.has("truth/pose") and recording.has("truth/time")):
        raise InputError(
            f"{recording.path}: has no poses (/truth/pose and /truth/time), expected where the radar was: import it "
            "with --poses FILE.tum, or give the place of a radar at rest with --at"
        )
    stamps, poses = recording.read("truth/time"), recording.read("truth/pose")
    whole = min(len(stamps), len(poses))
    stamps, poses = stamps[:whole], poses[:whole]
    known = np.isfinite(poses).all(axis=1) & np.isfinite(stamps)  # a tracking camera may lose track for a while
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
    """Extrapolate time stamp and pose by a margin (s) beyond the second of two poses, at constant velocity and turn
    rate."""
    share = margin / abs(stamps[1] - stamps[0])
    there, here = Rotation.from_quat(poses[:, 3:])
    turn = Rotation.from_rotvec(share * (here * there.inv()).as_rotvec())
    place = poses[1, :3] + share * (poses[1, :3] - poses[0, :3])
    return float(stamps[1] + np.sign(stamps[1] - stamps[0]) * margin), np.array([*place, *(turn * here).as_quat()])


def _require_inside(places: Float[np.ndarray, "frame 3"], world: Scene, path: Path) -> None:
    """Raise InputError unless some of the poses lie in the scene."""
    low, high = world.bounds
    if not ((places >= low) & (places <= high)).all(axis=1).any():
        x, y, z = places.mean(axis=0)
        raise InputError(
            f"{path}: its poses, about ({x:.1f}, {y:.1f}, {z:.1f}) m, lie outside scene {world.name} "
            f"({low[0]:.1f}...{high[0]:.1f}, {low[1]:.1f}...{high[1]:.1f}, {low[2]:.1f}...{high[2]:.1f} m), expected "
            "poses in its coordinates, or --origin"
        )


def _calibrated(config: RadarConfig) -> FrontEndConfig:
    """Front end of the default board; with a channel calibration in the recording, of a board that it is exact for."""
    if config.channel_calibration is None:
        return FrontEndConfig.of(config.board)
    # The simulated board applies the antennas' signs itself.
    channels = load_board(config.board).signs / config.channel_factors
    return FrontEndConfig.of(config.board, mismatch=Mismatch(channels=tuple(map(Channel.of, channels.ravel()))))
