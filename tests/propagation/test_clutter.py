"""Clutter points: number, strength, and that they are fixed in the world."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import gamma

from radarize.io.errors import InputError
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.clutter import (
    CROSS_SECTION,
    EXPONENT,
    NEAREST,
    ON_FLOORS,
    ON_TOPS,
    ON_WALLS,
    STANDOFF,
    STRUCTURE,
    UNDER_CEILINGS,
    Clutter,
)
from radarsim.propagation.fields import facing
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.media import mirror, scattering
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.reverberation import Detours
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Cluttered, Surface
from radarsim.propagation.transmission import Transmission
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings

CONFIG = PRESETS["radarize"]
K = 2 * np.pi / CONFIG.wavelength


def room(clutter=1.0, **parts):
    """A hall of 12 x 10 x 3 m with a desk, seen from inside."""
    parts = parts or {
        "floor": shapes.rectangle((6, 0, 0), (12, 10), (0, 0, 1)),
        "ceiling": shapes.rectangle((6, 0, 3), (12, 10), (0, 0, -1)),
        "wall": shapes.rectangle((12, 0, 1.5), (10, 3), (-1, 0, 0)),
        "desk": shapes.rectangle((6, 0, 0.75), (4, 4), (0, 0, 1)),
    }
    objects = [SceneObject(name, mesh, MATERIALS["wood"]) for name, mesh in parts.items()]
    return Scene("room", objects, surface_settings=SurfaceSettings(clutter=clutter))


#: Where the surface of each kind is, which way it faces, what it is of, and how many things are on a square metre.
KINDS = {
    "wall": ((0, 0, 30), (-1, 0, 0), "plasterboard", ON_WALLS),
    "desk": ((0, 0, 0.75), (0, 0, 1), "wood", ON_TOPS),
    "floor": ((0, 0, 0), (0, 0, 1), "floorboard", ON_FLOORS),
    "ceiling": ((0, 0, 3), (0, 0, -1), "ceiling board", UNDER_CEILINGS),
}
SIDE = 60.0


def lone(kind, level):
    """Square of 60 m, at the height above the scene's lowest point that its kind requires."""
    center, facing_, material, _ = KINDS[kind]
    objects = [
        SceneObject("square", shapes.rectangle(center, (SIDE, SIDE), facing_), MATERIALS[material]),
        SceneObject("crumb", shapes.box((0, 90, 0.005), (0.01, 0.01, 0.01)), MATERIALS["metal"]),
    ]
    return Scene("lone", objects, surface_settings=SurfaceSettings(clutter=level))


def sphere(steps=45):
    """Directions all around, and the solid angle of each, sr."""
    theta, phi = (np.arange(steps) + 0.5) / steps * np.pi, (np.arange(2 * steps) + 0.5) / steps * np.pi
    t, p = (x.ravel() for x in np.meshgrid(theta, phi, indexing="ij"))
    way = np.column_stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
    return way, np.sin(t) * (np.pi / steps) ** 2


def scattered(points, normal, source):
    """Fraction of the power from `source` on the square that its points scatter: their bistatic cross sections over 4
    pi, integrated over the sphere. All points have the same pattern up to a factor."""
    for column in (points.normal, points.lobe, points.two_sided):
        assert np.all(column == column[0])
    face, lobe, two_sided = points.normal[0], points.lobe[0], points.two_sided[0]
    there, total = facing(face, source, two_sided), 0.0
    for way, angle in zip(*sphere(), strict=True):
        back = facing(face, way, two_sided)
        if there > 0 and back > 0:
            total += scattering(there, back, source @ way, lobe) * angle / (4 * np.pi)
    return total * points.sigma.sum() / (SIDE**2 * (source @ normal))


def clutter(scene, seed=0):
    return Clutter(scene, np.random.default_rng(seed))


def everything(found):
    return found.near(np.zeros((1, 3)), 100.0)


