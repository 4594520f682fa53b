"""Spheres and cylinders against closed forms and the physical-optics integral."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.physics.bodies import recognise
from radarsim.physics.finder import EchoFinder
from radarsim.physics.reflectors import Reflectors
from radarsim.physics.scatterers import Scatterers
from radarsim.scene import shapes
from radarsim.scene.materials import MATERIALS
from radarsim.scene.scene import Scene, SceneObject
from tests.physics.rigs import Rig, burst, isotropic, locate

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength


def scene_of(mesh):
    return Scene("body", [SceneObject("body", mesh, MATERIALS["metal"])])


def field(mesh, position):
    """Echo of the round bodies of a mesh, all parts together, isotropic antenna."""
    position = np.asarray(position, float)
    _, images, amplitude = Reflectors.of(scene_of(mesh), CONFIG).round.flashes(isotropic(position, LAMBDA), 0)
    mirrored = np.einsum("pij,j->pi", images[:, :, :3], position) + images[:, :, 3]
    return np.sum(amplitude * np.exp(2j * np.pi * np.linalg.norm(position - mirrored, axis=1) / LAMBDA))


def cross_section(amplitude, distance):
    return abs(amplitude) ** 2 * (4 * np.pi) ** 3 * distance**4 / LAMBDA**2


@pytest.mark.parametrize(("radius", "subdivisions"), [(0.02, 2), (0.05, 3), (0.1, 3), (0.1, 4)])
@pytest.mark.parametrize("bearing", [(1, 0, 0), (0.6, 0.64, 0.48), (0.3, -0.2, 0.93)])
def test_sphere(radius, subdivisions, bearing):
    """pi a^2 from anywhere, within 1 dB (the point that echoes is nearer than the centre by a)."""
    amplitude = field(shapes.sphere((0, 0, 0), radius, subdivisions), -3.0 * np.array(bearing))
    assert 10 * np.log10(cross_section(amplitude, 3.0) / (np.pi * radius**2)) == pytest.approx(0, abs=1)


@pytest.mark.parametrize("sides", [8, 12, 24])
def test_short_cylinder_at_broadside(sides):
    """k a l^2 in the far field."""
    radius, length = 0.025, 0.06
    amplitude = field(shapes.cylinder((0, 0, 0), radius, length, sides), (-5, 0, 0))
    expected = 2 * np.pi / LAMBDA * radius * length**2
    assert 10 * np.log10(cross_section(amplitude, 5.0) / expected) == pytest.approx(0, abs=0.3)


def physical_optics(radius, half, position, around=1201, along=3001):
    """(1 / 4 pi) sum of cos exp(j 2 k rho) / rho^2 dA over the lit side, tapered towards the shadow."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, around)
    normal = np.stack([-np.cos(phi), np.sin(phi)], axis=1)
    z = ((np.arange(along) + 0.5) / along * 2 - 1) * half
    away = np.asarray(position[:2]) - radius * normal
    rho = np.sqrt(np.sum(away**2, axis=1)[:, None] + (position[2] - z) ** 2)
    cosine = np.maximum(np.sum(away * normal, axis=1)[:, None] / rho, 0)
    lit = cosine * np.cos(phi)[:, None] ** 2 * np.exp(4j * np.pi * rho / LAMBDA) / rho**2
    return np.sum(lit) * radius * (phi[1] - phi[0]) * (2 * half / along) / (4 * np.pi)


@pytest.mark.parametrize(
    ("radius", "half", "position"),
    [
        (0.05, 0.3, (-1.5, 0, 0)),
        (0.05, 0.3, (-1.5, 0, 0.28)),
        (0.05, 0.3, (-1.5, 0, 0.45)),  # beyond the end
        (0.1, 0.1, (-1.0, 0, 0.05)),
        (0.025, 0.35, (-1.0, 0, 0.35)),  # at the height of the end itself
    ],
)
def test_cylinder_anywhere(radius, half, position):
    """Amplitude within 0.2 dB and phase within 2 deg of the integral, at broadside and beyond the ends."""
    found = field(shapes.cylinder((0, 0, 0), radius, 2 * half, 24), position)
    truth = -physical_optics(radius, half, position) / 1j
    assert 20 * np.log10(abs(found) / abs(truth)) == pytest.approx(0, abs=0.2)
    assert np.rad2deg(np.angle(found / truth)) == pytest.approx(0, abs=2)


def test_range_and_doppler_of_a_passing_sphere():
    """Range to the nearest point and closing speed to the centre, whichever way the radar moves."""
    radius, center = 0.1, np.array([3.0, 0.5, 0.0])
    scene = scene_of(shapes.sphere(center, radius))
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    finder = EchoFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG)
    for velocity in ([1.0, 0, 0], [0, 1.2, 0], [0.7, -0.7, 0]):
        rig = Rig(velocity=tuple(velocity))
        middle = CONFIG.burst_center * np.array(velocity)
        signal = burst(CONFIG, finder(middle, np.eye(3)), rig)
        distance = np.linalg.norm(center - middle)
        closing = np.dot(velocity, center - middle) / distance
        azimuth = np.arctan2(*(center - middle)[1::-1])
        found, bearing, _, speed, _ = locate(CONFIG, signal, (distance - radius, azimuth, 0.0, closing))
        assert found == pytest.approx(distance - radius, abs=1e-3)
        assert np.rad2deg(bearing - azimuth) == pytest.approx(0, abs=0.1)
        assert speed == pytest.approx(closing, abs=0.005)


def test_path_stays_true_over_a_burst():
    """A table leg's path over 5 cm of sideways motion, against the true 2 (|x - axis| - a): 0.01 mm where it turns."""
    radius, h, step = 0.025, 2.0, 0.015  # half a burst at walking pace
    held = 2 * np.hypot(h, step)
    true = 2 * (np.hypot(h + radius, step) - radius)
    assert abs(held - true) < 1e-5


def test_what_is_round():
    """Prisms of few sides, half pipes and ellipsoids are not; round bodies among others are."""
    box, prism = shapes.box((0, 0, 0), (1, 1, 1)), shapes.cylinder((0, 0, 0), 0.1, 1, 6)
    ball = shapes.sphere((0, 0, 0), 0.1)
    egg = ball.copy()
    egg.vertices[:, 2] *= 1.2
    for mesh in (box, prism, egg):
        assert not recognise(mesh)[0]
    legs = [shapes.placed(shapes.cylinder((x, 0, 0), 0.03, 0.7, 10), rotation=(0.3, 0.2, 0)) for x in (0, 1)]
    bodies, taken = recognise(shapes.joined(*legs, shapes.placed(ball, (0, 3, 0)), shapes.placed(box, (5, 0, 0))))
    assert sorted(round(b.radius, 6) for b in bodies) == [0.03, 0.03, 0.1]
    assert taken.sum() == 2 * 20 + len(ball.faces)
    assert max(b.half for b in bodies) == pytest.approx(0.35)


def test_a_round_body_has_no_facets():
    scene = scene_of(shapes.cylinder((0, 0, 0), 0.3, 2.0, 12, without=("-z", "+z")))
    found = Reflectors.of(scene, CONFIG)
    assert not len(found.flat) and len(found.round) == 1
