"""One recording from one scene and one motion: the simulator's main loop."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float, Int16
from threadpoolctl import ThreadpoolController

from radarize import __version__
from radarize.errors import InputError
from radarize.radar.cfg import load_config
from radarize.radar.config import RadarConfig
from radarize.radar.limits import check_limits
from radarize.recording import Product, RecordingWriter, Stream
from radarsim.motion import Motion, motion_from_tum, plan_motion
from radarsim.physics.crowd import Crowd
from radarsim.physics.curved import Curved
from radarsim.physics.direct import DirectSum
from radarsim.physics.echoes import Echoes, Provenance
from radarsim.physics.facets import Facets
from radarsim.physics.finder import EchoFinder
from radarsim.physics.frontend import FrontEnd
from radarsim.physics.frontend_config import FrontEndConfig
from radarsim.physics.pathsolver import PathSolverFinder
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import Synthesizer
from radarsim.scene.scene import Scene

#: Bearings of the true planar scan, rad: the radar's own 88 columns of one degree.
SCAN_AZIMUTHS = np.deg2rad(np.arange(-44, 44))
#: Parts of /truth/adc_by_cause, in this order.
CAUSES = (*(p.name.lower() for p in Provenance), "leakage")
_BATCH = 8


def _on_one_blas_thread(method: Callable) -> Callable:
    """Numba's and Mitsuba's threads spin for work; a BLAS that wakes threads of its own beside them costs a third."""

    @wraps(method)
    def limited(self, *arguments):
        with self._threads.limit(limits=1, user_api="blas"):
            return method(self, *arguments)

    return limited


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
        self._threads = ThreadpoolController()
        world, crowd, self._noise, board = rng.spawn(4)
        self.front_end = FrontEnd(config, front_end, board)
        weakest, antenna = self.front_end.weakest, self.front_end.settings.pattern
        if engine == "sionna":
            self.finder = PathSolverFinder(scene, config, weakest, antenna, int(world.integers(2**31)))
        else:
            band = self.front_end.settings.band
            reach = None if band is None else band.high * config.max_range  # where the IF filter closes
            self.finder = EchoFinder(
                scene, Surface(scene, world), Facets.of(scene, config), config, weakest, reach, antenna,
                curved=Curved.of(scene, config), crowd=Crowd(scene.movers, crowd),
            )  # fmt: skip
        self.synthesize = Synthesizer(config) if device == "cpu" else DirectSum(config, device)

    @_on_one_blas_thread
    def echoes(self, times: Float[np.ndarray, "frame"]) -> list[Echoes]:
        """Echoes of the frames that start at `times` (s), found at the middle of each burst."""
        middle = np.asarray(times) + self.config.burst_center
        return self.finder.batch(self.motion.position(middle), self.motion.rotation(middle).as_matrix(), middle)

    @_on_one_blas_thread
    def frames(
        self, times: Float[np.ndarray, "frame"]
    ) -> tuple[Int16[np.ndarray, "frame loop tx rx sample 2"], list[Echoes]]:
        """Samples of the frames that start at `times` (s), and the echoes in them."""
        echoes = self.echoes(times)
        signals = self.synthesize.batch(*self._received(times, echoes))
        return np.stack([self.front_end.digitize(signal, self._noise) for signal in signals]), echoes

    @_on_one_blas_thread
    def frames_by_cause(
        self, times: Float[np.ndarray, "frame"]
    ) -> tuple[
        Int16[np.ndarray, "frame loop tx rx sample 2"],
        list[Echoes],
        Complex[np.ndarray, "frame cause loop tx rx sample"],
    ]:
        """As `frames`, and the counts that each of `CAUSES` makes before noise and converter."""
        echoes = self.echoes(times)
        samples, parts = [], []
        for lengths, amplitudes, present in zip(*self._received(times, echoes), echoes, strict=True):
            masks = [present.provenance == p for p in Provenance]
            signals = self.synthesize.batch([lengths[m] for m in masks], [amplitudes[m] for m in masks])
            parts.append(np.stack(self.front_end.by_cause(list(signals))))
            samples.append(self.front_end.digitize(np.sum(signals, axis=0), self._noise))
        return np.stack(samples), echoes, np.stack(parts)

    def _received(self, times, echoes: list[Echoes]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Path lengths and amplitudes behind the IF filters, by frame."""
        lengths = [e.lengths(self.config, self.motion, t) for t, e in zip(times, echoes, strict=True)]
        filtered = [
            e.amplitude * self.front_end.if_response(length[:, 0, 0]) for length, e in zip(lengths, echoes, strict=True)
        ]
        return lengths, filtered


