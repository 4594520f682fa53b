"""Plates against the physical-optics integral summed point by point, and against closed forms."""

import numpy as np
import pytest

from radarize.radar.presets import PRESETS
from radarsim.physics import plates
from tests.physics.rigs import conductors, isotropic_view

CONFIG = PRESETS["radarize"]
LAMBDA = CONFIG.wavelength


def plate(half, gamma=-1.0, center=(0.0, 0.0, 0.0)):
    """A rectangle in the plane x = 0, facing -x, sides along y and z."""
    x, y, z = np.eye(3)
    return conductors((center, z, y, half[::-1]), reflection=(gamma, -gamma))


def field(facets, position):
    """Echo amplitude of the plate, all parts together."""
    position = np.asarray(position, float)
    _, _, images, amplitude = plates.parts(facets, isotropic_view(position, LAMBDA))
    mirrored = np.einsum("pij,j->pi", images[:, :, :3], position) + images[:, :, 3]
    return np.sum(amplitude * np.exp(2j * np.pi * np.linalg.norm(position - mirrored, axis=1) / LAMBDA))


def physical_optics(half, position, across=3001):
    """(1 / 4 pi) sum of cos exp(j 2 k rho) / rho^2 dA over the plate."""
    y = ((np.arange(across) + 0.5) / across * 2 - 1) * half[0]
    z = ((np.arange(across) + 0.5) / across * 2 - 1) * half[1]
    area = (2 * half[0] / across) * (2 * half[1] / across)
    rho = np.sqrt(position[0] ** 2 + (position[1] - y[:, None]) ** 2 + (position[2] - z) ** 2)
    return np.sum(abs(position[0]) / rho * np.exp(4j * np.pi * rho / LAMBDA) / rho**2) * area / (4 * np.pi)


@pytest.mark.parametrize("distance", [0.5, 2.0, 4.0])
@pytest.mark.parametrize("gamma", [-1.0, -0.25])
def test_wall_flash(distance, gamma):
    """|a| = lambda |Gamma| / (4 pi 2 R) from a wall that fills the view."""
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


def test_no_step_as_the_flash_leaves_the_plate():
    """Sliding past the edge in tenths of a millimetre, the field never jumps."""
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
