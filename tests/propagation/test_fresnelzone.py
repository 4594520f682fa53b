"""Obstacles in the first Fresnel zones of specular reflections and chains: Kirchhoff's integral, and no steps."""

import numpy as np
import pytest
from scipy.special import erfc

from benchmarks.references.brute_force import past_edge, past_pole
from benchmarks.references.poles import CONFIG, LAMBDA, OFFSETS, WALL, left, pole, wall_past_pole
from benchmarks.references.rigs import field
from radarsim.propagation.antenna import ISOTROPIC
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.reflectors import Reflectors
from radarsim.propagation.scatterers import Scatterers
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

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
    """A pole in front of a wall, in steps of 6 mm over its zones, in which a single ray would jump from 0 to -106
    dB."""
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
    """A pole between the sides of a wedge, on a path of 2.5 m when unfolded."""
    foot, normal = np.array([3.0, -0.5]), np.array([-RISE, -SLOPE])
    place = np.array([2.5, offset])
    x, y = place - 2 * np.dot(place - foot, normal) * normal
    truth = 20 * np.log10(abs(past_pole(offset, 0.01, (2.5, 3.5), 6.0, LAMBDA)))
    assert left(WEDGE, [pole(x, y)], 6.0) == pytest.approx(truth, abs=1.5)


def board(x, y):
    """A screen beside the path that leaves it clear up to y, m; negative: it blocks the path."""
    return SceneObject("board", shapes.rectangle((x, y + 0.5, 0), (1.0, 3.0), (-1, 0, 0)), MATERIALS["metal"])


def test_half_a_plane_by_closed_forms():
    """Check of the reference: at grazing 1 / 4 + asin(rho) / (2 pi), where rho is 1 / 3 half way to the mirror."""
    grazing = past_edge(0.0, (1.0, 3.0), 4.0, LAMBDA)
    assert grazing == pytest.approx(0.25 + np.arcsin(1 / 3) / (2 * np.pi), abs=1e-6)
    wide = past_pole(0.22, 0.4, (1.0, 3.0), 4.0, LAMBDA, nodes=2000)  # a strip whose other edge is far
    assert past_edge(0.02, (1.0, 3.0), 4.0, LAMBDA) == pytest.approx(wide, abs=0.05)


@pytest.mark.parametrize("distance", [0.5, 1.0, 1.5, 1.8])
def test_the_shadow_of_an_edge(distance):
    """A specular reflection 2 m away behind a screen: the path out and back passes two edges that coincide."""
    zone = np.sqrt(LAMBDA * distance * (4 - distance) / 8)
    offsets = np.array([-0.8, -0.5, -0.25, 0.0, 0.25, 0.5, 0.8]) * zone
    truth = [20 * np.log10(abs(past_edge(y, (distance, 4 - distance), 4.0, LAMBDA))) for y in offsets]
    found = [left([WALL], [board(distance, y)], 4.0) for y in offsets]
    assert found == pytest.approx(np.array(truth), abs=3.0)
    assert np.sqrt(np.mean(np.square(np.subtract(found, truth)))) < 1.3


@pytest.mark.parametrize("offset, level", [(0.0, -10.3), (-0.01, -14.1), (-0.03, -21.0)])
def test_an_edge_half_way(offset, level):
    """An edge on the path, 10 and 30 mm into the shadow: 1.7 to 3.8 dB more than two independent edges."""
    assert 20 * np.log10(abs(past_edge(offset, (1.0, 3.0), 4.0, LAMBDA))) == pytest.approx(level, abs=0.1)
    assert left([WALL], [board(1.0, offset)], 4.0) == pytest.approx(level, abs=1.5)


def test_an_edge_that_covers_the_reflection_bit_by_bit():
    """Half a plane at 1 m, from 50 mm beside the path to 50 mm over it: no step on either side."""
    steps = np.arange(-10, 11) * 0.005
    found = np.array([left([WALL], [board(1.0, -y)], 4.0) for y in steps])
    assert np.interp(0.0, steps, found) == pytest.approx(-10.3, abs=1.5)
    assert abs(found[0]) < 1 and found[-1] < -25
    assert np.abs(np.diff(10 ** (found / 20))).max() < 0.25


