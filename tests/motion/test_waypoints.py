"""Walks through way-points, and error messages for unusable way-points."""

import numpy as np
import pytest
from typer.testing import CliRunner

from radarize.io.errors import InputError
from radarize.io.recording import Recording
from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.walk import Walk
from radarsim.motion.waypoints import read_waypoints
from radarsim.recording.simulate import simulate
from radarsim.world.scene import Scene
from tests.motion.distances import least_distance, obstacles

PLACES = [[1.5, 6.0], [7.0, 6.2], [9.5, 6.0], [3.0, 6.0]]


@pytest.fixture(scope="module")
def office() -> Scene:
    return Scene.load("office")


@pytest.fixture(scope="module")
def rooms(office) -> np.ndarray:
    """Free places in four rooms and the corridor at which a person can stand."""
    things = obstacles(office)
    rng = np.random.default_rng(0)
    found = [[9.0, 6.0]]
    for low, high in (((1, 1), (8, 4)), ((1, 8), (8, 11)), ((10, 8), (17, 11)), ((10, 1), (17, 4))):
        for place in rng.uniform(low, high, (200, 2)):
            corners = place + 0.5 * np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1]])
            if all(least_distance(np.array([[x, y, z]]), things)[0] > 0.45 for x, y in corners for z in (0.3, 1.0)):
                found.append(place)
                break
    return np.array(found)


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_goes_through_each_of_them_in_order(office, platform):
    motion = plan_motion(office, platform, None, np.random.default_rng(0), np.array(PLACES))
    t = np.arange(0, motion.duration, 0.02)
    middle = motion.path(t)[:, :2]
    passed, last = [], 0
    for place in PLACES:
        distance = np.linalg.norm(middle[last:] - place, axis=1)
        near = int(np.argmax(distance < 0.06))
        assert distance[near] < 0.06
        last += near
        passed.append(t[last])
    assert passed == sorted(passed)
    # From a standstill at the first to a standstill at the last, which ends it.
    assert np.linalg.norm(motion.velocity(np.array([0.2, motion.duration])), axis=1) == pytest.approx(0, abs=0.02)
    assert passed[-1] > motion.duration - 3


@pytest.mark.parametrize("apart", [0.5, 1.0, 2.0])
def test_goes_from_one_to_the_next_however_near(office, apart):
    places = np.array([[3.0, 6.0], [3.0 + apart, 6.0]])
    motion = plan_motion(office, "cart", None, np.random.default_rng(0), places)
    ends = motion.path(np.array([0.0, motion.duration]))[:, :2]
    assert ends == pytest.approx(places, abs=0.06)


def test_goes_through_doors(office, rooms):
    assert len(rooms) >= 3
    motion = plan_motion(office, "handheld", None, np.random.default_rng(1), rooms)
    sensor = motion.position(np.arange(0, motion.duration, 0.1))
    assert least_distance(sensor, obstacles(office)).min() >= 0.2
    apart = np.linalg.norm(motion.path(np.arange(0, motion.duration, 0.02))[:, None, :2] - rooms, axis=2)
    assert apart.min(axis=0).max() < 0.06


