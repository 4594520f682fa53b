"""Spheres and cylinders against closed forms and the physical-optics integral."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks.references.rigs import Rig, burst, isotropic, locate
from benchmarks.references.smooth_bodies import summed
from radarize.radar.array import rx_positions, tx_positions
from radarize.radar.presets import PRESETS
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.bodies import recognise
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength


def scene_of(mesh):
    return Scene("body", [SceneObject("body", mesh, MATERIALS["metal"])])


def field(mesh, position):
    """Echo of the round bodies of a mesh, all parts together, isotropic antenna."""
    position = np.asarray(position, float)
    return summed(Reflectors.of(scene_of(mesh), CONFIG).round.specular_points(isotropic(position, LAMBDA), 0), position)


def cross_section(amplitude, distance):
    return abs(amplitude) ** 2 * (4 * np.pi) ** 3 * distance**4 / LAMBDA**2


@pytest.mark.parametrize(("radius", "subdivisions"), [(0.02, 2), (0.05, 3), (0.1, 3), (0.1, 4)])
@pytest.mark.parametrize("bearing", [(1, 0, 0), (0.6, 0.64, 0.48), (0.3, -0.2, 0.93)])
def test_sphere(radius, subdivisions, bearing):
    """pi a^2 from any direction, within 1 dB (the specular point is nearer than the centre by a)."""
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
    """Range to the nearest point and closing speed to the centre, for any motion of the radar."""
    radius, center = 0.1, np.array([3.0, 0.5, 0.0])
    scene = scene_of(shapes.sphere(center, radius))
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    finder = PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG)
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


TX, RX = tx_positions(CONFIG), rx_positions(CONFIG)
HALF = (CONFIG.chirp_times.max() - CONFIG.chirp_times.min()) / 2


def shortest(place, one, two):
    """Shortest of the paths between two places over a surface given by two parameters from zero on, m."""

    def way(x):
        point = place(x)
        return np.linalg.norm(point - one) + np.linalg.norm(point - two)

    return minimize(way, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-15}).fun


@pytest.mark.parametrize("speed", [0.0, 1.0])
@pytest.mark.parametrize("gap", [0.2, 0.3, 0.5])
@pytest.mark.parametrize("kind", ["sphere", "pole", "disc's end"])
def test_phase_close_by(kind, gap, speed):
    """Within 1 deg of the shortest path over the body, for every antenna, at rest and passing by at 1 m/s."""
    radius, half = 0.1, 0.6
    center = np.array([gap + radius, 0.02, 0.01 if kind != "disc's end" else half + 0.05])
    if kind == "sphere":
        mesh = shapes.sphere(center, radius, 4)
    else:
        mesh = shapes.placed(shapes.cylinder((0, 0, 0), radius, 2 * half, 24), center)
    scene = scene_of(mesh)
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    # the round body alone: a cylinder's lids are flat
    reflectors = replace(Reflectors.of(scene, CONFIG), flat=Flat.zeros(0))
    echoes = PathFinder(scene, nothing, reflectors, CONFIG, antenna=ISOTROPIC)(np.zeros(3), np.eye(3))
    fit = echoes.lengths(CONFIG, Rig((0, speed, 0)), -CONFIG.burst_center)[np.abs(echoes.amplitude).argmax()]
    axis, radius = (reflectors.round.axis[0], reflectors.round.radius[0])

    def place(x):
        turn, rise = x
        if kind == "sphere":
            across = [-np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)]
            return reflectors.round.center[0] + radius * np.array(across)
        along = -reflectors.round.half[0] * np.sign(axis[2]) if kind == "disc's end" else rise
        return reflectors.round.center[0] + along * axis + radius * np.array([-np.cos(turn), np.sin(turn), 0])

    for s in (-1.0, 0.0, 1.0) if speed else (0.0,):
        here = np.array([0, speed * s * HALF, 0])
        truth = [shortest(place, here + tx, here + rx) for tx in TX for rx in RX]
        assert 360 * np.abs(fit @ [1, s, s * s] - truth).max() / LAMBDA < 1


def test_what_is_round():
    """Round bodies are recognised among others; prisms of few sides, half pipes and ellipsoids are not."""
    box, prism = shapes.box((0, 0, 0), (1, 1, 1)), shapes.cylinder((0, 0, 0), 0.1, 1, 6)
    ball = shapes.sphere((0, 0, 0), 0.1)
    egg = ball.copy()
    egg.vertices[:, 2] *= 1.2
    for mesh in (box, prism, egg):
        assert not recognise(mesh)[0]
    poles = [shapes.placed(shapes.cylinder((x, 0, 0), 0.03, 0.7, 10), rotation=(0.3, 0.2, 0)) for x in (0, 1)]
    bodies, taken = recognise(shapes.joined(*poles, shapes.placed(ball, (0, 3, 0)), shapes.placed(box, (5, 0, 0))))
    assert sorted(round(b.radius, 6) for b in bodies) == [0.03, 0.03, 0.1]
    assert taken.sum() == 2 * 20 + len(ball.faces)
    assert max(b.half for b in bodies) == pytest.approx(0.35)


def test_a_round_body_has_no_facets():
    scene = scene_of(shapes.cylinder((0, 0, 0), 0.3, 2.0, 12, without=("-z", "+z")))
    found = Reflectors.of(scene, CONFIG)
    assert not len(found.flat) and len(found.round) == 1