def test_an_edge_that_goes_behind_a_pillar_bit_by_bit():
    """The edge of a plate that the radar passes, in steps of 3 mm: no step, in contrast to a single ray (0.53)."""
    plate = SceneObject("plate", shapes.rectangle((2, -0.5, 0), (1, 1), (-1, 0, 0)), MATERIALS["metal"])
    nothing = Scatterers.points(np.zeros((0, 3)), np.zeros(0))
    reflectors, scene = Reflectors.of(Scene("plate", [plate]), CONFIG), Scene("all", [plate, board(1.0, 0.15)])
    finder = PathFinder(scene, nothing, reflectors, CONFIG, antenna=ISOTROPIC)
    places = np.stack([np.zeros(81), np.arange(81) * 0.003 + 0.18, np.zeros(81)], axis=1)
    found = finder.batch(places, np.tile(np.eye(3), (81, 1, 1)), np.zeros(81))
    before = np.array([field(e, p, LAMBDA) for e, p in zip(found[:-1], places[1:], strict=True)])
    now = np.array([field(e, p, LAMBDA) for e, p in zip(found[1:], places[1:], strict=True)])
    assert abs(now[-1]) < 0.1 * abs(now[0])
    assert np.abs(now - before).max() < 0.3 * np.abs(now).max()


def test_a_border_passes_without_steps():
    """The edge of a screen, half a millimetre at a time; binary nodes would step by 0.06 of the amplitude."""
    offsets = np.arange(-0.02, 0.02, 0.0005)
    found = 10 ** (np.array([left([WALL], [board(1.0, y)], 4.0) for y in offsets]) / 20)
    truth = np.array([abs(past_edge(y, (1.0, 3.0), 4.0, LAMBDA)) for y in offsets])
    assert np.abs(np.diff(found)).max() < 2 * np.abs(np.diff(truth)).max() + 0.01
    assert np.abs(found - truth).max() < 0.08


def test_a_strip_goes_behind_an_edge_as_a_point_does():
    """A strip of 20 mm, half a zone wide: the factor of the path there applies on the path back as well, Fresnel's
    integral squared (for one ray, 0 or 1)."""
    strip = SceneObject("strip", shapes.rectangle((2, 0, 0), (0.02, 0.4), (-1, 0, 0)), MATERIALS["metal"])
    reflectors, nothing = (
        Reflectors.of(Scene("strip", [strip]), CONFIG),
        Scatterers.points(np.zeros((0, 3)), np.zeros(0)),
    )

    def echo(*things):
        finder = PathFinder(Scene("all", [strip, *things]), nothing, reflectors, CONFIG, antenna=ISOTROPIC)
        return field(finder(np.zeros(3), np.eye(3)), np.zeros(3), LAMBDA)

    offsets = np.arange(-0.04, 0.041, 0.004)
    found = np.array([abs(echo(board(1.0, y)) / echo()) for y in offsets])
    zone = np.sqrt(LAMBDA / 2 / 2)
    truth = np.abs(erfc(-offsets / zone * np.sqrt(np.pi / 2) * np.exp(-0.25j * np.pi)) / 2) ** 2
    assert np.abs(found - truth)[np.abs(offsets) < 0.015].max() < 0.15
    assert np.abs(np.diff(found)).max() < 0.15
    assert found[0] < 0.05 and found[-1] == pytest.approx(1.0, abs=0.2)


def test_the_echo_of_a_strip_moves_with_it():
    """Paths found 5 mm aside keep the echo of a strip of 20 mm; as nearly opposite edges it would lose 0.24."""
    strip = SceneObject("strip", shapes.rectangle((1.75, 0, 0), (0.02, 0.32), (-1, 0, 0)), MATERIALS["metal"])
    nothing, scene = Scatterers.points(np.zeros((0, 3)), np.zeros(0)), Scene("strip", [strip])
    finder = PathFinder(scene, nothing, Reflectors.of(scene, CONFIG), CONFIG, antenna=ISOTROPIC)
    for aside in (0.012, 0.02, 0.03):
        here, there = np.array([0.0, aside, 0.0]), np.array([0.0, aside + 0.005, 0.0])
        before, now = (field(finder(place, np.eye(3)), there, LAMBDA) for place in (here, there))
        assert abs(now - before) < 0.12 * abs(now)
