"""Junctions of walls, floors and boxes: a mirror that extends behind another returns the same as the bare corner."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.references import corners
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.paths import Kind
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))


def sheet(name, center, size, facing):
    return SceneObject(name, shapes.rectangle(center, size, facing), MATERIALS["metal"])


def box(name, low, high):
    low, high = np.array(low, float), np.array(high, float)
    return SceneObject(name, shapes.box((low + high) / 2, high - low), MATERIALS["metal"])


#: An end wall at x = 3 and a side wall at y = 1, which end where they meet or run on; and a floor at z = -1.
END = sheet("end", (3, -1.5, 0), (5, 6), (-1, 0, 0))
SIDE = sheet("side", (0.5, 1, 0), (5, 6), (0, -1, 0))
END_ON = sheet("end", (3, 0.5, 0), (9, 6), (-1, 0, 0))
SIDE_ON = sheet("side", (3, 1, 0), (10, 6), (0, -1, 0))
END_BOX, SIDE_BOX = box("end", (3, -4, -3), (3.1, 1, 3)), box("side", (-2, 1, -3), (8, 1.1, 3))
FLOOR, FLOOR_ON = sheet("floor", (0.5, 0, -1), (5, 8), (0, 0, 1)), sheet("floor", (3, 0, -1), (10, 8), (0, 0, 1))
RAISED, RAISED_BOX = sheet("end", (3, 0, 1), (8, 4), (-1, 0, 0)), box("end", (3, -4, -1), (3.1, 4, 3))
SLAB = box("floor", (-2, -4, -1.2), (8, 4, -1))
UPRIGHT = {
    "L": (SIDE, END), "T": (SIDE_ON, END), "T of a box and a sheet": (SIDE_ON, END_BOX),
    "T of boxes": (SIDE_BOX, END_BOX), "T, the end runs on": (SIDE, END_ON), "X": (SIDE_ON, END_ON),
}  # fmt: skip
LEVEL = {"L": (FLOOR, RAISED), "T": (FLOOR_ON, RAISED), "T of a box and a sheet": (FLOOR_ON, RAISED_BOX),
         "T of boxes": (SLAB, RAISED_BOX), "X": (FLOOR_ON, END_ON)}  # fmt: skip


def echo(objects, position, target, isometry):
    """Sum of all images by an isometry (3 x 3), and whether any of them passes a slab."""
    scene = Scene("junction", list(objects))
    finder = PathFinder(scene, NOTHING, Reflectors.of(scene, CONFIG), CONFIG, 1e-9, antenna=ISOTROPIC)
    away = target - position
    yaw, pitch = np.arctan2(away[1], away[0]), -np.arcsin(away[2] / np.linalg.norm(away))
    found = finder(position, Rotation.from_euler("ZYX", [yaw, pitch, 0]).as_matrix())
    here = np.abs(found.images[:, :, :3] - isometry).max(axis=(1, 2)) < 1e-6
    path = np.linalg.norm(position - found.images[here, :, :3] @ position - found.images[here, :, 3], axis=1)
    some = found.where(kind=Kind.IMAGE)[here]
    return np.sum(some.amplitude * np.exp(2j * np.pi * path / LAMBDA)), some.through.any()


def check(objects, position, target, isometry):
    """Check within 0.3 dB and 3 deg against the image theory of perfect conductors at right angles: the radar's image
    by the isometry alone, of either polarity."""
    found, slab = echo(objects, position, target, isometry)
    distance = np.linalg.norm(target - position)
    way = (target - position) / distance
    up = np.array([0.0, 0.0, 1.0]) - way[2] * way
    polarity = np.sign(np.linalg.det(isometry) * up @ isometry @ up)
    truth = polarity * LAMBDA / (8 * np.pi * distance) * np.exp(4j * np.pi * distance / LAMBDA)
    assert 20 * np.log10(abs(found / truth)) == pytest.approx(0, abs=0.3)
    assert np.rad2deg(np.angle(found / truth)) == pytest.approx(0, abs=3)
    assert not slab


@pytest.mark.parametrize("kind", UPRIGHT)
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, -1.0, 0.3), (0.5, 0.3, -0.5), (2.2, -0.5, 0.1)])
def test_two_walls(kind, place):
    place = np.array(place)
    check(UPRIGHT[kind], place, np.array([3.0, 1.0, place[2]]), np.diag([-1.0, -1.0, 1.0]))


@pytest.mark.parametrize("kind", LEVEL)
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.0, -1.0, 0.5), (1.9, 0.4, -0.3)])
def test_a_wall_on_a_floor(kind, place):
    place = np.array(place)
    check(LEVEL[kind], place, np.array([3.0, place[1], -1.0]), np.diag([-1.0, 1.0, -1.0]))


BARE = (sheet("side", (0.5, 1, 1), (5, 4), (0, -1, 0)), sheet("end", (3, -1.5, 1), (5, 4), (-1, 0, 0)),
        sheet("floor", (0.5, -1.5, -1), (5, 5), (0, 0, 1)))  # fmt: skip


@pytest.mark.parametrize("walls", [BARE, (SIDE, END, FLOOR), (SIDE_ON, END_ON, FLOOR_ON), (SIDE_BOX, END_BOX, SLAB)])
@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (1.2, -0.6, 0.4)])
def test_a_corner_of_three(walls, place):
    """All six orders of a floor and two walls, which end at their junction or extend beyond it."""
    check(walls, np.array(place), np.array([3.0, 1.0, -1.0]), -np.eye(3))


@pytest.mark.parametrize("a", [0.02, 0.04])
def test_a_small_dihedral_whose_plate_runs_on(a):
    """8 pi a^2 b^2 / lambda^2, although one plate, or both, is three times as wide."""
    bare, towards = corners.corner(2, a, 0.03), corners.direction(np.pi / 4, 0)
    truth = 8 * np.pi * a**2 * 0.03**2 / LAMBDA**2
    for widened in ([], [0], [1], [0, 1]):
        plates = [list(row) for row in zip(bare.center, bare.u, bare.v, bare.half, strict=True)]
        for k in widened:
            plates[k][0] = plates[k][0] - a * (k == 0) * np.eye(3)[1] - a * (k == 1) * np.eye(3)[0]
            plates[k][3] = plates[k][3] * np.where(np.arange(2) == k, 3, 1)
        found = corners.cross_section(corners.conductors(*plates), towards)
        assert 10 * np.log10(found / truth) == pytest.approx(0, abs=0.2)


@pytest.mark.parametrize("off", [-1.0, -0.3, 0.3, 1.0])
@pytest.mark.parametrize("on", [0.0, 2.0])
def test_walls_out_of_square_that_run_on(off, on):
    """Two walls at 90 deg plus an angle: half a plane's diffraction, in either order of the walls."""
    angle, distance = np.deg2rad(off), 3.0
    half, objects = np.pi / 4 + angle / 2, []
    for side, more in ((1, 0.0), (-1, on)):
        along, width = np.array([np.cos(half), side * np.sin(half), 0.0]), 5.0 + more
        facing = np.array([np.sin(half), -side * np.cos(half), 0.0])
        objects.append(sheet(f"wall {side}", (width / 2 - more) * along, (width, 4.0), facing))
    position = np.array([distance, 0.0, 0.0])
    path, truth = corners.image_out_of_square(angle, distance)
    turn = Rotation.from_euler("z", np.pi + 2 * angle).as_matrix()
    for isometry in (turn, turn.T):
        found, slab = echo(objects, position, np.zeros(3), isometry)
        assert 20 * np.log10(abs(found) / abs(truth)) == pytest.approx(0, abs=0.3)
        assert np.rad2deg(np.angle(found / truth * np.exp(-2j * np.pi * path / LAMBDA))) == pytest.approx(0, abs=3)
        assert not slab