def test_densities_by_what_things_are_on():
    """Numbers are Poisson-distributed about density times area and level; each point is near its surface, on its
    outside."""
    z = np.concatenate([everything(clutter(room(2.0), seed)).position for seed in range(40)])
    ranges = {
        "floor": ((z[:, 2] < 0.4) & (z[:, 0] < 11.6), ON_FLOORS * 116),
        "ceiling": ((z[:, 2] > 2.6) & (z[:, 0] < 11.6), UNDER_CEILINGS * 116),
        "desk": ((z[:, 2] > 0.75) & (z[:, 2] < 1.2) & (z[:, 0] < 9), ON_TOPS * 16),
        "wall": ((z[:, 0] > 11.6) & (z[:, 2] > 0.4) & (z[:, 2] < 2.6), ON_WALLS * 10 * 2.2),
    }  # fmt: skip
    for inside, expected in ranges.values():
        expected *= 2 * 40
        assert abs(inside.sum() - expected) < 4 * np.sqrt(expected) + 0.02 * expected
    off = 12 - z[ranges["wall"][0], 0]
    assert off.min() >= NEAREST
    assert abs(off.mean() - NEAREST - STANDOFF) < 0.003


@pytest.mark.parametrize("level", [0.5, 5.0])
def test_cross_sections_are_weibulls(level):
    """Distribution of cross sections, and the mean power per square metre of wall: density times mean, less
    shadowing."""
    sigma = np.concatenate([everything(clutter(lone("wall", level), seed)).sigma for seed in range(3)])
    share = level * (STRUCTURE + ON_WALLS * CROSS_SECTION / 4)
    mean = CROSS_SECTION * (1 - np.exp(-share)) / share
    scale = mean / gamma(1 + 1 / EXPONENT)
    assert stats.kstest(sigma, stats.weibull_min(EXPONENT, scale=scale).cdf).pvalue > 0.01
    assert abs(sigma.mean() / mean - 1) < 0.05


def test_those_seen_over_mirrors_have_the_power_of_all():
    place = room(80.0)
    found = Scatterers.joined([everything(clutter(place, seed)) for seed in range(20)])
    for weights in (found.bounces, found.bounces_twice):
        assert abs(np.sum(weights * found.sigma) / np.sum(found.sigma) - 1) < 0.03
        assert np.mean(weights > 0) < 0.3


def test_same_things_from_everywhere():
    """Points depend on the world and its seed, not on the sensor's position."""
    one = clutter(room())
    here, there = (one.near(np.array([[x, 0.0, 1.0]]), 4.0) for x in (5.0, 6.0))
    rows = [set(map(tuple, np.column_stack([s.position, s.sigma, s.phase]))) for s in (here, there)]
    both = {row for row in rows[0] if np.linalg.norm(np.subtract(row[:3], (6.0, 0.0, 1.0))) < 4.0}
    assert len(both) > 100
    assert both <= rows[1]
    assert np.array_equal(everything(one).position, everything(clutter(room())).position)
    assert len(everything(clutter(room(), 1))) != 0
    assert not np.array_equal(everything(one).sigma[:10], everything(clutter(room(), 1)).sigma[:10])


def test_coherent_under_motion():
    """An echo's phase changes by 2k times the motion towards its point in any direction, without new random numbers."""
    found = PathFinder(None, clutter(room()), None, CONFIG, range=30.0, antenna=ISOTROPIC)
    step = np.array([0.004, -0.003, 0.002])
    start = np.array([3.0, 0.5, 1.0])
    fields, places = [], []
    for position in (start, start + step):
        echoes = found(position, np.eye(3))
        ahead = echoes.points[:, 0, 0] > start[0] + 1
        places.append(echoes.points[ahead, 0])
        way = np.linalg.norm(places[-1] - position, axis=1)
        fields.append(echoes.amplitude[ahead] * np.exp(2j * K * way))
    assert np.array_equal(*places)
    assert len(places[0]) > 100
    away = places[0] - start
    towards = away @ step / np.linalg.norm(away, axis=1)
    # to the first order in the step over the distance, 1 m or more
    error = np.angle(fields[1] * fields[0].conj() * np.exp(2j * K * towards))
    assert np.abs(error).max() < K * step @ step / 1.0


def test_hidden_things_are_not_seen():
    parts = {
        "wall": shapes.rectangle((4, 0, 1.5), (2, 1), (-1, 0, 0)),
        "screen": shapes.rectangle((2, 0, 1.5), (3, 3), (-1, 0, 0)),
    }
    scene = room(10.0, **parts)
    things = clutter(scene)
    found = PathFinder(scene, things, None, CONFIG, antenna=ISOTROPIC)
    seen = found(np.array([0.0, 0.0, 1.5]), np.eye(3)).points[:, 0]
    assert len(seen) > 50
    assert seen[:, 0].max() < 2
    assert everything(things).position[:, 0].max() > 3.5


