"""What stands in the first Fresnel zones of a flash or a chain: Kirchhoff's integral, and no steps."""

import numpy as np
import pytest

from benchmarks.references.brute_force import past_pole
from benchmarks.references.poles import LAMBDA, OFFSETS, WALL, left, pole, wall_past_pole
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject

#: Two sides of a wedge of 60 deg about (3, -0.5), and a way into it: over the first one square onto the second.
SLOPE, RISE = np.cos(np.pi / 6), np.sin(np.pi / 6)
WEDGE = [
    SceneObject(
        f"side {side}",
        shapes.rectangle((3 - 1.6 * SLOPE, -0.5 + side * 1.6 * RISE, 0), (3, 6), (-RISE, -side * SLOPE, 0)),
        MATERIALS["metal"],
    )
    for side in (1, -1)
]


def test_a_pole_before_a_wall():
    """In steps of 6 mm over its zones, where one ray went from 0 to -106 dB."""
    truth, found = wall_past_pole()
    middle = np.abs(OFFSETS) < 0.032
    assert truth[middle].max() < -2 and truth.min() > -4
    assert np.abs(found - truth)[middle].max() < 2 and np.sqrt(np.mean((found - truth) ** 2)) < 1.2
    assert np.abs(np.diff(found)).max() < 3.0


@pytest.mark.parametrize("tilt", [30.0, 90.0])
def test_a_pole_however_it_leans(tilt):
    truth = 20 * np.log10(abs(past_pole(0.0, 0.01, (1.0, 3.0), 4.0, LAMBDA)))
    assert left([WALL], [pole(1.0, 0.0, tilt=np.deg2rad(tilt))], 4.0) == pytest.approx(truth, abs=1.5)


@pytest.mark.parametrize("offset", [0.0, 0.012, 0.024])
def test_a_pole_within_a_chain(offset):
    """Between the sides of a wedge, where the way is 2.5 m long if it is unfolded."""
    foot, normal = np.array([3.0, -0.5]), np.array([-RISE, -SLOPE])
    place = np.array([2.5, offset])
    x, y = place - 2 * np.dot(place - foot, normal) * normal
    truth = 20 * np.log10(abs(past_pole(offset, 0.01, (2.5, 3.5), 6.0, LAMBDA)))
    assert left(WEDGE, [pole(x, y)], 6.0) == pytest.approx(truth, abs=1.5)


def test_an_edge_that_covers_the_flash_bit_by_bit():
    """Half a plane: half the field, -6 dB either way, where its edge meets the way, and no step on either side."""
    steps = np.arange(-10, 11) * 0.005
    board = [shapes.rectangle((1.0, y - 0.5, 0), (1.0, 3.0), (-1, 0, 0)) for y in steps]
    found = np.array([left([WALL], [SceneObject("board", mesh, MATERIALS["metal"])], 4.0) for mesh in board])
    assert np.interp(0.0, steps, found) == pytest.approx(-12, abs=1.5)
    assert abs(found[0]) < 1 and found[-1] < -25
    assert np.abs(np.diff(10 ** (found / 20))).max() < 0.25
