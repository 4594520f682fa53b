"""Moving doors reflect, mirror and transmit like static doors, and paths over them move with the right phase."""

import numpy as np
import pytest
from scipy.optimize import minimize

from benchmarks.references.doors import (
    CONFIG,
    HALF,
    HEIGHT,
    HINGE,
    INSTANTS,
    MIDDLE,
    NOTHING,
    THICKNESS,
    WIDTH,
    door,
    finder,
    foot_speed,
    lengths,
    swinging,
)
from benchmarks.references.rigs import field
from radarize.io.errors import InputError
from radarize.radar.array import rx_positions, tx_positions
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.media import as_slab, lag
from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.paths import Kind
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Surface
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

LAMBDA = CONFIG.wavelength
HERE, AHEAD = np.zeros(3), np.eye(3)


def standing(angle, material="wood"):
    """The same leaf as a static object."""
    turn = np.deg2rad(angle)
    center = HINGE + WIDTH / 2 * np.array([np.cos(turn), np.sin(turn), 0])
    leaf = shapes.placed(shapes.box((0, 0, 0), (WIDTH, THICKNESS, HEIGHT)), center, (0, 0, turn))
    return SceneObject("leaf", leaf, MATERIALS[material])


def both(angle, things=(), surface=NOTHING, material="wood"):
    """Echoes of a static door, and of a moving one at the same position."""
    stands = finder([standing(angle, material), *things], surface=surface)
    moves = finder(things, [door(angle, material)], surface)
    return stands(HERE, AHEAD), moves(HERE, AHEAD)


def same(found, truth):
    """Whether two sets of echoes are equal in strength, phase and number."""
    order = [np.lexsort((e.amplitude.imag.round(9), e.amplitude.real.round(9))) for e in (found, truth)]
    size = np.abs(truth.amplitude).max()
    return len(found) == len(truth) and np.allclose(
        found.amplitude[order[0]], truth.amplitude[order[1]], rtol=0, atol=1e-3 * size
    )


@pytest.mark.parametrize("angle", [90.0, 91.5, 84.0, 60.0, 20.0])
def test_a_door_reflects_as_if_it_stood(angle):
    """Faces, edges and corners: the same field, power and phase, at any angle."""
    stands, moves = both(angle)
    truth, found = (field(e, HERE, LAMBDA) for e in (stands, moves))
    assert abs(truth) > 0
    assert abs(found - truth) < 1e-3 * abs(truth)
    assert moves.moving.all()


@pytest.mark.parametrize("angle", [90.0, 70.0, 45.0, 10.0])
def test_a_door_scatters_no_more_than_if_it_stood(angle):
    """Mean power of diffuse echoes."""
    scene = Scene("door", [standing(angle)])
    powers = []
    for seed in range(4):
        surface = Surface(scene, np.random.default_rng(seed))
        scattered = PathFinder(scene, surface, None, CONFIG)(HERE, AHEAD)
        crowd = MovingTargets([door(angle)], np.random.default_rng(seed), density=300.0)
        moved = PathFinder(None, NOTHING, None, CONFIG, moving=crowd)(HERE, AHEAD)
        powers.append([np.sum(np.abs(e.amplitude) ** 2) for e in (scattered, moved)])
    truth, found = np.mean(powers, axis=0)
    assert 10 * np.log10(found / truth) == pytest.approx(0, abs=1)


WALL = SceneObject("wall", shapes.rectangle((4.0, 0.0, 0), (6.0, 3.0), (-1, 0, 0)), MATERIALS["metal"])


@pytest.mark.parametrize(("angle", "material"), [(90.0, "wood"), (75.0, "wood"), (90.0, "glass"), (0.0, "wood")])
def test_what_is_behind_a_door(angle, material):
    """A point and a wall: attenuated and delayed as by a static slab; unchanged beside an open door."""
    point = Scatterers.points(np.array([[3.0, 0.1, 0.2]]), np.ones(1))
    stands, moves = both(angle, [WALL], point, material)
    truth, found = (e.where(through=bool(angle), bounces=0, moving=False) for e in (stands, moves))
    assert len(truth) and len(truth.points) and len(truth.images)
    if angle:  # open, its edges and corners are direct echoes of the one and moving ones of the other
        assert same(found, truth)
    assert found.points == pytest.approx(truth.points, abs=1e-6)
    assert field(moves, HERE, LAMBDA) == pytest.approx(field(stands, HERE, LAMBDA), rel=1e-3)
    free = finder([WALL], surface=point)(HERE, AHEAD)
    loss = 20 * np.log10(np.abs(free.amplitude[0]) / np.abs(found.amplitude[0]))
    assert loss > 0.5 if angle else abs(loss) < 1e-9


