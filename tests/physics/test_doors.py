"""Doors that move echo like doors that stand: flash, mirror, let through; and what moves with them moves in phase."""

import numpy as np
import pytest

from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.presets import PRESETS
from radarsim.physics.antenna import ISOTROPIC
from radarsim.physics.echoes import Provenance
from radarsim.physics.finder import EchoFinder
from radarsim.physics.movingtargets import MovingTargets
from radarsim.physics.reflectors import Reflectors
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.surface import Surface
from radarsim.scene import shapes
from radarsim.scene.materials import MATERIALS
from radarsim.scene.movers import Door
from radarsim.scene.scene import Scene, SceneObject
from tests.physics.rigs import Rig, field

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
HERE, AHEAD = np.zeros(3), np.eye(3)
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
#: Behind the radar, where it sees nothing: a scene has to have something that stands.
BEHIND = SceneObject("behind", shapes.rectangle((-9, 0, 0), (0.1, 0.1), (-1, 0, 0)), MATERIALS["wood"])
LAMP = SceneObject("lamp", shapes.sphere((2.0, 0.9, 0.1), 0.1, 3), MATERIALS["metal"])
HINGE, WIDTH, HEIGHT, THICKNESS = np.array([2.0, -0.45, 0.0]), 0.9, 2.0, 0.04


def door(angle, material="wood", **values):
    """One that stands still at an angle, deg from the x axis, if nothing else is said."""
    place = {"hinge": tuple(HINGE), "width": WIDTH, "height": HEIGHT, "thickness": THICKNESS}
    return Door(name="door", material=material, **(place | {"angles": (angle, angle)} | values))


def standing(angle, material="wood"):
    """The same leaf as a thing that stands."""
    turn = np.deg2rad(angle)
    center = HINGE + WIDTH / 2 * np.array([np.cos(turn), np.sin(turn), 0])
    leaf = shapes.placed(shapes.box((0, 0, 0), (WIDTH, THICKNESS, HEIGHT)), center, (0, 0, turn))
    return SceneObject("leaf", leaf, MATERIALS[material])


def finder(things, movers=(), surface=NOTHING, **options):
    """Of a scene with some things and movers."""
    scene = Scene("door", [BEHIND, *things])
    moving = MovingTargets(list(movers), np.random.default_rng(0), density=300.0)
    return EchoFinder(scene, surface, Reflectors.of(scene, CONFIG), CONFIG, moving=moving, **options)


def both(angle, things=(), surface=NOTHING, **options):
    """Echoes of a door that stands, and of one that moves but not now."""
    stands = finder([standing(angle), *things], surface=surface, **options)
    moves = finder(things, [door(angle)], surface, **options)
    return stands(HERE, AHEAD), moves(HERE, AHEAD)


def images(echoes):
    """Those that are images: no scatterers."""
    n = len(echoes.points)
    return type(echoes)(echoes.points[:0], echoes.images, echoes.amplitude[n:], echoes.provenance[n:])


@pytest.mark.parametrize("angle", [90.0, 91.5, 84.0, 60.0, 20.0])
def test_a_door_flashes_as_if_it_stood(angle):
    """Faces, edges and corners: the same field, power and phase, at any angle."""
    stands, moves = both(angle)
    truth, found = (field(images(e), HERE, LAMBDA) for e in (stands, moves))
    assert abs(truth) > 0
    assert abs(found - truth) < 1e-3 * abs(truth)
    assert (moves.provenance == Provenance.MOVING).all()


@pytest.mark.parametrize("angle", [90.0, 70.0, 45.0, 10.0])
def test_a_door_scatters_no_more_than_if_it_stood(angle):
    """Mean power of what is not a flash."""
    scene = Scene("door", [standing(angle)])
    powers = []
    for seed in range(4):
        surface = Surface(scene, np.random.default_rng(seed))
        scattered = EchoFinder(scene, surface, None, CONFIG)(HERE, AHEAD)
        crowd = MovingTargets([door(angle)], np.random.default_rng(seed), density=300.0)
        moved = EchoFinder(None, NOTHING, None, CONFIG, moving=crowd)(HERE, AHEAD)
        powers.append([np.sum(np.abs(e.amplitude) ** 2) for e in (scattered, moved)])
    truth, found = np.mean(powers, axis=0)
    assert 10 * np.log10(found / truth) == pytest.approx(0, abs=1)


def swinging(period=4.0):
    """A door on its way, at about 90 deg where its face is turned to the radar, and when."""
    return door(0, angles=(60.0, 120.0), period=period), period / 4


def plane(mover, t):
    """Normal towards the radar, and distance, of the face of a door that is turned to the origin."""
    low, high = np.deg2rad(mover.angles)
    angle = (low + high) / 2 - (high - low) / 2 * np.cos(2 * np.pi * t / mover.period)
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    return normal, -HINGE @ normal - THICKNESS / 2


def test_a_flash_moves_as_the_door_does():
    """Its path, antenna by antenna, at the burst's ends and in its middle; and its Doppler is that of the foot."""
    mover, middle = swinging()
    time = middle - CONFIG.burst_center
    echoes = finder([], [mover])(HERE, AHEAD, middle)
    moves = images(echoes)
    moves = type(moves)(moves.points, moves.images, moves.amplitude, moves.provenance, turns=echoes.turns)
    flash = np.abs(moves.amplitude).argmax()
    lengths = moves.lengths(CONFIG, Rig(), time)[flash]
    (normal, near), (_, far) = plane(mover, middle), plane(mover, middle + 1e-4)
    assert np.abs((far - near) / 1e-4) > 0.2
    for s in (-1.0, 0.0, 1.0):
        at = middle + s * (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2
        normal, away = plane(mover, at)
        tx, rx = tx_positions(CONFIG), rx_positions(CONFIG)
        mirrored = rx + 2 * (-away - rx @ normal)[:, None] * normal
        truth = np.linalg.norm(tx[:, None] - mirrored, axis=2).ravel()
        assert lengths @ [1, s, s * s] == pytest.approx(truth, abs=2e-6)


def test_a_lamp_is_seen_over_a_door():
    """Over its face on one way and on both: as strong, as long as over one that stands, and moving with it."""
    angle = 120.0
    stands, moves = both(angle, [LAMP])
    ghosts = [e for cause in (Provenance.GHOST_1, Provenance.GHOST_2) for e in (stands.of(cause),)]
    truth = np.concatenate([np.abs(e.amplitude[: len(e.points)]) for e in ghosts])
    n = len(moves.turns) and len(moves.points)
    over = np.abs(np.linalg.norm(moves.points - LAMP.mesh.center_mass, axis=2) - 0.1) > 0.02
    found = np.abs(moves.amplitude[:n][over.any(axis=1) & (moves.provenance[:n] == Provenance.MOVING)])
    assert len(truth) >= 1
    for strength in truth:
        assert np.abs(20 * np.log10(found / strength)).min() < 1.5
