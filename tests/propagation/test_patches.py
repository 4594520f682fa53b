"""Smooth curved surfaces against the physical-optics integral over the bodies that their meshes approximate."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks.references.rigs import Rig, isotropic
from benchmarks.references.smooth_bodies import (
    CONFIG,
    LAMBDA,
    capsule,
    ellipsoid,
    field,
    grid,
    half_cylinder,
    physical_optics,
    reflectors,
    rounded,
    stretched,
    tube,
)
from radarize.radar.array import rx_positions, tx_positions
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.mechanisms import curved_ghosts
from radarsim.propagation.paths import Kind
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from tests.propagation.test_roundghosts import WALL, summed

NOTHING = Scatterers.points(np.zeros((0, 3)), np.zeros(0))


@cache
def body(make, *arguments):
    """Reflectors of a body's mesh, from its maker."""
    return reflectors(make(*arguments))


@cache
def samples(make, *arguments):
    """Positions, normals and areas of a body, from its maker."""
    return make(*arguments)


def decibels_and_degrees(found, truth):
    return 20 * np.log10(abs(found) / abs(truth)), np.rad2deg(np.angle(found / truth))


PLACES = [(-0.7, 0, 0), (0, 0.8, 0.4), (0.3, 0.2, 1.0), (2.0, -1, 3)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("axes", [(0.2, 0.2, 0.208), (0.15, 0.2, 0.3)])
def test_ellipsoids(axes, place):
    """A sphere stretched by 4 % and an ellipsoid: 0.4 dB and 3 deg (two thirds of it the mesh's)."""
    found, truth = field(body(stretched, axes), place), physical_optics(samples(ellipsoid, axes), place)
    off, turn = decibels_and_degrees(found, truth)
    assert off == pytest.approx(0, abs=0.4)
    assert turn == pytest.approx(0, abs=3)
    finer = decibels_and_degrees(field(body(stretched, axes, 4), place), truth)
    assert finer == pytest.approx((0, 0), abs=0.5)


def test_far_away_an_ellipsoid_has_pi_a1_a2():
    """Closed form: at the tip of an axis c, the principal radii are a^2 / c and b^2 / c."""
    found = field(reflectors(stretched((0.15, 0.2, 0.3), 4)), (0, 0, 90.0))
    section = abs(found) ** 2 * (4 * np.pi) ** 3 * 89.7**4 / LAMBDA**2
    assert section == pytest.approx(np.pi * 0.15**2 * 0.2**2 / 0.3**2, rel=0.03)


@pytest.mark.parametrize("subdivisions", [3, 4])
@pytest.mark.parametrize("noise", [3e-5, 2e-4])
def test_noisy_meshes(subdivisions, noise):
    """Corners rounded to a tenth of a millimetre, and a scan's: still one body, within 1 dB from all directions."""
    axes, rng = (0.15, 0.2, 0.3), np.random.default_rng(0)
    mesh = stretched(axes, subdivisions)
    scan = shapes.exact(mesh.vertices + noise * rng.normal(size=mesh.vertices.shape), mesh.faces)
    found, clean = reflectors(scan), reflectors(mesh)
    for way in rng.normal(size=(20, 3)):
        place = 1.5 * way / np.linalg.norm(way)
        assert decibels_and_degrees(field(found, place), field(clean, place))[0] == pytest.approx(0, abs=1)


@pytest.mark.parametrize(
    "place",
    [
        (-0.7, 0, 0), (-2, 0, 0), (-4, 0, 0), (-2, 1, 0.2),
        (-2, 0.1, 0.45), (-2, 0.1, 0.5), (-2, 0.1, 0.55),  # over the end
        (-0.1, 1.5, 0.1), (0, 1.5, 0.1), (0.1, 1.5, 0.1),  # over the straight border
    ],
)  # fmt: skip
def test_half_cylinders(place):
    """In front of, at and past their borders: 0.8 dB and 4 deg."""
    found = field(body(half_cylinder, 0.15, 1.0, 12), place)
    off, turn = decibels_and_degrees(
        found, physical_optics(samples(tube, 0.15, 0.5, np.pi / 2, 3 * np.pi / 2), place, soft=0.02)
    )
    assert off == pytest.approx(0, abs=0.8)
    assert turn == pytest.approx(0, abs=4)


@pytest.mark.parametrize(("sides", "back"), [(9, True), (24, True), (12, False)])
def test_half_cylinders_of_other_meshes(sides, back):
    """Coarse, fine, and without a back: 0.5 dB."""
    off, _ = decibels_and_degrees(
        field(reflectors(half_cylinder(0.15, 1.0, sides, back)), (-2, 0.3, 0.2)),
        physical_optics(tube(0.15, 0.5, np.pi / 2, 3 * np.pi / 2), (-2, 0.3, 0.2)),
    )
    assert off == pytest.approx(0, abs=0.5)


@pytest.mark.parametrize("material", ["concrete", "wood"])
def test_dielectrics_reflect_as_walls_of_theirs_do(material):
    """Fresnel coefficient at normal incidence and roughness factor, as for a wall of the same material."""
    mesh = half_cylinder(0.15, 1.0, 12)
    share = field(reflectors(mesh, material), (-2, 0, 0)) / field(reflectors(mesh), (-2, 0, 0))
    what, smoother = MATERIALS[material], MATERIALS["metal"]
    expected = abs(what.fresnel(np.array(1.0), CONFIG.center_frequency)[0])
    expected *= np.exp(-8 * (np.pi / LAMBDA) ** 2 * (what.roughness**2 - smoother.roughness**2))
    assert abs(share) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("half", "place"),
    [(0.2, (-1, 0, 0)), (0.2, (-2, 0, 0)), (0.2, (-4, 0, 0)), (0.2, (-2, 0.4, 0.2)), (0.2, (-2, 0, 0.24)),
     (0.05, (-1, 0, 0)), (0.05, (-4, 0, 0)), (0.05, (0, 0.1, 2)), (0.2, (0, 0.01, 2))],
)  # fmt: skip
def test_capsules(half, place):
    """Broadside, at the joint and on end: 0.8 dB and 5 deg. Ends of the pipe and of its roundings cancel as far as they
    should."""
    found = field(body(capsule, 0.05, half), place)
    off, turn = decibels_and_degrees(found, physical_optics(samples(rounded, 0.05, half), place))
    assert off == pytest.approx(0, abs=0.8)
    assert turn == pytest.approx(0, abs=5)


