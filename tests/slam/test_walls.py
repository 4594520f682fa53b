"""Heading constraints from walls: the wall direction of a submap, its association, and the result of SLAM."""

import numpy as np
import pytest

from radarize.io.pose import transform
from radarize.odometry.rightangles import associate_direction, from_right_angle
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig, WallsConfig
from radarize.slam.walls import WallDirection, Walls
from tests.slam.world import box, play, walk

BEARINGS = np.radians(np.linspace(-60, 60, 61))
#: A corridor of 40 m with doors.
CORRIDOR = np.concatenate([box(0, 0, 40, 2), *(box(x, 0, x + 1, 0.15) for x in range(4, 40, 5))])


def seen(walls, turn=0.0, noise=0.02, seed=0):
    """Points on walls, in a frame that is rotated."""
    rng = np.random.default_rng(seed)
    a, b = walls[:, None, :2], walls[:, None, 2:]
    points = (a + (b - a) * rng.random((len(walls), 200, 1))).reshape(-1, 2)
    return transform(np.array([0, 0, -turn]), points + rng.normal(0, noise, points.shape))


def round_room(radius):
    """Walls of a round room."""
    angles = np.linspace(0, 2 * np.pi, 33)
    corners = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.column_stack([corners[:-1], corners[1:]])


@pytest.mark.parametrize("degrees", [-44.9, -20.1, 0.0, 0.6, 33.3, 89.95])
def test_walls_have_the_direction_of_the_room(degrees):
    found = WallDirection.of(seen(box(-2, -1.5, 2.5, 1.5), np.radians(degrees)))
    assert np.degrees(from_right_angle(found.angle + np.radians(degrees))) == pytest.approx(0, abs=0.1)
    assert found.contrast > 3


def test_a_wall_across_the_end_of_the_bins_is_one_wall():
    """The bins of a projection wrap around after 51.2 m."""
    near, far = (WallDirection.of(seen(box(x, 0, x + 3, 2), 0.3)) for x in (0, 50))
    assert far.angle == pytest.approx(near.angle, abs=2e-3)


def test_a_round_room_has_no_direction():
    assert WallDirection.of(seen(round_room(2.0))).contrast < 1.3


def test_a_known_a_new_and_an_ambiguous_direction():
    """Compared with densities computed here: a deviation of 0.5 deg from a direction of twenty walls, with a standard
    deviation of 1 deg; one of 20 deg; and one between two such directions."""
    deviation, walls = np.radians(1.0), [20, 20]
    density = 20 * np.exp(-(0.5**2) / 2) / np.sqrt(2 * np.pi) / deviation
    assert density / (density + 0.5 / (np.pi / 2)) > 0.9
    assert associate_direction(np.radians([0.5, 20.0]), deviation**2, walls) == 0
    assert associate_direction(np.radians([20.0, -20.0]), deviation**2, walls) == 2
    assert associate_direction(np.radians([1.0, -1.2]), deviation**2, walls) is None
    assert associate_direction(np.zeros(0), deviation**2, []) == 0


def test_a_submap_is_parallel_to_the_first_one_of_its_direction():
    """Two wings at 30 deg; the constraint refers to the first submap of each direction, whatever the errors of the
    later headings."""
    walls, room = Walls(WallsConfig()), box(-2, -1.5, 2.5, 1.5)
    true, known = np.radians([0.0, 90.0, 30.0, 31.0, 0.0]), np.radians([0.0, 88.0, 30.0, 33.0, 3.0])
    wing = np.radians([0.0, 0.0, 30.0, 30.0, 0.0])
    found = [
        walls.associate(node, seen(room, true[node] - wing[node], seed=node), known, lambda a, b: np.radians(2.0) ** 2)
        for node in range(5)
    ]
    assert found[0] is None and found[2] is None  # each is the first of its direction
    for node, first, turn in ((1, 0, 90.0), (3, 2, 1.0), (4, 0, 0.0)):
        assert found[node][0] == first and np.degrees(found[node][1]) == pytest.approx(turn, abs=0.2)
    walls.keep({1: 0, 3: 1, 4: 2})
    found = walls.associate(3, seen(room, 0.0), np.radians([90.0, 31.0, 0.0, -2.0]), lambda a, b: np.radians(2.0) ** 2)
    assert found[0] == 0 and np.degrees(found[1]) == pytest.approx(-90.0, abs=0.2)


def test_directions_are_new_after_an_unobserved_turn():
    """With a standard deviation of 30 deg, a deviation of 40 deg is nearly as likely as 50 deg from the next right
    angle."""
    walls, room = Walls(WallsConfig()), box(-2, -1.5, 2.5, 1.5)
    known = np.radians([0.0, 0.0, 40.0, 41.0])

    def lost(a, b):
        return np.radians(30.0 if a < 2 <= b else 1.0) ** 2

    found = [walls.associate(node, seen(room, seed=node), known, lost) for node in range(4)]
    assert found[0] is None and found[2] is None
    for node, first in ((1, 0), (3, 2)):
        assert found[node][0] == first and np.degrees(found[node][1]) == pytest.approx(0, abs=0.2)


def heading_errors(enabled, seed):
    """Heading errors of SLAM down the corridor, rad, with a heading drift of odometry of 1 deg per metre."""
    poses, config = walk([[1, 1], [38, 1]], 0.05, 0.1), SlamConfig.preset("radar")
    slam = Slam(config.model_copy(update={"walls": config.walls.model_copy(update={"enabled": enabled})}))
    floor = np.array([0.001, 0.001, np.radians(0.25)])
    play(slam, CORRIDOR, poses, np.random.default_rng(seed), share=0, floor=floor, bearings=BEARINGS)
    slam.finish()
    _, found = slam.trajectory()
    return found[:, 2] - poses[: len(found), 2]


def test_a_corridor_stays_straight():
    """On five walks of 740 steps with an error of 0.25 deg RMS each, which is 1 deg and more within a submap."""
    errors = {
        enabled: np.degrees([np.abs(heading_errors(enabled, seed)).mean() for seed in range(5)])
        for enabled in (False, True)
    }
    assert errors[True].max() < 1.3 and errors[True].mean() < min(0.8, 0.75 * errors[False].mean())
