"""One recording from one scene and one motion: the simulator's main loop."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int16

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
from radarsim.physics.echoes import Echoes, EchoFinder, Provenance
from radarsim.physics.facets import Facets
from radarsim.physics.frontend import FrontEnd
from radarsim.physics.surface import Surface
from radarsim.physics.synthesis import Synthesizer
from radarsim.scene.scene import Scene

#: Bearings of the true planar scan, rad: the radar's own 88 columns of one degree.
SCAN_AZIMUTHS = np.deg2rad(np.arange(-44, 44))
_BATCH = 8


class Simulator:
    """A radar in a scene: echoes, synthesis and front end for the frame at any instant of a motion.

    Args:
        scene: the world.
        motion: the sensor's motion.
        config: radar configuration.
        rng: draws the world's scatterers, then the noise.
        device: ``cpu``, or ``cuda`` for the direct sum on a GPU.
    """

    def __init__(
        self, scene: Scene, motion: Motion, config: RadarConfig, rng: np.random.Generator, device: str = "cpu"
    ):
        self.motion, self.config = motion, config
        world, crowd, self._noise = rng.spawn(3)
        self.front_end = FrontEnd(config)
        self.finder = EchoFinder(
            scene, Surface(scene, world), Facets.of(scene, config), config, self.front_end.weakest,
            curved=Curved.of(scene, config), crowd=Crowd(scene.movers, crowd),
        )  # fmt: skip
        self.synthesize = Synthesizer(config) if device == "cpu" else DirectSum(config, device)

    def echoes(self, times: Float[np.ndarray, "frame"]) -> list[Echoes]:
        """Echoes of the frames that start at `times` (s), found at the middle of each burst."""
        middle = np.asarray(times) + self.config.burst_center
        return self.finder.batch(self.motion.position(middle), self.motion.rotation(middle).as_matrix(), middle)

    def frames(
        self, times: Float[np.ndarray, "frame"]
    ) -> tuple[Int16[np.ndarray, "frame loop tx rx sample 2"], list[Echoes]]:
        """Samples of the frames that start at `times` (s), and the echoes in them."""
        echoes = self.echoes(times)
        samples = []
        for time, present in zip(times, echoes, strict=True):
            lengths = present.lengths(self.config, self.motion, time)
            response = self.front_end.if_response(lengths[:, 0, 0])
            signal = self.synthesize(lengths, present.amplitude * response)
            samples.append(self.front_end.digitize(signal, self._noise))
        return np.stack(samples), echoes


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
    world = Scene.load(scene)
    route, physics = np.random.default_rng(seed).spawn(2)
    if trajectory is not None:
        motion = motion_from_tum(trajectory)
    else:
        motion = plan_motion(world, platform, duration, route)
    simulator = Simulator(world, motion, config, physics, device)
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
        "scatterers": len(simulator.finder.surface),
        "facets": len(simulator.finder.facets),
    }
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
    with RecordingWriter(
        output, config, cfg_text=cfg_text, attributes=attributes, products=products, streams=streams
    ) as writer:
        for first in range(0, frames, _BATCH):
            batch = times[first : first + _BATCH]
            samples, echoes = simulator.frames(batch)
            writer.append(
                samples,
                batch,
                **_truth(world, motion, batch + config.burst_center, config.max_range),
                **_counts(echoes),
            )
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
    power = [[np.sum(np.abs(e.of(p).amplitude) ** 2) for p in Provenance] for e in frames]
    count = [[np.sum(e.provenance == p) for p in Provenance] for e in frames]
    return {"truth__echoes": np.array(count), "truth__echo_power": np.array(power)}
