"""Common parts of the laws: the radar, curves of theory and simulation, and simple scenes."""

import numpy as np
from matplotlib.axes import Axes

from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
HERE, AHEAD = np.zeros(3), np.eye(3)
NOWHERE = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
THEORY = {"color": "black", "lw": 1, "label": "theory"}
LEVEL = "received / transmitted, dB"
FOUND = {"color": "tab:red", "marker": "o", "ms": 3.5, "ls": "", "label": "simulated"}


def compare(axis: Axes, x, theory, found) -> float:
    """Plot theory and simulation over x; return the largest difference."""
    axis.plot(x, theory, **THEORY)
    axis.plot(x, found, **FOUND)
    return np.abs(np.asarray(found) - theory).max()


def target(*place: float) -> PathFinder:
    """Return a path finder of a point scatterer of 1 m^2."""
    return PathFinder(None, Scatterers.points(np.array(place), np.ones(1)), None, CONFIG, antenna=ISOTROPIC)


def walls_of(scene: Scene) -> PathFinder:
    """Return a path finder of the surfaces of a scene, without scatterers."""
    return PathFinder(scene, NOWHERE, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC)