LAMP = SceneObject("lamp", shapes.sphere((1.2, 1.3, 0.1), 0.1, 3), MATERIALS["metal"])
SIDE = SceneObject("side", shapes.rectangle((1.5, 1.5, 0), (6.0, 3.0), (0, -1, 0)), MATERIALS["metal"])


def test_a_lamp_is_seen_over_a_door():
    """Over its face on one path and on both: as over a static door."""
    stands, moves = both(60.0, [LAMP])
    truth = [stands.where(bounces=n, through=False) for n in (1, 2)]
    assert [len(e.points) for e in truth] == [2, 1]
    found = moves.where(moving=True, kind=Kind.POINT)
    assert len(found) == 3 == (moves.bounces > 0).sum()
    expected = np.concatenate([e.amplitude for e in truth])
    assert np.sort(np.abs(found.amplitude)) == pytest.approx(np.sort(np.abs(expected)), rel=1e-3)
    assert np.abs(field(moves, HERE, LAMBDA)) == pytest.approx(np.abs(field(stands, HERE, LAMBDA)), rel=1e-3)


def test_chains_over_a_door():
    """A door at an angle to a metal wall: the same images of the radar as over a static door."""
    stands, moves = both(50.0, [SIDE])
    ghosts = stands.where(bounces=2, through=False, moving=False)
    assert len(ghosts)
    assert field(moves, HERE, LAMBDA) == pytest.approx(field(stands, HERE, LAMBDA), rel=1e-3)
    for image in ghosts.images:
        assert np.abs(moves.where(moving=True).images - image).max(axis=(1, 2)).min() < 1e-9


def reflection(mover, t):
    """Reflection in the face of a door turned to the origin: matrix and offset."""
    low, high = np.deg2rad(mover.angles)
    angle = (low + high) / 2 - (high - low) / 2 * np.cos(2 * np.pi * t / mover.period)
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    normal *= -np.sign(HINGE @ normal)
    return np.eye(3) - 2 * np.outer(normal, normal), 2 * (HINGE @ normal + THICKNESS / 2) * normal


TX, RX = tx_positions(CONFIG), rx_positions(CONFIG)


def test_its_reflection_moves_as_the_door_does():
    """Path length of every antenna at the burst's ends and centre; its rate is twice the speed of the specular
    point."""
    mover = swinging(90.0)
    echoes = finder([], [mover])(HERE, AHEAD, MIDDLE)
    strongest = np.abs(echoes.amplitude).argmax()
    found = lengths(echoes)[strongest]
    late = lag(as_slab(standing(90.0))[0], CONFIG)
    assert abs(late) > 1e-4
    for k, s in enumerate(INSTANTS):
        matrix, offset = reflection(mover, MIDDLE + s * HALF)
        truth = np.linalg.norm(TX[:, None] - (RX @ matrix.T + offset), axis=2).ravel()
        assert found[:, k] == pytest.approx(truth + late, abs=2e-6)
    assert (found[0, 0] - found[0, 2]) / (4 * HALF) == pytest.approx(foot_speed(mover), abs=5e-3)


