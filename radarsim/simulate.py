"""One recording from one scene and one motion: the simulator's main loop."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int16

from radarize import __version__
from radarize.errors import InputError
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits
from radarize.radar.presets import load_config
from radarize.recording import RecordingWriter
from radarsim.motion import Motion, Mounting, motion_from_tum
from radarsim.physics.direct import DirectSum
from radarsim.physics.echoes import Echoes, Provenance
from radarsim.physics.finder import EchoFinder
from radarsim.physics.frontend import FrontEnd
from radarsim.physics.frontend_config import FrontEndConfig
from radarsim.physics.movingtargets import MovingTargets
from radarsim.physics.pathsolver import PathSolverFinder
from radarsim.physics.reflectors import Reflectors
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import Synthesizer
from radarsim.planner import plan_motion
from radarsim.scene.scene import Scene
from radarsim.sensors.sensor import Frames, Rig
from radarsim.sensors.sight import Sight
from radarsim.sensors.suite import Suite, chosen
from radarsim.statistics import crossings
from radarsim.threads import one_blas_thread
from radarsim.waypoints import read_waypoints

BATCH = 8
_TOUR = 40.0  # s, unless asked for


class Simulator:
    """A radar in a scene: echoes, synthesis and front end for the frame at any instant of a motion.

    Args:
        scene: the world.
        motion: the sensor's motion.
        config: radar configuration.
        rng: draws the world's scatterers, the noise, and what differs from board to board.
        device: ``cpu``, or ``cuda`` for the direct sum on a GPU.
        front_end: settings; default: an IWR1843BOOST's.
        engine: ``radarsim``, or ``sionna`` for the paths of Sionna RT's solver (see `physics.pathsolver`).
    """

    def __init__(
        self,
        scene: Scene,
        motion: Motion,
        config: RadarConfig,
        rng: np.random.Generator,
        device: str = "cpu",
        front_end: FrontEndConfig | None = None,
        engine: str = "radarsim",
    ):
        self.motion, self.config = motion, config
        world, crowd, self._noise, board = rng.spawn(4)
        self.front_end = FrontEnd(config, front_end, board)
        weakest, antenna = self.front_end.weakest, self.front_end.settings.pattern
        if engine == "sionna":
            self.finder = PathSolverFinder(scene, config, weakest, antenna, int(world.integers(2**31)))
        else:
            band = self.front_end.settings.band
            reach = None if band is None else band.high * config.max_range  # where the IF filter closes
            self.finder = EchoFinder(
                scene, Surface(scene, world), Reflectors.of(scene, config), config, weakest, reach, antenna,
                MovingTargets(scene.movers, crowd),
            )  # fmt: skip
        self.synthesize = Synthesizer(config) if device == "cpu" else DirectSum(config, device)

    @one_blas_thread
    def echoes(self, times: Float[np.ndarray, "frame"]) -> list[Echoes]:
        """Echoes of the frames that start at `times` (s), found at the middle of each burst."""
        middle = np.asarray(times) + self.config.burst_center
        return self.finder.batch(self.motion.position(middle), self.motion.rotation(middle).as_matrix(), middle)

    def frames(
        self, times: Float[np.ndarray, "frame"]
    ) -> tuple[Int16[np.ndarray, "frame loop tx rx sample 2"], list[Echoes]]:
        """Samples of the frames that start at `times` (s), and the echoes in them."""
        frames = self.observe(times)
        return frames.samples, frames.echoes

    @one_blas_thread
    def observe(self, times: Float[np.ndarray, "frame"], by_cause: bool = False) -> Frames:
        """All there is to know of the frames that start at `times` (s), with the counts of each cause if asked for."""
        echoes = self.echoes(times)
        lengths, amplitudes = self._received(times, echoes)
        parts = None
        if by_cause:
            split = [self._split(*each) for each in zip(lengths, amplitudes, echoes, strict=True)]
            signals = [np.sum(each, axis=0) for each in split]
            parts = np.stack([np.stack(self.front_end.by_cause(each)) for each in split])
        else:
            signals = self.synthesize.batch(lengths, amplitudes)
        samples = np.stack([self.front_end.digitize(signal, self._noise) for signal in signals])
        return Frames(np.asarray(times), samples, echoes, lengths, amplitudes, parts)

    def _split(self, lengths: np.ndarray, amplitudes: np.ndarray, echoes: Echoes) -> list[np.ndarray]:
        """Beat signals of each cause."""
        masks = [echoes.provenance == p for p in Provenance]
        return list(self.synthesize.batch([lengths[m] for m in masks], [amplitudes[m] for m in masks]))

    def _received(self, times, echoes: list[Echoes]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Path lengths and amplitudes behind the IF filters, by frame."""
        lengths = [e.lengths(self.config, self.motion, t) for t, e in zip(times, echoes, strict=True)]
        for each in lengths:
            each[..., 0] += 2 * self.config.range_bias  # a board's own delay, which the pipeline takes off again
        filtered = [
            e.amplitude * self.front_end.if_response(length[:, 0, 0]) for length, e in zip(lengths, echoes, strict=True)
        ]
        return lengths, filtered


