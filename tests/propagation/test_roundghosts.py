"""Ghosts of round bodies over mirrors, against the physical-optics integral between two images of the radar."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.references.rigs import conductors, isotropic, layer
from radarize.radar.presets import PRESETS
from radarsim.propagation.curved import RoundBodies
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.mechanisms import curved_ghosts
from radarsim.propagation.paths import Kind
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from tests.propagation.test_multipath import slab

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
WALL = SceneObject("wall", shapes.rectangle((1.5, 1.0, 0), (4.0, 3.0), (0, -1, 0)), MATERIALS["metal"])


FLOOR = conductors(((2, 0, 0), (1, 0, 0), (0, 1, 0), (2.5, 2.0)))
HIGH = np.array([0.0, 0.0, 0.8])


def ghosts(body, wall=WALL):
    """Ghosts of a metal body for a radar at the origin."""
    found = Reflectors.of(Scene("ghosts", [wall, SceneObject("body", body, MATERIALS["metal"])]), CONFIG)
    facing = np.flatnonzero(np.abs(found.flat.normal[:, 1]) > 0.99)[:1]
    return curved_ghosts.ghosts(isotropic(np.zeros(3), LAMBDA), 0, found.flat, facing, found)


def summed(points, normals, areas, one, two, image):
    """(1 / (j lambda)) int cos exp(jk (r1 + r2)) / (r1 r2) dA over what both places light, relative to a path."""
    a, b = points - one, points - two
    r1, r2 = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
    cos1, cos2 = -np.sum(a * normals, axis=1) / r1, -np.sum(b * normals, axis=1) / r2
    # shadows are drawn softly: a sharp rim would echo
    lit = np.clip(np.minimum(cos1, cos2) / 0.3, 0, 1)
    lit = lit * lit * (3 - 2 * lit)
    field = lit * (cos1 + cos2) / 2 * np.exp(2j * np.pi * (r1 + r2 - image) / LAMBDA) / (r1 * r2)
    return np.sum(field * areas) / (1j * LAMBDA) * LAMBDA / (4 * np.pi)


def sphere(center, radius, around=1600, across=800):
    theta = (np.arange(across) + 0.5) / across * np.pi
    phi = np.arange(around) / around * 2 * np.pi
    theta, phi = (x.ravel() for x in np.meshgrid(theta, phi, indexing="ij"))
    normal = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    return center + radius * normal, normal, radius**2 * np.sin(theta) * np.pi / across * 2 * np.pi / around


def pole(center, radius, length, around=400, along=2500):
    z = ((np.arange(along) + 0.5) / along - 0.5) * length
    phi = np.arange(around) / around * 2 * np.pi
    z, phi = (x.ravel() for x in np.meshgrid(z, phi, indexing="ij"))
    normal = np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    place = center + radius * normal + z[:, None] * [0, 0, 1]
    return place, normal, np.full(len(z), radius * 2 * np.pi / around * length / along)


@pytest.mark.parametrize("kind", ["sphere", "pole"])
def test_ghosts_of_round_bodies(kind):
    """A 10 cm sphere and a 3 cm pole beside a metal wall: over the wall on one path, and on both."""
    center = np.array([2.5, 0.2, 0.1])
    if kind == "sphere":
        body, surface = shapes.sphere(center, 0.1, 4), sphere(center, 0.1)
    else:
        body, surface = shapes.placed(shapes.cylinder((0, 0, 0), 0.03, 1.2, 24), center), pole(center, 0.03, 1.2)
    found = ghosts(body)
    here, image = np.zeros(3), np.array([0.0, 2.0, 0.0])
    assert sorted(found.bounces) == [1, 1, 2]
    for ghost in (found[k : k + 1] for k in range(3)):
        mirrored = np.abs(ghost.points[0, :, 1] - 0.2) > 0.5
        one, two = (image if m else here for m in mirrored)
        path = np.linalg.norm(ghost.points[0], axis=1).sum()
        truth = summed(*surface, one, two, path)
        assert 20 * np.log10(abs(ghost.amplitude[0]) / abs(truth)) == pytest.approx(0, abs=0.7)
        # each conductor turns the sign of an upright field; over j from stationary phase, once for every wall
        turned = ghost.amplitude[0] / truth * (-1) ** (1 + ghost.bounces[0])
        assert np.rad2deg(np.angle(turned)) == pytest.approx(0, abs=6)


def pole_ghosts(bottom, tilt):
    """Ghosts of a pole 2 m off over a metal floor, up to 0.7 m and tilted (deg), and the integral over the part above
    the floor, both as the sum of the two orders of floor and pole."""
    half = 0.35 - bottom / 2
    center, turned = np.array([2.0, 0, 0.7 - half]), Rotation.from_euler("y", tilt, degrees=True)
    rod = RoundBodies.from_rows([(center, turned.apply([0, 0, 1.0]), 0.03, half, layer())])
    found = curved_ghosts.ghosts(isotropic(HIGH, LAMBDA), 0, FLOOR, np.array([0]), Reflectors(FLOOR, rod))
    points, normals, areas = pole(np.zeros(3), 0.03, 2 * half)
    points, normals = turned.apply(points) + center, turned.apply(normals)
    lit = points[:, 2] > 0
    truth = 2 * summed(points[lit], normals[lit], areas[lit], HIGH, HIGH * [1, 1, -1], 0.0)
    path = np.linalg.norm(found.points - HIGH, axis=2).sum(axis=1)
    return np.sum(found.amplitude * np.exp(2j * np.pi * path / LAMBDA)), truth


@pytest.mark.parametrize("bottom", [0.0, -0.4, 0.03])
@pytest.mark.parametrize("tilt", [0.0, 1e-6, -1e-6, 0.05, -0.05, 0.5, -0.5])
def test_a_pole_on_a_level_floor(bottom, tilt):
    """A pole that stands on a metal floor, in it, or above it; only what is above the floor makes ghosts.

    With the floor it is a corner of 90 deg, whose ghosts come from its foot; tilted, from above or from below that.
    """
    value, truth = pole_ghosts(bottom, tilt)
    assert 20 * np.log10(abs(value) / abs(truth)) == pytest.approx(0, abs=0.5)
    # Two conductors: upright fields keep their sign.
    assert np.rad2deg(np.angle(-value / truth)) == pytest.approx(0, abs=6)


def test_a_finder_has_them():
    """A lamp beside a wall: its ghosts are among the echoes; a board in front of the wall hides them."""
    lamp = SceneObject("lamp", shapes.sphere((2.5, 0.2, 0.1), 0.1, 3), MATERIALS["metal"])
    board = SceneObject("board", shapes.box((1.3, 0.75, 0), (0.8, 0.05, 1.0)), MATERIALS["metal"])
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    found = []
    for objects in ([WALL, lamp], [WALL, lamp, board]):
        scene = Scene("lamp", objects)
        echoes = PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG)(np.zeros(3), np.eye(3))
        at_image = np.linalg.norm(echoes.points - [2.5, 1.8, 0.1], axis=2) < 0.11
        found.append(at_image.any(axis=1).sum())
    assert found == [3, 0]


@pytest.mark.parametrize("kind", ["sphere", "pole"])
def test_ghosts_behind_a_pane(kind):
    """Over a wall on one path and on both, all behind 6 mm of glass: as without it, times the pane's transmission of
    both paths at their angles of incidence, and delayed by it."""
    center = np.array([2.5, 0.2, 0.0])
    shape = shapes.sphere(center, 0.1, 4) if kind == "sphere" else shapes.cylinder(center, 0.03, 1.2, 24)
    wall = SceneObject("wall", shapes.rectangle((2.1, 1.0, 0), (1.8, 3.0), (0, -1, 0)), MATERIALS["metal"])
    pane = SceneObject("pane", shapes.rectangle((1.0, 0, 0), (6.0, 4.0), (-1, 0, 0)), MATERIALS["glass"])
    objects, levels = [wall, SceneObject("body", shape, MATERIALS["metal"])], []
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    for things in (objects, [*objects, pane]):
        scene = Scene("pane", things)
        echoes = PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG, 1e-12)(np.zeros(3), np.eye(3))
        echoes = echoes.where(kind=Kind.POINT)
        over = np.linalg.norm(echoes.points - [2.5, 1.8, 0.0], axis=2) < 0.15
        levels.append({tuple(o): (p, a) for o, p, a in zip(over, echoes.points, echoes.amplitude, strict=True)})
    clear, behind = levels
    assert sorted(clear) == sorted(behind) == [(False, True), (True, False), (True, True)]
    for ways, (points, amplitude) in clear.items():
        lengths = np.linalg.norm(points, axis=1)
        truth = amplitude * np.prod([slab("glass", cosine) for cosine in points[:, 0] / lengths])
        seen, found = behind[ways]
        late = np.linalg.norm(seen, axis=1).sum() - lengths.sum()
        assert 20 * np.log10(abs(found / truth)) == pytest.approx(0, abs=0.1)
        assert np.rad2deg(np.angle(found / truth * np.exp(2j * np.pi * late / LAMBDA))) == pytest.approx(0, abs=4)
        assert 0.005 < late < 0.03


def test_no_pair_of_segments_is_passed_over():
    """Ghosts of random bodies over random mirrors are those of all pairs of segments, tried one by one."""
    rng = np.random.default_rng(4)
    plates = [
        conductors((place, *Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()[:2], half))
        for place, half in zip(
            rng.uniform([0.5, -3, -1.5], [6, 3, 1.5], (60, 3)), rng.uniform(0.02, 2.0, (60, 2)), strict=True
        )
    ]
    bodies = [
        SceneObject(
            f"body {k}", shapes.cylinder(rng.uniform([0.5, -3, -1], [6, 3, 1]), radius, height, 24), WALL.material
        )
        for k, (radius, height) in enumerate(zip(rng.uniform(0.005, 0.2, 8), rng.uniform(0.1, 3.0, 8), strict=True))
    ]
    flat = Flat.joined(plates)
    reflectors = Reflectors.of(Scene("bodies", bodies), CONFIG)
    observation = isotropic(np.zeros(3), LAMBDA)
    observation = observation._replace(threshold=1e-9)
    seen = np.arange(len(flat))
    found = curved_ghosts.ghosts(observation, 0, flat, seen, reflectors)
    height = np.einsum("md,md->m", flat.center, flat.normal)
    images = [np.zeros(3), *(2 * height[:, None] * flat.normal)]
    every, count = curved_ghosts.CurvedGhosts.zeros(4096), 0
    for b in range(len(reflectors.round)):
        for i, j in zip(*np.triu_indices(len(images)), strict=True):
            if j > 0:
                way = i - 1, tuple(images[i]), j - 1, tuple(images[j])
                place, aim, n, size = curved_ghosts._strength(
                    observation, flat.columns, reflectors.round.columns, b, way
                )
                echo = place, aim, n, size, reflectors.round.layer[b]
                count += curved_ghosts._add(observation, 0, flat.columns, way, echo, (every.columns, count))
    assert count > 100 and len(found) == count
    assert np.array_equal(found.mirrors, every.mirrors[:count])
    assert found.amplitude == pytest.approx(every.amplitude[:count])