def simulate(
    scene: str,
    output: Path,
    *,
    platform: str = "handheld",
    trajectory: Path | None = None,
    duration: float = 40.0,
    seed: int = 0,
    radar: str = "radarize",
    device: str = "cpu",
    frontend: Path | None = None,
    provenance: bool = False,
    engine: str = "radarsim",
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Simulate a recording.

    Args:
        scene: YAML file, or the name of a scene that comes with the project.
        output: recording to write.
        platform: ``handheld``, ``cart`` or ``robot``: how a planned tour moves.
        trajectory: TUM file of sensor poses to follow instead of a planned tour.
        duration: s; a trajectory that is shorter ends the recording.
        seed: of the tour, the scatterers and the noise.
        radar: preset or configuration file.
        device: ``cpu`` or ``cuda``.
        frontend: front-end file (see `FrontEndConfig`; `calibrate` writes them); default: an IWR1843BOOST's.
        provenance: also write I/Q by cause, before noise and converter, as /truth/adc_by_cause. Such recordings are
            several times as large.
        engine: ``radarsim``, or ``sionna``: the paths of Sionna RT's own solver, for comparison. Its known defects
            stand at the head of `physics.pathsolver`: corners, small facets and half of the ghosts are wrong, and
            speckle is drawn anew for every frame.
        progress: called with (frames done, frames in all).

    Returns:
        the path written.

    Raises:
        InputError: unusable scene, configuration, trajectory or output.
    """
    if not (np.isfinite(duration) and duration > 0):
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
    settings = FrontEndConfig.load(frontend) if frontend else FrontEndConfig()
    world = Scene.load(scene)
    route, physics = np.random.default_rng(seed).spawn(2)
    if trajectory is not None:
        motion = motion_from_tum(trajectory)
    else:
        motion = plan_motion(world, platform, duration, route)
    simulator = Simulator(world, motion, config, physics, device, settings, engine)
    frames = int(np.floor((min(duration, motion.duration) - config.burst_time) / config.frame_period)) + 1
    if frames < 1:
        raise InputError(f"duration is {duration} s, expected at least one frame of {config.frame_period} s")
    times = np.arange(frames) * config.frame_period
    start = motion.position(np.array([config.burst_center]))[0]
    attributes = {
        "source": "radarsim simulate",
        "scene": world.name,
        "platform": "trajectory" if trajectory is not None else platform,
        "seed": seed,
        "radarsim_version": __version__,
        "engine": engine,
        "front_end": settings.model_dump_json(),
    }
    if engine == "radarsim":
        attributes |= {"scatterers": len(simulator.finder.surface), "facets": len(simulator.finder.facets)}
    products = {
        "truth/scan_azimuths": Product(SCAN_AZIMUTHS, "rad", "bearings of /truth/scan, positive to the left"),
        "truth/floor_plan": Product(
            world.floor_plan(float(start[2])), "m", "x0 y0 x1 y1 of everything cut by the plane of the sensor at start"
        ),
    }
    streams = {
        "truth/time": Stream((), "f8", "s", "middle of the frame's burst: the instant of the other truth streams"),
        "truth/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the sensor in the world"),
        "truth/velocity": Stream((6,), "f8", "m/s, rad/s", "linear, then angular velocity of the sensor, sensor frame"),
        "truth/scan": Stream((len(SCAN_AZIMUTHS),), "f4", "m", "range of the first surface in the horizontal plane"),
        "truth/echoes": Stream((len(Provenance),), "i4", "", "echoes per cause: " + _causes()),
        "truth/echo_power": Stream((len(Provenance),), "f4", "1", "received over transmitted power: " + _causes()),
    }
    if provenance:
        streams["truth/adc_by_cause"] = Stream(
            (len(CAUSES), *config.frame_shape),
            "f2",
            "ADC counts",
            "I/Q before noise and converter, by cause, which add up: " + ", ".join(CAUSES),
        )
    with RecordingWriter(
        output, config, cfg_text=cfg_text, attributes=attributes, products=products, streams=streams
    ) as writer:
        for first in range(0, frames, _BATCH):
            batch = times[first : first + _BATCH]
            rows = {}
            if provenance:
                samples, echoes, parts = simulator.frames_by_cause(batch)
                rows["truth__adc_by_cause"] = np.stack([parts.real, parts.imag], axis=-1).astype(np.float16)
            else:
                samples, echoes = simulator.frames(batch)
            rows |= _truth(world, motion, batch + config.burst_center, config.max_range)
            writer.append(samples, batch, **rows, **_counts(echoes))
            if progress:
                progress(first + len(batch), frames)
    return Path(output)


def _causes() -> str:
    return ", ".join(p.name.lower() for p in Provenance)


def _truth(world: Scene, motion: Motion, times: np.ndarray, max_range: float) -> dict[str, np.ndarray]:
    position, rotation = motion.position(times), motion.rotation(times)
    pose = np.concatenate([position, rotation.as_quat()], axis=1)
    velocity = np.concatenate([rotation.inv().apply(motion.velocity(times)), motion.angular_velocity(times)], axis=1)
    forward = rotation.apply([1.0, 0.0, 0.0])
    yaw = np.arctan2(forward[:, 1], forward[:, 0])
    scan = world.planar_scan(position, yaw, SCAN_AZIMUTHS, max_range)
    return {"truth__time": times, "truth__pose": pose, "truth__velocity": velocity, "truth__scan": scan}


def _counts(frames: list[Echoes]) -> dict[str, np.ndarray]:
    power = [[np.sum(np.abs(e.amplitude[e.provenance == p]) ** 2) for p in Provenance] for e in frames]
    count = [[np.sum(e.provenance == p) for p in Provenance] for e in frames]
    return {"truth__echoes": np.array(count), "truth__echo_power": np.array(power)}
