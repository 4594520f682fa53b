"""References for `tests/propagation/test_imagemethod.py` and the gallery."""

from itertools import product

import numpy as np

from benchmarks.references.corners import (
    both_ways,
)
from radarize.radar.presets import PRESETS
from radarsim.propagation import plates
from radarsim.propagation.reflectors import Reflectors
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]


def images_of_a_room(observation):
    """Return the images of a radar in a box room by walls and chains of walls: isometries, amplitudes, orders."""
    flat = Reflectors.of(Scene.load("physics/room"), CONFIG).flat
    parts = plates.specular_points(flat, observation, 0)
    single = parts.isometry
    walls = (
        np.abs(np.linalg.det(single[:, :, :3]) + 1 + np.abs(np.trace(single[:, :, :3], axis1=1, axis2=2) - 1)) < 1e-6
    )
    chain, isometry, amplitude = both_ways(flat, observation)
    order = np.concatenate([np.ones(walls.sum(), int), 2 + (chain[:, 1] != chain[:, 2])])
    return np.concatenate([single[walls], isometry]), np.concatenate([parts.amplitude[walls], amplitude]), order


def lattice(p):
    """Yield the same images by the lattice of mirrored rooms: order, whether each axis is mirrored, and position."""
    low, high = np.array([-2.5, -2, 0]), np.array([2.5, 2, 3])
    for cell in product(range(-3, 4), repeat=3):
        order, even = int(np.abs(cell).sum()), np.array(cell) % 2 == 0
        if 1 <= order <= 3:
            yield order, ~even, low + cell * (high - low) + np.where(even, p - low, high - p)
