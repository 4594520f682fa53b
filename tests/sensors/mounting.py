"""Radars with sensors beside them, and frames of which only the times matter."""

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.radar.presets import PRESETS
from radarsim.motion.trajectory import Motion
from radarsim.scenario import Scenario
from radarsim.sensors.sensor import Sensor
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]


def box(name: str, low, high, material: str = "concrete") -> SceneObject:
    """An axis-parallel box between two corners."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    mesh = trimesh.creation.box(high - low)
    mesh.apply_translation((low + high) / 2)
    return SceneObject(name, mesh, MATERIALS[material])


def beside(motion: Motion, *objects: SceneObject, movers=(), config=CONFIG, seed: int = 0) -> Scenario:
    """Radar for a sensor beside it, far from the scene's only object."""
    scene = Scene("test", [box("far", [900, 900, 900], [901, 901, 901]), *objects], movers)
    return Scenario(scene, motion, config, seed=seed)


def rows(sensor: Sensor, start: int, stop: int) -> dict[str, np.ndarray]:
    """Rows of a sensor for frames start...stop-1."""
    return sensor.observe(sensor.scenario.frames(np.arange(start, stop) * sensor.scenario.config.frame_period))


def stream(sensor: Sensor, name: str, count: int, batch: int = 8) -> np.ndarray:
    """All rows of a stream for a recording of `count` frames."""
    return np.concatenate([rows(sensor, i, min(i + batch, count))[name] for i in range(0, count, batch)])


def tumble(duration: float, rng: np.random.Generator) -> Motion:
    """Motion at walking pace with fast rotations about all axes, and a lever arm."""
    times = np.arange(-1.0, duration + 2, 0.25)
    place = np.cumsum(rng.normal(0, 0.12, (len(times), 3)), axis=0)
    turn = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.15, (len(times), 3)), axis=0))
    mount = Rotation.from_euler("ZYX", [3, 2, -1], degrees=True)
    return Motion(duration, CubicSpline(times, place), RotationSpline(times, turn), (0.12, 0.03, -0.05), mount)
