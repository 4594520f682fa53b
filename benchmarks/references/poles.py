"""References for `tests/propagation/test_fresnelzone.py` and the gallery."""

import numpy as np

from benchmarks.references.brute_force import past_pole
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]

LAMBDA = CONFIG.wavelength

WALL = SceneObject("wall", shapes.rectangle((2, 0, 0), (6, 6), (-1, 0, 0)), MATERIALS["metal"])


def left(walls, things, path):
    """Return the level of the images at a path length behind obstacles without echoes, relative to free sight, dB."""
    reflectors = Reflectors.of(Scene("walls", walls), CONFIG)
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    fields = []
    for objects in ([*walls, *things], walls):
        finder = PathFinder(Scene("all", objects), nothing, reflectors, CONFIG, antenna=ISOTROPIC)
        found = finder(np.zeros(3), np.eye(3))
        fields.append(found.amplitude[np.abs(np.linalg.norm(found.images[:, :, 3], axis=1) - path) < 1e-3].sum())
    return 20 * np.log10(abs(fields[0]) / abs(fields[1]) + 1e-9)


def pole(x, y, radius=0.005, tilt=0.0):
    """Return a thin pole that is tilted in the plane across the path."""
    upright = shapes.cylinder((0, 0, 0), radius, 3.0, 24)
    return SceneObject("pole", shapes.placed(upright, (x, y, 0.0), (tilt, 0.0, 0.0)), MATERIALS["metal"])


#: Offsets of the pole, m: steps of 6 mm through the first Fresnel zones.
OFFSETS = np.arange(-7, 8) * 0.006


def wall_past_pole(offsets=OFFSETS, distance=1.0):
    """Return the level of a wall's specular reflection at 2 m past a pole of 1 cm at a distance, dB: by Kirchhoff's
    integral, and simulated."""
    truth = [20 * np.log10(abs(past_pole(y, 0.01, (distance, 4 - distance), 4.0, LAMBDA))) for y in offsets]
    return np.array(truth), np.array([left([WALL], [pole(distance, y)], 4.0) for y in offsets])
