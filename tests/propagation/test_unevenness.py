"""Uneven walls: the specular reflection against Kirchhoff's integral, and its statistics against closed forms."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.unevenness import SCALES, Heights
from radarsim.world import shapes
from radarsim.world.materials import material
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene
from radarsim.world.surface_settings import SurfaceSettings

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength
K = 2 * np.pi / LAMBDA
ALL = np.ones(1)
NOWHERE = Scatterers.points(np.zeros((0, 3)), np.zeros(0))


def wall(unevenness, what="plasterboard"):
    """6 x 6 m at x = 0, seen from x > 0."""
    mesh = shapes.rectangle((0, 0, 0), (6, 6), (1, 0, 0))
    return Scene(
        "wall", [SceneObject("wall", mesh, material(what))], surface_settings=SurfaceSettings(unevenness=unevenness)
    )


def heights(unevenness=1.0, seed=0):
    return Heights.of(wall(unevenness), np.random.default_rng(seed))


def kirchhoff(field, place):
    """Kirchhoff's integral of a wall at x = 0, relative to a flat one: exact paths, fine steps, a wide soft
    aperture."""
    flat = 0.12 * place[0] + 0.1
    x = np.arange(-2 * flat, 2 * flat, 2.5e-3)
    y, z = np.meshgrid(x, x, indexing="ij")
    h = place[0]
    at = np.stack([np.zeros_like(y), place[1] + y, place[2] + z], axis=-1).reshape(-1, 3)
    height = np.concatenate([field(part) for part in np.array_split(at, 40)]).reshape(y.shape)
    radius = np.hypot(y, z)
    fade = np.cos(np.clip((radius - flat) / flat, 0, 1) * np.pi / 2) ** 2

    def field_of(height):
        rho = np.sqrt((h - height) ** 2 + radius**2)
        return np.sum(fade * np.exp(2j * K * (rho - h)) * h / rho**3)

    return field_of(height) / field_of(np.zeros_like(height))


@pytest.mark.parametrize("distance", [0.6, 1.5, 3.0])
def test_the_reflection_is_kirchhoffs_integral(distance):
    """At several places in front of a wall, up to the neglected terms beyond the paraxial ones."""
    field = heights()
    for y in (-0.8, 0.13, 1.1):
        place = np.array([[distance, y, 0.3]])
        found = field.factors(place, place * [0, 1, 1], ALL, LAMBDA)[0]
        assert abs(found - kirchhoff(field, place[0])) < 0.06


def test_a_flat_wall_keeps_its_reflection():
    place = np.array([[2.0, 0.4, 0.3]])
    assert abs(heights(1e-9).factors(place, place * [0, 1, 1], ALL, LAMBDA)[0] - 1) < 1e-5
    assert heights(0) is None


@pytest.fixture(scope="module")
def seen():
    """F for a quarter of the usual unevenness along walls of many seeds, at offsets of 0, 1, 2, 4, 8 and 1000 cm."""
    steps = np.array([0.0, 0.01, 0.02, 0.04, 0.08, 10.0])
    place = np.stack([np.full_like(steps, 2.0), steps, np.full_like(steps, 0.3)], axis=1)
    walls = [heights(0.25, seed) for seed in range(400)]
    return steps, np.array([w.factors(place, place * [0, 1, 1], np.ones(len(steps)), LAMBDA) for w in walls])


def test_mean_and_power_of_the_reflection(seen):
    """The coherent part is the characteristic function of the heights, and no power is lost."""
    factors = seen[1]
    variance = sum((0.25 * rms) ** 2 for rms, _ in SCALES)
    assert abs(factors.mean() - np.exp(-2 * K**2 * variance)) < 0.05
    assert abs(np.mean(np.abs(factors) ** 2) - 1) < 0.05


def test_correlation_along_the_wall(seen):
    """The correlation of F is that of the screen: free space is an all-pass filter."""
    steps, factors = seen
    found = np.mean(factors * factors[:, :1].conj(), axis=0)
    lost = sum((0.25 * rms) ** 2 * (1 - np.exp(-((steps / length) ** 2))) for rms, length in SCALES)
    np.testing.assert_allclose(found, np.exp(-((2 * K) ** 2) * lost), atol=0.09)


def test_heights_are_as_rough_as_they_say():
    """RMS, and deviation from a straightedge of a metre: within the tolerance of plasterers, 5 mm."""
    y = np.arange(0, 400, 0.5)
    middle = np.array([heights(seed=s)(np.stack([0 * y, y, 0 * y], axis=1)) for s in range(20)])
    variance = sum(rms**2 for rms, _ in SCALES)
    assert abs(np.var(middle) / variance - 1) < 0.1
    bow = middle[:, 1:-1] - (middle[:, :-2] + middle[:, 2:]) / 2
    assert 1e-3 < np.quantile(np.abs(bow), 0.95) < 5e-3


def finder(scene):
    field = Heights.of(scene, np.random.default_rng(0))
    return PathFinder(scene, NOWHERE, Reflectors.of(scene, CONFIG, field), CONFIG, antenna=ISOTROPIC)


def reflection(scene, place):
    """Amplitude of the plane's own echo."""
    echoes = finder(scene)(np.array(place), np.diag([-1.0, -1.0, 1.0]))
    return echoes.amplitude[np.trace(echoes.images[:, :, :3], axis1=1, axis2=2) > 0.5][0]


def test_finder_takes_the_factor_of_plaster_and_none_of_glass():
    place = np.array([1.5, 0.2, 0.1])
    factor = heights().factors(place[None], place[None] * [0, 1, 1], ALL, LAMBDA)[0]
    found = reflection(wall(1.0), place) / reflection(wall(0.0), place)
    assert abs(found - factor) < 1e-6
    assert abs(factor - 1) > 0.1
    assert reflection(wall(1.0, "glass"), place) == reflection(wall(0.0, "glass"), place)


def test_nothing_jumps_where_the_foot_leaves_the_wall():
    """Over 4 cm across the wall's edge, in steps of small phase change, the field is continuous."""
    at = np.arange(2.98, 3.02, 1e-3)
    places = np.stack([np.full_like(at, 2.0), at, np.full_like(at, 0.1)], axis=1)
    found, field = finder(wall(1.0)), []
    for place in places:
        echoes = found(place, np.diag([-1.0, -1.0, 1.0]))
        way = place - np.einsum("eij,j->ei", echoes.images[:, :, :3], place) - echoes.images[:, :, 3]
        field.append(np.sum(echoes.amplitude * np.exp(1j * K * np.linalg.norm(way, axis=1))))
    assert np.abs(np.diff(field)).max() < 0.1 * np.abs(field).max()
