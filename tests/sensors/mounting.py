"""Rigs for tests of sensors, and frames of which only the times matter."""

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.radar.presets import PRESETS
from radarsim.motion import Motion
from radarsim.physics.frontend import FrontEnd
from radarsim.scene.materials import MATERIALS
from radarsim.scene.scene import Scene, SceneObject
from radarsim.sensors.sensor import Frames, Rig
from radarsim.sensors.sight import Sight

CONFIG = PRESETS["radarize"]


def box(name: str, low, high, material: str = "concrete") -> SceneObject:
    """An axis-parallel box between two corners."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    mesh = trimesh.creation.box(high - low)
    mesh.apply_translation((low + high) / 2)
    return SceneObject(name, mesh, MATERIALS[material])


def rig(motion: Motion, *objects: SceneObject, movers=(), config=CONFIG) -> Rig:
    """Something to mount sensors on, far from the one thing that every scene needs."""
    scene = Scene("test", [box("far", [900, 900, 900], [901, 901, 901]), *objects], movers)
    return Rig(scene, motion, config, FrontEnd(config), Sight(scene))


def frames(start: int, stop: int, config=CONFIG) -> Frames:
    """Frames start...stop-1 without samples."""
    return Frames(np.arange(start, stop) * config.frame_period, None, [], [], [])


def stream(sensor, name: str, count: int, batch: int = 8) -> np.ndarray:
    """All rows of a stream for a recording of `count` frames."""
    batches = [frames(i, min(i + batch, count)) for i in range(0, count, batch)]
    return np.concatenate([sensor.observe(each)[name] for each in batches])


def tumble(duration: float, rng: np.random.Generator) -> Motion:
    """Walking pace with lively turns about all axes, and a lever arm."""
    times = np.arange(-1.0, duration + 2, 0.25)
    place = np.cumsum(rng.normal(0, 0.12, (len(times), 3)), axis=0)
    turn = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.15, (len(times), 3)), axis=0))
    mount = Rotation.from_euler("ZYX", [3, 2, -1], degrees=True)
    return Motion(duration, CubicSpline(times, place), RotationSpline(times, turn), (0.12, 0.03, -0.05), mount)
