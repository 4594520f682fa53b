"""References for `tests/propagation/test_hollow.py` and the gallery."""

from dataclasses import replace

import numpy as np
import shapely

from benchmarks.references.brute_force import transfer_matrix
from radarize.radar.config import SPEED_OF_LIGHT
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

BOARD = MATERIALS["plasterboard"]

NEAR, DEEP = 2.0, 0.1

SWEEP = CONFIG.center_frequency + CONFIG.bandwidth * ((np.arange(CONFIG.samples) + 0.5) / CONFIG.samples - 0.5)

RANGES = NEAR + np.arange(-0.1, 0.3, 0.0005)


def echoes(*objects):
    """Return the echoes of objects, with the radar at the origin."""
    scene = Scene("hollow", list(objects))
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    return PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC)(np.zeros(3), np.eye(3))


def profile(spectrum):
    """Return the range profile of a beat signal, dB."""
    turns = np.exp(-4j * np.pi / SPEED_OF_LIGHT * SWEEP * RANGES[:, None])
    return 20 * np.log10(np.abs(turns @ (spectrum * np.hanning(len(SWEEP)))))


def reflected(layers):
    """Return the range profile of layers (permittivity, thickness) by transfer matrices at each frequency, dB."""
    gamma = np.array([transfer_matrix(layers, 1.0, f, False)[1] for f in SWEEP])
    return profile(np.conj(gamma) * np.exp(4j * np.pi / SPEED_OF_LIGHT * SWEEP * NEAR) / NEAR)


def simulated(*objects):
    """Return the simulated range profile of objects, relative to the echo of an infinite conductor times its distance,
    dB."""
    found = echoes(*objects)
    path = np.linalg.norm(found.images[:, :, 3], axis=1)
    facing = path < 2 * (NEAR + 2 * DEEP)
    turns = np.exp(2j * np.pi / SPEED_OF_LIGHT * SWEEP[:, None] * path[facing])
    return profile(8 * np.pi / CONFIG.wavelength * turns @ found.amplitude[facing])


def stud_wall():
    """Return range profiles of a wall of two boards, 10 cm deep: by transfer matrices, and simulated, dB."""
    layers = [(BOARD.permittivity_at(CONFIG.center_frequency), BOARD.thickness), (1.0, DEEP - 2 * BOARD.thickness)]
    wall = SceneObject("wall", shapes.box((NEAR + DEEP / 2, 0, 0), (DEEP, 6, 6)), BOARD)
    return reflected([*layers, layers[0]]), simulated(wall)


def peak(level, low, high):
    """Return range (m) and level (dB) of the highest peak within a span."""
    some = np.flatnonzero((RANGES > NEAR + low) & (RANGES < NEAR + high))
    best = some[level[some].argmax()]
    return RANGES[best], level[best]


#: Materials thin enough for an echo of the rear face.
PANES = "glass", "plasterboard", "ceiling board", "acrylic", "plywood"


def pane(name):
    """Return range profiles of a smooth sheet: by transfer matrices, and simulated, dB."""
    material = replace(MATERIALS[name], roughness=0.0)
    sheet = shapes.polygon(shapely.box(-3, -3, 3, 3), (NEAR, 0, 0), (0, 1, 0), (0, 0, 1))
    layer = material.permittivity_at(CONFIG.center_frequency), material.thickness
    return reflected([layer]), simulated(SceneObject("pane", sheet, material))