def test_none_at_level_zero():
    """A scene of level 0 has only the scatterers of its surfaces, the same as without clutter."""
    scene = room(0.0)
    rng = np.random.default_rng(0)
    both = Cluttered(Surface(scene, rng), Clutter(scene, rng), Detours.of(scene, CONFIG, rng))
    alone = Surface(scene, np.random.default_rng(0))
    place = np.array([[3.0, 0.0, 1.0]])
    assert np.array_equal(both.near(place, 5.0).position, alone.near(place, 5.0).position)
    assert len(both) == len(alone)


def test_more_than_memory_holds():
    wall = SceneObject("wall", shapes.rectangle((0, 0, 0), (1900, 1900), (1, 0, 0)), MATERIALS["wood"])
    place = Scene("plain", [wall], surface_settings=SurfaceSettings(clutter=10))
    with pytest.raises(InputError, match="clutter is 10, which makes 1.3e.08 points"):
        clutter(place)


@pytest.mark.parametrize("level", [0, 0.5, 1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_no_surface_gives_more_than_falls_on_it(kind, level):
    """Specular, diffuse and transmitted power, and that scattered by structure and objects, together do not exceed the
    incident power, from normal incidence to 80 deg."""
    of_things = KINDS[kind][3] * CROSS_SECTION / 4
    center, normal = (np.array(x, float) for x in KINDS[kind][:2])
    scene, bare = lone(kind, level), lone(kind, 0)
    surface = Surface(scene, np.random.default_rng(0), density=4.0).all()
    surface = surface[np.abs((surface.position - center) @ normal) < 1e-6]
    things = everything(clutter(scene))
    things = things[np.abs(things.position - center).max(axis=1) < SIDE / 2 + 1]
    facets, plain = (Reflectors.of(s, CONFIG).flat for s in (scene, bare))
    assert np.allclose(facets.normal[0], normal)
    through = Transmission(scene, CONFIG, 1e-3)
    tangent, shares = np.roll(normal, 1), []
    spread = np.sqrt(gamma(1 + 2 / EXPONENT)) / gamma(1 + 1 / EXPONENT)  # of a Poisson sum of one thing on average
    for angle in np.deg2rad([0.01, 30, 60, 80]):
        source = np.cos(angle) * normal + np.sin(angle) * tangent
        te = np.cross(normal, tangent)
        ends = np.tile(center + 1.0 * source, (2, 1)), np.tile(center - 1.0 * source, (2, 1))
        gamma_ = np.array(mirror(facets.layer[0], np.cos(angle)))
        passed = np.mean(np.abs(through.passage(*ends, np.array([te, np.cross(source, te)]))[0]) ** 2)
        diffuse = scattered(surface, normal, source)
        small = scattered(things, normal, source) if len(things) else 0.0
        shares.append(small)
        by_structure = small * STRUCTURE / of_things
        assert np.mean(np.abs(gamma_) ** 2) + diffuse + small + by_structure + passed <= 1
        # scattered power is taken in equal parts from specular, diffuse and transmitted power
        taken = 1 - np.mean(np.abs(gamma_) ** 2) / np.mean(np.abs(np.array(mirror(plain.layer[0], np.cos(angle)))) ** 2)
        expected = taken * of_things / (of_things + STRUCTURE)
        assert small == pytest.approx(expected, rel=4 * spread / np.sqrt(max(len(things), 1)))
    assert np.ptp(shares) < 0.01 * max(shares) + 1e-9


@pytest.mark.parametrize(("kind", "decibel"), [("wall", -1.2), ("desk", -1.2), ("floor", -1.1), ("ceiling", -1.1)])
def test_mean_return_at_45_degrees(kind, decibel):
    """At level 1 each object of a square metre returns 0.005 m^2 at 45 deg on average, less the shadowing by others."""
    things = everything(clutter(lone(kind, 1.0), 3))
    cosine = np.cos(np.pi / 4)
    returned = np.sum(things.sigma * scattering(cosine, cosine, 1.0, things.lobe[0])) / SIDE**2
    assert 10 * np.log10(returned / (0.005 * KINDS[kind][3])) == pytest.approx(decibel, abs=0.3)
