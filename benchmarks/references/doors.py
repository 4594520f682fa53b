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

#: Behind the radar, where it sees nothing: a scene has to have something that stands.
BEHIND = SceneObject("behind", shapes.rectangle((-9, 0, 0), (0.1, 0.1), (-1, 0, 0)), MATERIALS["wood"])

HINGE, WIDTH, HEIGHT, THICKNESS = np.array([2.0, -0.45, 0.0]), 0.9, 2.0, 0.04


def door(angle, material="wood", **values):
    """One that stands still at an angle, deg from the x axis, if nothing else is said."""
    place = {"hinge": tuple(HINGE), "width": WIDTH, "height": HEIGHT, "thickness": THICKNESS}
    return Door(name="door", material=material, **(place | {"angles": (angle, angle)} | values))


def finder(things, movers=(), surface=NOTHING):
    """Of a scene with some things, and movers without scatterers of their own."""
    scene = Scene("door", [BEHIND, *things])
    moving = MovingTargets(list(movers), np.random.default_rng(0))
    moving.sigma[:] = 1e-30
    reflectors = Reflectors.of(scene, CONFIG)
    return PathFinder(scene, surface, reflectors, CONFIG, 1e-13, antenna=ISOTROPIC, moving=moving)


def swinging(angle):
    """A door on its way, at an angle (deg) at the time `MIDDLE`, some 0.8 rad/s fast."""
    return door(0, angles=(angle - 30, angle + 30), period=4.0)


#: The middle of a burst, s, and the ends of it and the middle after that.
MIDDLE = 1.0

HALF = (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2

INSTANTS = np.array([-1.0, 0.0, 1.0])


def foot_speed(mover):
    """At which the point of a swinging door nearest the radar closes in at `MIDDLE`, m/s: omega times its way along."""
    angle, rate = np.deg2rad(np.mean(mover.angles)), np.pi / mover.period * np.deg2rad(np.ptp(mover.angles))
    return -rate * HINGE @ [np.cos(angle), np.sin(angle), 0.0]


def lengths(echoes):
    """Paths of echoes at the instants, (echo, virtual, instant), m."""
    fit = echoes.lengths(CONFIG, Rig(), MIDDLE - CONFIG.burst_center)
    return np.stack([fit @ [1, s, s * s] for s in INSTANTS], axis=-1)