def test_corners_with_a_door_move_as_it_does():
    """Chains over a door and a wall, either way round."""
    mover = swinging(50.0)
    echoes = finder([SIDE], [mover])(HERE, AHEAD, MIDDLE)
    found = lengths(echoes)[echoes.kind == Kind.IMAGE]
    (matrix, offset), wall, above = reflection(mover, MIDDLE), np.diag([1.0, -1.0, 1.0]), np.array([0, 3.0, 0])
    for wall_first in (False, True):
        middle = (wall @ matrix, wall @ offset + above) if wall_first else (matrix @ wall, matrix @ above + offset)
        image = np.abs(echoes.images - np.column_stack(middle)).max(axis=(1, 2)).argmin()
        for k, s in enumerate(INSTANTS):
            matrix_s, offset_s = reflection(mover, MIDDLE + s * HALF)
            if wall_first:
                mirrored = (RX @ matrix_s.T + offset_s) @ wall + above
            else:
                mirrored = (RX @ wall + above) @ matrix_s.T + offset_s
            truth = np.linalg.norm(TX[:, None] - mirrored, axis=2).ravel()
            assert found[image, :, k] == pytest.approx(truth, abs=2e-6)
    assert np.ptp(found[image], axis=1).min() > 1e-3


def test_points_move_over_a_door():
    """A static point, seen over a door on one path and on both, over the whole burst."""
    mover, place = swinging(60.0), np.array([1.2, 1.3, 0.1])
    echoes = finder([], [mover], Scatterers.points(place[None], np.ones(1)))(HERE, AHEAD, MIDDLE)
    points, n = echoes.where(kind=Kind.POINT), len(echoes.points)
    over = np.linalg.norm(echoes.points - place, axis=2) > 0.01
    assert sorted(over.sum(axis=1)) == [0, 1, 1, 2] and points.moving.sum() == 3
    assert np.array_equal(points.moving, over.any(axis=1))
    found = lengths(points)
    for k, s in enumerate(INSTANTS):
        matrix, offset = reflection(mover, MIDDLE + s * HALF)
        image = matrix @ place + offset
        for echo in range(n):
            there, back = (np.where(far, image, place) for far in over[echo])
            truth = np.linalg.norm(TX - there, axis=1)[:, None] + np.linalg.norm(RX - back, axis=1)
            assert found[echo, :, k] == pytest.approx(truth.ravel(), abs=3e-6)


def test_ghosts_of_a_lamp_move_with_the_door():
    """Shortest path over the sphere between radar and image; the motion of its specular point is a second-order
    effect."""
    mover, center, radius = swinging(60.0), np.array([1.2, 1.3, 0.1]), 0.1
    echoes = finder([LAMP], [mover])(HERE, AHEAD, MIDDLE)
    echoes = echoes.where(kind=Kind.POINT)
    singles = np.flatnonzero(np.abs(np.linalg.norm(echoes.points - center, axis=2) - radius).max(axis=1) > 0.02)
    found = lengths(echoes)[singles].mean(axis=1)

    def way(normal, ends):
        point = center + radius * normal / np.linalg.norm(normal)
        return sum(np.linalg.norm(point - end) for end in ends)

    for echo, rows in zip(singles, found, strict=True):
        far = np.linalg.norm(echoes.points[echo] - center, axis=1) > 0.2
        change = []
        for s in INSTANTS:
            matrix, offset = reflection(mover, MIDDLE + s * HALF)
            array = TX.mean(axis=0), RX.mean(axis=0)
            ends = [matrix @ end + offset if over else end for over, end in zip(far, array, strict=True)]
            best = minimize(way, np.mean(ends, axis=0) - center, args=(ends,), tol=1e-14)
            change.append(best.fun)
        assert np.diff(rows) == pytest.approx(np.diff(change), abs=1e-5)
        assert abs(change[2] - change[0]) > 0.005


def test_echoes_of_one_cause_keep_their_motion():
    mover = swinging(60.0)
    point = Scatterers.points(np.array([[1.2, 1.3, 0.1]]), np.ones(1))
    echoes = finder([LAMP, WALL], [mover], point)(HERE, AHEAD, MIDDLE)
    some = echoes.moving
    assert 0 < some.sum() < len(some)
    assert lengths(echoes.where(moving=True)) == pytest.approx(lengths(echoes)[some], abs=1e-12)


def test_an_unknown_material_is_named():
    with pytest.raises(InputError, match="adamantium"):
        Scene.of({"objects": [], "building": {"kind": "A", "seed": 0}, "moving": [
            {"kind": "door", "name": "d", "hinge": [0, 0, 0], "material": "adamantium"}]}, "room")  # fmt: skip