def simulate(
    scene: str | Path | Scene,
    output: Path,
    *,
    platform: str = "handheld",
    trajectory: Path | None = None,
    waypoints: Path | Float[np.ndarray, "n 2"] | None = None,
    planned_in: Scene | None = None,
    mounting: Mounting | None = None,
    duration: float | None = None,
    seed: int = 0,
    radar: str | RadarConfig = "radarize",
    device: str = "cpu",
    frontend: Path | FrontEndConfig | None = None,
    provenance: bool = False,
    engine: str = "radarsim",
    sensors: Sequence[str] = (),
    attributes: Mapping[str, object] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Simulate a recording.

    Args:
        scene: a scene, its YAML file, or the name of one that comes with the project.
        output: recording to write.
        platform: ``handheld``, ``cart`` or ``robot``: how a planned tour moves.
        trajectory: TUM file of poses to follow instead of a planned tour; of the sensor, or if there is a mounting, of
            the body that carries it.
        waypoints: places to go through on the platform instead of a tour, m, or a file of them
            (`waypoints.read_waypoints`).
        planned_in: the scene for which tour or walk is planned, so that scenes which differ can share one; default:
            the scene itself.
        mounting: of the sensor on the platform; default: the platform's own.
        duration: s; default: 40 s of a tour, or all of a trajectory or walk, which end the recording if shorter.
        seed: of the tour, the scatterers and the noise.
        radar: preset, configuration file or configuration.
        device: ``cpu`` or ``cuda``.
        frontend: front end or file of one (see `FrontEndConfig`; `calibrate` writes them); default: an IWR1843BOOST's.
        provenance: also write I/Q by cause, before noise and converter, as /truth/adc_by_cause. Such recordings are
            several times as large.
        engine: ``radarsim``, or ``sionna``: the paths of Sionna RT's own solver, for comparison. Its known defects
            stand at the head of `physics.pathsolver`: corners, small facets and half of the ghosts are wrong, and
            speckle is drawn anew for every frame.
        sensors: that accompany the radar: names from `radarsim.sensors.suite.SENSORS`, or ``all``. The radar's samples
            are the same whatever is chosen.
        attributes: more attributes of the file.
        progress: called with (frames done, frames in all).

    Returns:
        the path written.

    Raises:
        InputError: unusable scene, configuration, trajectory, way-points, sensor or output.
    """
    if duration is not None and not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration is {duration} s, expected a positive number of seconds")
    config, cfg_text = load_config(radar)
    check_limits(config)
    if device not in ("cpu", "cuda"):
        raise InputError(f"device is {device!r}, expected cpu or cuda")
    if device == "cuda":
        import torch

        if not torch.cuda.is_available():
            raise InputError("device is cuda, but this machine has no usable CUDA GPU, expected --device cpu")
    if engine not in ("radarsim", "sionna"):
        raise InputError(f"engine is {engine!r}, expected radarsim or sionna")
    chosen(sensors)
    settings = FrontEndConfig.load(frontend) if isinstance(frontend, (str, Path)) else frontend or FrontEndConfig()
    world = scene if isinstance(scene, Scene) else Scene.load(scene)
    route, physics = np.random.default_rng(seed).spawn(2)
    if trajectory is not None and waypoints is not None:
        raise InputError("both a trajectory and way-points are given, expected one of them")
    if trajectory is not None:
        motion = motion_from_tum(trajectory, mounting)
    else:
        places = read_waypoints(waypoints) if isinstance(waypoints, (str, Path)) else waypoints
        length = _TOUR if duration is None and places is None else duration
        motion = plan_motion(planned_in or world, platform, length, route, places, mounting)
    motion = motion if duration is None else motion.until(duration)
    crossed = crossings(motion, world)
    simulator = Simulator(world, motion, config, physics, device, settings, engine)
    frames = config.frames_within(motion.duration)
    if frames < 1:
        raise InputError(f"duration is {motion.duration:g} s, expected at least one frame of {config.frame_period} s")
    times = np.arange(frames) * config.frame_period
    facts = {
        "source": "radarsim simulate",
        "scene": world.name,
        "platform": "trajectory" if trajectory is not None else platform,
        "seed": seed,
        "radarsim_version": __version__,
        "engine": engine,
        "front_end": settings.model_dump_json(),
        "motion": motion.statistics(world).json(),
        "warnings": f"{trajectory or 'walk'}: {crossed}" if crossed else "",
    }
    if engine == "radarsim":
        facts |= {"scatterers": len(simulator.finder.surface), "facets": len(simulator.finder.reflectors.flat)}
    suite = Suite(Rig(world, motion, config, simulator.front_end, Sight(world)), sensors, seed, provenance)
    return record(
        output, simulator, suite, times, cfg_text=cfg_text, attributes=facts | dict(attributes or {}),
        by_cause=provenance, progress=progress,
    )  # fmt: skip


def record(
    output: Path,
    simulator: Simulator,
    suite: Suite,
    times: Float[np.ndarray, "frame"],
    *,
    start: float = 0.0,
    valid: Bool[np.ndarray, "frame loop tx"] | None = None,
    cfg_text: str = "",
    attributes: Mapping[str, object],
    by_cause: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Simulate frames and write them.

    Args:
        output: recording to write.
        simulator: of the radar.
        suite: the sensors beside it.
        times: of the frames' starts on the clock of the motion, s.
        start: stamp of that clock's zero, s.
        valid: False where a chirp is lost; its samples are then zero, as a capture's are.
        cfg_text: original configuration text.
        attributes: of the file.
        by_cause: whether the suite records I/Q by cause.
        progress: called with (frames done, frames in all).

    Raises:
        InputError: the recording cannot be written.
    """
    with RecordingWriter(
        output, simulator.config, cfg_text=cfg_text, attributes=attributes, products=suite.products,
        streams=suite.streams,
    ) as writer:  # fmt: skip
        for first in range(0, len(times), BATCH):
            batch = simulator.observe(times[first : first + BATCH], by_cause)
            arrived = None if valid is None else valid[first : first + BATCH]
            samples = batch.samples if arrived is None else batch.samples * arrived[..., None, None, None]
            rows = suite.observe(batch)
            for clock in suite.clocks & set(rows):
                rows[clock] = rows[clock] + start
            writer.append(samples, batch.times + start, arrived, rows=rows)
            if progress:
                progress(first + len(batch), len(times))
    return Path(output)
