"""Moving objects: kinematics, surfaces, and occlusion."""

import numpy as np
import pytest
from pydantic import ValidationError

from radarsim.world.movers import Door, Fan, Part, Person

WALKER = Person(name="walker", path=((0, 0), (10, 0)), speed=1.2)


def test_a_person_walks_at_their_speed_and_turns_back():
    t = np.linspace(1, 7, 61)
    _, center = WALKER.poses(t)
    trunk = center[:, 0]
    assert np.polyfit(t, trunk[:, 0], 1)[0] == pytest.approx(1.2, abs=1e-3)
    assert abs(trunk[:, 1]).max() < 1e-9
    _, later = WALKER.poses(np.array([10 / 1.2 + 3.0]))
    _, before = WALKER.poses(np.array([10 / 1.2 - 3.0]))
    assert later[0, 0, 0] == pytest.approx(before[0, 0, 0], abs=0.02)


def test_body_stays_together_and_on_the_floor():
    """Thigh and shin share the knee, feet stay near the floor and do not sink, the head is at the top."""
    t = np.linspace(0, 5, 200)
    turn, center = WALKER.poses(t)
    down = np.array([0, 0, -1.0])
    for thigh, upper, shin, lower in ((2, 0.245, 3, 0.246), (6, 0.245, 7, 0.246)):
        knee = center[:, thigh] + turn[:, thigh] @ down * upper * 1.75 / 2
        other = center[:, shin] - turn[:, shin] @ down * lower * 1.75 / 2
        assert knee == pytest.approx(other, abs=1e-9)
    feet = np.minimum(*(center[:, k, 2] - 0.246 * 1.75 / 2 for k in (3, 7)))
    assert (feet > -0.02).all() and (feet < 0.15).all()
    assert (center[:, 1, 2] == center[..., 2].max(axis=1)).all()


def test_feet_alternate():
    """When the right foot swings forward the left one goes back, as seen from the trunk."""
    t = np.linspace(0, 5, 400)
    _, center = WALKER.poses(t)
    right, left = (center[:, k, 0] - center[:, 0, 0] for k in (3, 7))
    assert np.corrcoef(right, left)[0, 1] < -0.8
    assert np.ptp(right) > 0.4


def test_motion_is_smooth():
    """Speeds stay below 6 m/s and accelerations finite, corners and turn-arounds included."""
    round_trip = Person(name="p", path=((0, 0), (2, 0), (2, 2)), speed=1.0)
    t = np.arange(0, 12, 1e-3)
    _, center = round_trip.poses(t)
    velocity = np.diff(center, axis=0) / 1e-3
    assert np.linalg.norm(velocity, axis=2).max() < 6
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.2


def test_door_and_fan():
    door = Door(name="door", hinge=(1, 0, 1), width=0.8, angles=(0, 90), period=4)
    _, center = door.poses(np.array([0.0, 2.0]))
    assert center[:, 0] == pytest.approx(np.array([[1.4, 0, 1], [1, 0.4, 1]]))
    fan = Fan(name="fan", center=(0, 0, 2), radius=0.5, blades=4, turns_per_second=0.5)
    _, center = fan.poses(np.array([0.0, 0.5]))
    assert center[0, 0] == pytest.approx([0.275, 0, 2])
    assert center[1, 0] == pytest.approx([0, 0.275, 2])


@pytest.mark.parametrize("part", [Part((0.2, 0.2, 0.5), True), Part((0.1, 0.3, 0.5), False)])
def test_points_spread_evenly_over_surfaces(part):
    points, normals = part.sample(40000, np.random.default_rng(0))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)
    assert np.abs(normals.mean(axis=0)).max() < 0.02
    if part.capsule:
        axis = points - np.clip(points[:, 2], -0.5, 0.5)[:, None] * [0, 0, 1]
        assert np.linalg.norm(axis, axis=1) == pytest.approx(0.2)
        straight = np.mean(np.abs(points[:, 2]) < 0.5)
        assert straight == pytest.approx(0.5 / 0.7, abs=0.01)  # 4 pi r h of 4 pi r (r + h)
        assert part.area == pytest.approx(4 * np.pi * 0.2 * 0.7)
    else:
        on_face = np.isclose(np.abs(points), part.half).sum(axis=1)
        assert (on_face >= 1).all() and np.mean(on_face == 1) > 0.99
        share = np.mean(np.isclose(np.abs(points[:, 0]), 0.1))
        assert share == pytest.approx(8 * 0.3 * 0.5 / part.area, abs=0.01)


@pytest.mark.parametrize(
    ("kind", "values"),
    [
        (Person, {"path": ()}),
        (Person, {"path": ((0, 0),), "speed": -1}),
        (Fan, {"center": (0, 0, 0), "axis": (0, 0, 0)}),
        (Door, {"hinge": (0, 0, float("nan"))}),
    ],
)
def test_bad_values(kind, values):
    with pytest.raises(ValidationError):
        kind(name="x", **values)