def test_ends_when_asked(office):
    motion = plan_motion(office, "cart", 3.0, np.random.default_rng(0), np.array(PLACES))
    assert motion.duration == 3.0


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_the_first_way_point_not_reached_is_named(office, platform):
    """None of a walk that ends at the last one; of one that ends just before a place is passed, this place."""
    whole = Walk(platform, waypoints=np.array(PLACES)).through(office, seed=0)
    times = np.arange(0, whole.duration, 0.02)
    second = times[np.linalg.norm(whole.path(times)[:, :2] - PLACES[1], axis=1).argmin()]
    for duration, words in (
        (None, ""),
        (whole.duration, ""),
        (second + 1, "ends before way-point 3 of 4 (x 9.50, y 6.00 m)"),
        (second - 1, "ends before way-point 2 of 4 (x 7.00, y 6.20 m)"),
    ):
        walk = Walk(platform, duration, waypoints=np.array(PLACES))
        found = walk.unreached(walk.through(office, seed=0))
        assert words in found and bool(words) == bool(found)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.yaml", "- [1, 2.5]\n- [3, 4]\n"),
        ("a.yml", "waypoints: [[1, 2.5], [3, 4]]\n"),
        ("a.csv", "x,y\n1,2.5\n3,4\n"),
        ("a.txt", "# places\n1 2.5\n\n3 4 # last\n"),
        ("a.tum", "0 1 2.5 0 0 0 0 1\n1 1.1 2.5 0 0 0 0 1\n2 3 4 0 0 0 0 1\n"),
    ],
)
def test_files(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    assert read_waypoints(tmp_path / name).tolist() == [[1, 2.5], [3, 4]]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.yaml", "- [1, 2]\n- [1, x]\n", "a.yaml, way-point 2: is '1 x', expected two finite numbers"),
        ("a.yaml", "- [1, 2]\n- '34'\n", "a.yaml, way-point 2: is '34'"),
        ("a.yaml", "- [1, 2]\n- {3: x, 4: y}\n", "a.yaml, way-point 2: is .{3: 'x', 4: 'y'}"),
        ("a.yaml", "places: 3\n", "a.yaml: holds dict, expected a list"),
        ("a.yaml", "- [1\n", "a.yaml: malformed YAML"),
        ("a.csv", "1,2\n3,nan\n", "a.csv, line 2: is '3 nan'"),
        ("a.csv", "1,2\n3\n", "a.csv, line 2: is '3'"),
        ("a.csv", "1,2\n", "a.csv: holds 1 way-points, expected at least 2"),
        ("a.csv", "", "a.csv: holds 0 way-points"),
    ],
)
def test_bad_files(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        read_waypoints(tmp_path / name)
    with pytest.raises(InputError, match="gone.csv: no such file"):
        read_waypoints(tmp_path / "gone.csv")


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ([9.0, 5.2], r"office, platform handheld: way-point 2 \(x 9.00, y 5.20 m\) lies 0.[012]. m .*0.40 m or more"),
        ([9.0, 4.92], r"way-point 2 .* lies where there is no floor"),
        ([99.0, 3.0], "way-point 2 .* lies outside the scene"),
    ],
)
def test_places_nobody_can_stand_at(office, place, message):
    with pytest.raises(InputError, match=message):
        plan_motion(office, "handheld", None, np.random.default_rng(0), np.array([PLACES[0], place]))


def test_places_behind_a_closed_door(tmp_path):
    """Two rooms separated by a wall."""
    (tmp_path / "cells.yaml").write_text(
        "objects:\n"
        "  - {name: floor, shape: box, size: [8, 4, 0.1], position: [0, 0, -0.05], material: concrete}\n"
        "  - {name: wall, shape: box, size: [0.2, 4, 3], position: [0, 0, 1.5], material: brick}\n"
    )
    scene = Scene.load(tmp_path / "cells.yaml")
    places = np.array([[-2.0, 0], [-1.0, 1.0], [2.0, 0]])
    with pytest.raises(InputError, match=r"way-point 3 \(x 2.00, y 0.00 m\) cannot be reached"):
        plan_motion(scene, "robot", None, np.random.default_rng(0), places)
    assert plan_motion(scene, "robot", None, np.random.default_rng(0), places[:2]).duration > 3


def test_the_recording_describes_its_motion(tmp_path):
    """Statistics of a recording: through way-points on the command line, cut short; and along poses through a wall."""
    from radarsim.cli import app

    (tmp_path / "way.csv").write_text("-1.5 0\n1.5 0.5\n")
    typed = ["simulate", "physics/room", "-o", str(tmp_path / "a.h5"), "--waypoints", str(tmp_path / "way.csv")]
    result = CliRunner().invoke(app, [*typed, "--duration", "0.1", "--mounting", "0.1 0 0 0 0 0"], prog_name="radarsim")
    assert result.exit_code == 0 and "m in 0.1 s, mean" in result.stdout
    assert "warning: the walk of 0.1 s ends before way-point 2 of 2 (x 1.50, y 0.50 m)" in result.stdout
    (tmp_path / "wall.tum").write_text("".join(f"{t} 0 {1 + 15 * t} 1 0 0 0 1\n" for t in (0.0, 0.05, 0.1, 0.15)))
    path = simulate("physics/room", tmp_path / "b.h5", trajectory=tmp_path / "wall.tum", duration=0.1)
    with Recording(path) as recording:
        assert "the sensor passes through 'north'" in recording.attributes["warnings"]
