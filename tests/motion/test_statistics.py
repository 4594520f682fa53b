"""Statistics of motions against values calculated manually."""

import numpy as np
import pytest

from radarsim.motion.statistics import Statistics, crossings
from radarsim.motion.trajectory import Motion
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene


def scene(*boxes) -> Scene:
    return Scene(
        "x", [SceneObject(f"box {i}", shapes.box(at, size), MATERIALS["wood"]) for i, (at, size) in enumerate(boxes)]
    )


@pytest.mark.parametrize(
    ("course", "share"), [(0, "forward"), (40, "forward"), (90, "sideways"), (-100, "sideways"), (170, "backward")]
)
def test_straight_on(course, share):
    angle = np.deg2rad(course + 30)
    motion = Motion.linear((0, 0, 1), (0.5 * np.cos(angle), 0.5 * np.sin(angle), 0), yaw=np.deg2rad(30), duration=4.0)
    found = Statistics.of(motion)
    assert found.distance == pytest.approx(2.0) and found.duration == 4.0
    assert found.mean_speed == pytest.approx(0.5) and found.top_speed == pytest.approx(0.5)
    shares = {name: getattr(found, name) for name in ("forward", "backward", "sideways", "standing")}
    assert shares == {name: float(name == share) for name in shares}
    assert found.top_turn_rate == pytest.approx(0, abs=1e-12) and found.clearance is None


def test_turning_on_the_spot():
    """The sensor on its lever arm moves on a circle; the platform stands."""
    motion = Motion.linear((0, 0, 1), (0, 0, 0), yaw_rate=0.8, lever_arm=(0.2, 0, 0), duration=5.0)
    found = Statistics.of(motion)
    assert found.standing == 1.0
    assert found.distance == pytest.approx(0.2 * 0.8 * 5)
    assert found.rms_turn_rate == pytest.approx(0.8) and found.top_turn_rate == pytest.approx(0.8)


def test_tilt():
    motion = Motion.still((0, 0, 1), yaw=2.0, pitch=0.10, roll=-0.05)
    found = Statistics.of(motion)
    assert found.rms_pitch == pytest.approx(0.10, abs=1e-4) and found.rms_roll == pytest.approx(0.05, abs=1e-3)
    assert found.standing == 1.0 and found.distance == 0


def test_clearance_and_crossing():
    world = scene(((3, 0, 1), (1, 1, 2)), ((0, 5, 1), (1, 1, 2)))
    past = Motion.linear((0, 0.9, 1), (1, 0, 0), duration=6.0)
    assert Statistics.of(past, world).clearance == pytest.approx(0.4, abs=1e-6)
    assert crossings(past, world) == ""
    through = Motion.linear((0, 0.1, 1), (1, 0, 0), duration=6.0)
    assert Statistics.of(through, world).clearance < 0.01
    assert crossings(through, world).startswith("the sensor passes through 'box 0', first at t = 2.")


def test_survives_the_way_through_a_recording():
    found = Statistics.of(Motion.linear((0, 0, 1), (0.3, 0, 0), yaw_rate=0.1))
    assert Statistics.from_json(found.json()) == found
    assert str(found).startswith(
        "0.3 m in 1.0 s, mean 0.30 and at most 0.30 m/s, turning at 6 deg/s (RMS, at most 6), 100%"
    )
