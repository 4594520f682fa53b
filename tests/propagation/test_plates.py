"""Plates against the physical-optics integral summed point by point, and against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.references.plates import CONFIG, LAMBDA, physical_optics
from benchmarks.references.rigs import conductors, isotropic
from radarsim.propagation import plates
from radarsim.propagation.media import HEAD_ON
from radarsim.propagation.reflectors import Reflectors
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene


def plate(half, gamma=-1.0, center=(0.0, 0.0, 0.0)):
    """Rectangle in the plane x = 0, facing -x, sides along y and z."""
    x, y, z = np.eye(3)
    return conductors((center, z, y, half[::-1]), gamma=gamma)


def field(facets, position):
    """Echo amplitude of the plate, all parts together."""
    position = np.asarray(position, float)
    parts = plates.specular_points(facets, isotropic(position, LAMBDA), 0)
    mirrored = np.einsum("pij,j->pi", parts.isometry[:, :, :3], position) + parts.isometry[:, :, 3]
    return np.sum(parts.amplitude * np.exp(2j * np.pi * np.linalg.norm(position - mirrored, axis=1) / LAMBDA))


@pytest.mark.parametrize("distance", [0.5, 2.0, 4.0])
@pytest.mark.parametrize("gamma", [-1.0, -0.25])
def test_wall_reflection(distance, gamma):
    """|a| = lambda |Gamma| / (4 pi 2 R) for a wall that fills the field of view."""
    amplitude = abs(field(plate((40, 40), gamma), (-distance, 0, 0)))
    assert 20 * np.log10(amplitude / (LAMBDA * abs(gamma) / (8 * np.pi * distance))) == pytest.approx(0, abs=0.05)


def test_small_plate_in_the_far_field():
    """sigma = 4 pi A^2 / lambda^2 beyond 2 D^2 / lambda: a 4 cm plate at 3 m."""
    half, distance = (0.02, 0.02), 3.0
    sigma = 4 * np.pi * (4 * half[0] * half[1]) ** 2 / LAMBDA**2
    expected = np.sqrt(LAMBDA**2 * sigma / ((4 * np.pi) ** 3 * distance**4))
    assert 20 * np.log10(abs(field(plate(half), (-distance, 0, 0))) / expected) == pytest.approx(0, abs=0.05)


@pytest.mark.parametrize(
    ("half", "position"),
    [
        ((0.1, 0.1), (-2, 0.3, 0.0)),
        ((0.1, 0.1), (-2, 0.3, 0.2)),
        ((0.1, 0.2), (-1, 0.6, 0.3)),
        ((0.3, 0.3), (-1, 0.2, 0.0)),
        ((0.3, 0.3), (-1, 0.3, 0.0)),  # the foot of the perpendicular on the edge itself
        ((0.3, 0.3), (-1, 0.31, 0.1)),
        ((0.3, 0.2), (-0.7, 0.9, 0.0)),
    ],
)
def test_plate_anywhere(half, position):
    """Amplitude within 0.3 dB and phase within 2 deg of the integral, on and off the normal, near and far."""
    found, truth = field(plate(half), position), -physical_optics(half, position) / 1j
    assert 20 * np.log10(abs(found) / abs(truth)) == pytest.approx(0, abs=0.3)
    assert np.rad2deg(np.angle(found / truth)) == pytest.approx(0, abs=2)


def polygon(corners):
    """A conducting quadrilateral in the plane x = 0, facing -x, by the y and z of its corners."""
    flat = np.array(corners, float)
    place = np.column_stack([np.zeros(4), flat])[None]
    return replace(plate((1, 1)), corners=place)


def integral(corners, position, across=2000):
    """`physical_optics` over a convex quadrilateral, cells counted by the share of their samples inside."""
    flat = np.array(corners, float)
    low, high = flat.min(axis=0), flat.max(axis=0)
    y, z = (low + (high - low) * (np.arange(across)[:, None] + 0.5) / across).T
    y, z = y[:, None], z[None]
    inside = np.ones((across, across), bool)
    for (y0, z0), (y1, z1) in zip(flat, np.roll(flat, -1, axis=0), strict=True):
        inside &= (y1 - y0) * (z - z0) - (z1 - z0) * (y - y0) >= 0
    rho = np.sqrt(position[0] ** 2 + (position[1] - y) ** 2 + (position[2] - z) ** 2)
    field = inside * abs(position[0]) / rho**3 * np.exp(4j * np.pi * rho / LAMBDA)
    return np.sum(field) * np.prod((high - low) / across) / (4 * np.pi)


TRIANGLE = [(-0.1, -0.1), (0.2, -0.05), (0.0, 0.15), (0.0, 0.15)]
KITE = [(-0.1, -0.02), (0.05, -0.12), (0.13, 0.0), (0.02, 0.1)]


@pytest.mark.parametrize("corners", [TRIANGLE, KITE], ids=["triangle", "kite"])
@pytest.mark.parametrize(
    "position", [(-2, 0.03, 0.02), (-1, 0.3, 0.1), (-0.6, -0.2, 0.25), (-3, 0.4, -0.6), (-1, 0, 0.15)]
)
def test_polygon_anywhere(corners, position):
    """Triangles and quadrilaterals: within 0.3 dB and 2 deg of the integral, in front of them, beside, at a corner."""
    found, truth = field(polygon(corners), position), -integral(corners, position) / 1j
    assert 20 * np.log10(abs(found) / abs(truth)) == pytest.approx(0, abs=0.3)
    assert np.rad2deg(np.angle(found / truth)) == pytest.approx(0, abs=2)


def test_triangle_in_the_far_field():
    """sigma = 4 pi A^2 / lambda^2 for a triangle as well."""
    corners, distance = [(-0.02, -0.02), (0.03, -0.02), (0.0, 0.02), (0.0, 0.02)], 4.0
    sigma = 4 * np.pi * (0.05 * 0.04 / 2) ** 2 / LAMBDA**2
    expected = np.sqrt(LAMBDA**2 * sigma / ((4 * np.pi) ** 3 * distance**4))
    assert 20 * np.log10(abs(field(polygon(corners), (-distance, 0, 0))) / expected) == pytest.approx(0, abs=0.05)


def test_plate_over_twenty_degrees():
    """A 4 cm plate at 10 m from -20 to 20 deg: 4 pi A^2 cos^2 sinc^2 / lambda^2 within 1 dB, down to -30 dB."""
    side, distance = 0.04, 10.0
    angles = np.deg2rad(np.arange(-20, 20.1, 0.25))
    argument = 2 * np.pi / LAMBDA * side * np.sin(angles)
    shape = np.cos(angles) * np.sinc(argument / np.pi)
    sigma = 4 * np.pi * side**4 / LAMBDA**2 * shape**2
    expected = np.sqrt(LAMBDA**2 * sigma / ((4 * np.pi) ** 3 * distance**4))
    place = distance * np.stack([-np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    found = np.array([abs(field(plate((side / 2, side / 2)), p)) for p in place])
    lobes = np.abs(shape) > 10 ** (-30 / 20)
    assert lobes.sum() > 100
    assert np.abs(20 * np.log10(found / expected)[lobes]).max() < 1


def test_no_step_as_the_reflection_leaves_the_plate():
    """Moving past the edge in tenths of a millimetre, the field is continuous."""
    y = 0.3 + np.arange(-100, 100) * 1e-4
    values = np.array([field(plate((0.3, 0.3)), (-1, at, 0)) for at in y])
    assert np.max(np.abs(np.diff(values))) < 0.02 * np.max(np.abs(values))


def test_abutting_plates_are_one_plate():
    """Two halves of a plate, seam in view, echo as the whole: their edge terms cancel along the seam."""
    left, right = (plate((0.15, 0.3), center=(0, side * 0.15, 0)) for side in (1, -1))
    position = (-1.2, 0.02, 0.05)
    assert field(left, position) + field(right, position) == pytest.approx(field(plate((0.3, 0.3)), position), rel=1e-5)


def test_behind_a_one_sided_plate_there_is_nothing():
    assert field(plate((0.3, 0.3)), (1.0, 0, 0)) == 0


@pytest.mark.parametrize(("material", "side"), [("metal", 0.019), ("metal", 0.01), ("concrete", 0.099), ("wood", 0.05)])
def test_small_plates_keep_their_echo(material, side):
    """Physical-optics integral of a small plate in a scene, for any material."""
    distance = 3.0
    mesh = shapes.rectangle((distance, 0, 0), (side, side), (-1, 0, 0))
    scene = Scene("plate", [SceneObject("plate", mesh, MATERIALS[material])])
    flat = Reflectors.of(scene, CONFIG).flat
    truth = abs(flat.layer[0, HEAD_ON] * physical_optics((side / 2, side / 2), (-distance, 0, 0), 401))
    assert 20 * np.log10(abs(field(flat, (0, 0, 0))) / truth) == pytest.approx(0, abs=0.3)
