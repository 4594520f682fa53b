"""References for `tests/propagation/test_doors.py` and the gallery."""

import numpy as np

from benchmarks.references.rigs import Rig
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.movers import Door
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]

NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))

#: A static object behind the radar, which is invisible: a scene must have one.
BEHIND = SceneObject("behind", shapes.rectangle((-9, 0, 0), (0.1, 0.1), (-1, 0, 0)), MATERIALS["wood"])

HINGE, WIDTH, HEIGHT, THICKNESS = np.array([2.0, -0.45, 0.0]), 0.9, 2.0, 0.04


def door(angle, material="wood", **values):
    """Return a door, by default at rest at an angle from the x axis, deg."""
    place = {"hinge": tuple(HINGE), "width": WIDTH, "height": HEIGHT, "thickness": THICKNESS}
    return Door(name="door", material=material, **(place | {"angles": (angle, angle)} | values))


def finder(things, movers=(), surface=NOTHING):
    """Return a path finder of a scene with static objects, and moving ones without scatterers."""
    scene = Scene("door", [BEHIND, *things])
    moving = MovingTargets(list(movers), np.random.default_rng(0))
    moving.sigma[:] = 1e-30
    reflectors = Reflectors.of(scene, CONFIG)
    return PathFinder(scene, surface, reflectors, CONFIG, 1e-13, antenna=ISOTROPIC, moving=moving)


def swinging(angle):
    """Return a swinging door at an angle (deg) at the time `MIDDLE`, with about 0.8 rad/s."""
    return door(0, angles=(angle - 30, angle + 30), period=4.0)


#: Time of the middle of a burst, s; half its duration, s; its start, middle and end in units of that.
MIDDLE = 1.0

HALF = (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2

INSTANTS = np.array([-1.0, 0.0, 1.0])


def foot_speed(mover):
    """Return the closing speed at `MIDDLE` of the swinging door's point nearest to the radar, m/s: angular rate times
    distance from the hinge."""
    angle, rate = np.deg2rad(np.mean(mover.angles)), np.pi / mover.period * np.deg2rad(np.ptp(mover.angles))
    return -rate * HINGE @ [np.cos(angle), np.sin(angle), 0.0]


def lengths(echoes):
    """Return the path lengths of echoes at the start, middle and end of the burst, (echo, virtual, time), m."""
    fit = echoes.lengths(CONFIG, Rig(), MIDDLE - CONFIG.burst_center)
    return np.stack([fit @ [1, s, s * s] for s in INSTANTS], axis=-1)