def sheet(bend, half, count=10, fine=900):
    """x = (k1 y^2 + k2 z^2) / 2 over a rectangle, seen from -x: its mesh, and places, normals and areas."""
    (k1, k2), (a, b) = bend, half
    y, z = np.meshgrid(np.linspace(-a, a, count + 1), np.linspace(-b, b, count + 1), indexing="ij")
    number = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    p, q, r, s = (number[i : count + i, j : count + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    corners = np.stack([(k1 * y**2 + k2 * z**2) / 2, y, z], axis=2).reshape(-1, 3)
    mesh = shapes.exact(corners, np.concatenate([np.stack([p, r, q], 1), np.stack([p, s, r], 1)]))
    y, z, cell = grid((-a, a), (-b, b), (fine, fine))
    normal = np.stack([-np.ones_like(y), k1 * y, k2 * z], axis=1)
    size = np.linalg.norm(normal, axis=1)
    return mesh, (np.stack([(k1 * y**2 + k2 * z**2) / 2, y, z], axis=1), normal / size[:, None], size * cell)


@pytest.mark.parametrize("place", [(-0.5, 0, 0), (-0.58, 0, 0), (-1, 0, 0), (-4, 0.1, 0.1)])
@pytest.mark.parametrize(
    ("bend", "half"),
    [((-1 / 0.6, -1 / 0.6), (0.15, 0.15)), ((0, -1 / 0.6), (0.08, 0.2)), ((1 / 0.3, -1 / 0.3), (0.1, 0.1)),
     ((1 / 0.3, 1 / 0.3), (0.1, 0.1))],
)  # fmt: skip
def test_bowls_troughs_saddles_and_domes(bend, half, place):
    """In front of, at and beyond the caustic of a concave mirror: 2.1 dB and 20 deg, and finite everywhere."""
    mesh, surface = sheet(bend, half)
    off, turn = decibels_and_degrees(field(reflectors(mesh), place), physical_optics(surface, place, soft=0.02))
    assert off == pytest.approx(0, abs=2.1)
    assert turn == pytest.approx(0, abs=20)


def test_nothing_switches():
    """Moving past a half cylinder, from the front to the back and over its end: between frames the field changes by no
    more than its phase does."""
    found = reflectors(half_cylinder(0.15, 1.0, 12))
    for track in (
        np.stack([np.linspace(-1, 0.4, 281), np.full(281, 1.5), np.full(281, 0.1)], axis=1),
        np.stack([np.full(281, -2.0), np.full(281, 0.1), np.linspace(0.2, 0.9, 281)], axis=1),
    ):
        sizes = np.abs([field(found, place) for place in track])
        assert np.abs(np.diff(sizes)).max() < 0.08 * sizes.max()


TX, RX = tx_positions(CONFIG), rx_positions(CONFIG)
HALF = (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("gap", [0.3, 1.0])
@pytest.mark.parametrize("kind", ["ellipsoid", "half cylinder"])
def test_path_by_antenna(kind, gap, speed):
    """Within 2 deg of the shortest way over the true body, for every antenna, at rest and passing by at 1 m/s."""
    if kind == "ellipsoid":
        mesh, deep = stretched((0.15, 0.2, 0.3), 4), 0.15
    else:
        mesh, deep = half_cylinder(0.15, 1.0, 24), 0.15
    center = np.array([gap + deep, 0.03, 0.05])
    scene = Scene("body", [SceneObject("body", shapes.placed(mesh, center), MATERIALS["metal"])])
    smooth = replace(Reflectors.of(scene, CONFIG), flat=Flat.zeros(0))
    echoes = PathFinder(scene, NOTHING, smooth, CONFIG, antenna=ISOTROPIC)(np.zeros(3), np.eye(3))
    fit = echoes.lengths(CONFIG, Rig((0, speed, 0)), -CONFIG.burst_center)[np.abs(echoes.amplitude).argmax()]

    def point(x):
        turn, rise = x
        if kind == "half cylinder":
            return center + [-0.15 * np.cos(turn), 0.15 * np.sin(turn), rise]
        across = [-np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)]
        return center + np.array([0.15, 0.2, 0.3]) * across

    for s in (-1.0, 0.0, 1.0) if speed else (0.0,):
        here = np.array([0, speed * s * HALF, 0])
        for k, (tx, rx) in enumerate((tx, rx) for tx in TX for rx in RX):
            way = minimize(
                lambda x, a=here + tx, b=here + rx: np.linalg.norm(point(x) - a) + np.linalg.norm(point(x) - b),
                np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-14},
            ).fun  # fmt: skip
            assert 360 * abs(fit[k] @ [1, s, s * s] - way) / LAMBDA < 2


def test_ghosts():
    """An ellipsoid beside a metal wall: straight and over the wall, and over it both ways, as for round bodies."""
    center, axes = np.array([2.5, 0.2, 0.1]), np.array([0.08, 0.1, 0.15])
    body = SceneObject("body", shapes.placed(stretched(axes, 4), center), MATERIALS["metal"])
    found = Reflectors.of(Scene("ghosts", [WALL, body]), CONFIG)
    facing = np.flatnonzero(np.abs(found.flat.normal[:, 1]) > 0.99)[:1]
    ghosts = curved_ghosts.ghosts(isotropic(np.zeros(3), LAMBDA), 0, found.flat, facing, found)
    place, normal, area = ellipsoid(axes, 1600)
    here, image = np.zeros(3), np.array([0.0, 2.0, 0.0])
    assert sorted(ghosts.bounces) == [1, 1, 2]
    for ghost in (ghosts[k : k + 1] for k in range(3)):
        one, two = (image if m else here for m in np.abs(ghost.points[0, :, 1] - 0.2) > 0.5)
        path = np.linalg.norm(ghost.points[0], axis=1).sum()
        truth = summed(place + center, normal, area, one, two, path)
        off, turn = decibels_and_degrees(ghost.amplitude[0] * (-1) ** (1 + ghost.bounces[0]), truth)
        assert off == pytest.approx(0, abs=0.5)
        assert turn == pytest.approx(0, abs=6)


def test_a_board_hides_it():
    """Through the finder: one specular reflection of the ellipsoid, none behind a metal board."""
    egg = SceneObject("egg", shapes.placed(stretched((0.15, 0.2, 0.3)), (2, 0, 0)), MATERIALS["metal"])
    board = SceneObject("board", shapes.box((1, 0, 0), (0.02, 0.8, 0.8)), MATERIALS["metal"])
    at_egg = []
    for objects in ([egg], [egg, board]):
        scene = Scene("egg", objects)
        echoes = PathFinder(scene, NOTHING, Reflectors.of(scene, CONFIG), CONFIG)(np.zeros(3), np.eye(3))
        at_egg.append((echoes.kind == Kind.CURVED).sum())
    assert at_egg == [1, 0]


def test_what_stays_flat():
    """Boxes, a bend between two plates, a column of eight sides and scanned walls have no smooth piece; an open vault
    of few sides has one."""
    rng = np.random.default_rng(0)
    wall, _ = sheet((0, 0), (1.0, 1.0), 40)
    wall = shapes.exact(wall.vertices + 5e-4 * rng.normal(size=wall.vertices.shape), wall.faces)
    bend = half_cylinder(0.5, 1.0, 18, back=False).submesh([np.r_[0:2, 18:20]], append=True)
    prism = shapes.cylinder((0, 0, 0), 0.2, 1.0, 8)
    for mesh in (shapes.box((0, 0, 0), (1, 1, 1)), bend, prism, wall):
        assert not len(reflectors(mesh).smooth.ball)
    assert len(reflectors(half_cylinder(0.5, 1.0, 9, back=False)).smooth.ball) == 1
