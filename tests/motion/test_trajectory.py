"""Motion: derivatives against differences, clearance against the mesh itself, limits, bad files."""

import time

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarsim.motion.drive import STANDSTILL
from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.trajectory import Motion, Mounting, motion_from_tum
from radarsim.world import shapes
from radarsim.world.materials import MATERIALS
from radarsim.world.objects import SceneObject
from radarsim.world.scene import Scene

SEEDS = range(3)
DURATION = 40.0


@pytest.fixture(scope="module")
def office() -> Scene:
    return Scene.load("office")


@pytest.fixture(scope="module")
def tours(office) -> dict:
    return {(p, s): plan_motion(office, p, DURATION, np.random.default_rng(s)) for p in PLATFORMS for s in SEEDS}


def differences(motion: Motion, t, step=1e-5):
    velocity = (motion.position(t + step) - motion.position(t - step)) / (2 * step)
    turn = motion.rotation(t - step).inv() * motion.rotation(t + step)
    return velocity, turn.as_rotvec() / (2 * step)


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_derivatives(tours, platform):
    motion = tours[platform, 0]
    t = np.linspace(0.0, DURATION, 997)
    velocity, angular = differences(motion, t)
    assert np.abs(motion.velocity(t) - velocity).max() < 1e-6
    assert np.abs(motion.angular_velocity(t) - angular).max() < 1e-5


def test_linear_in_closed_form():
    motion = Motion.linear((1, 2, 3), (0.5, -0.2, 0), yaw=0.3, yaw_rate=1.2, lever_arm=(0.1, 0.05, 0), duration=4.0)
    t = np.linspace(-0.5, 4.5, 41)
    yaw = 0.3 + 1.2 * t
    arm = np.stack([0.1 * np.cos(yaw) - 0.05 * np.sin(yaw), 0.1 * np.sin(yaw) + 0.05 * np.cos(yaw), 0 * t], axis=1)
    expected = np.array([1, 2, 3]) + t[:, None] * [0.5, -0.2, 0] + arm
    assert np.abs(motion.position(t) - expected).max() < 1e-12
    swing = 1.2 * np.stack([-arm[:, 1], arm[:, 0], 0 * t], axis=1)
    assert np.abs(motion.velocity(t) - [0.5, -0.2, 0] - swing).max() < 1e-12
    assert np.abs(motion.angular_velocity(t) - [0, 0, 1.2]).max() < 1e-12
    assert np.abs(motion.rotation(t).as_matrix() - Rotation.from_euler("z", yaw[:, None]).as_matrix()).max() < 1e-12


def test_still():
    motion = Motion.still((1, 2, 3), yaw=np.pi / 2, duration=2.0)
    t = np.array([-5.0, 0.0, 1.0, 50.0])
    assert np.all(motion.position(t) == [1, 2, 3]) and not motion.velocity(t).any()
    assert motion.rotation(t).apply([1, 0, 0]) == pytest.approx(np.tile([0, 1, 0], (4, 1)))


def test_mount_turns_the_sensor_frame():
    base = Motion.linear((0, 0, 0), (0, 0, 0), yaw_rate=1.0)
    tilted = Motion(1.0, base.path, base.attitude, mount=Rotation.from_euler("y", 90, degrees=True))
    t = np.array([0.2])
    _, angular = differences(tilted, t)
    assert tilted.angular_velocity(t) == pytest.approx(angular, abs=1e-6)
    assert tilted.angular_velocity(t)[0] == pytest.approx([-1, 0, 0], abs=1e-9)


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_keeps_clear_of_everything(office, tours, platform):
    # Without the floor: the robot's sensor is 0.2 m above it.
    triangles = np.concatenate([o.mesh.triangles for o in office.objects if not o.is_floor_or_ceiling])
    every = trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(triangles.size // 3).reshape(-1, 3), process=False)
    t = np.arange(0, DURATION + 0.5, 0.2)
    for seed in SEEDS:
        position = tours[platform, seed].position(t)
        _, distance, _ = trimesh.proximity.closest_point(every, position)
        assert distance.min() >= 0.2
        # No wall is walked through.
        assert not office.occluded(position[:-1], position[1:]).any()


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_limits(tours, platform):
    carrier = PLATFORMS[platform]
    t = np.arange(0, DURATION, 0.01)
    for seed in SEEDS:
        motion = tours[platform, seed]
        speed = np.linalg.norm(motion.velocity(t), axis=1)
        turning = np.rad2deg(np.abs(motion.angular_velocity(t)[:, 2]))
        assert speed.max() <= carrier.top_speed
        start = t < STANDSTILL
        # The carrier stands; the sensor on its lever arm may turn already, as a body does before a first curve.
        assert np.linalg.norm(motion.path(t[start], 1), axis=1).max() < 1e-4
        assert np.linalg.norm(motion.position(t[start]) - motion.position(t[:1]), axis=1).max() < 1e-4
        assert speed[t < 0.4].max() < 1e-3
        assert np.quantile(turning, 0.9) < 90 and turning.max() < 130
        least = {"handheld": 25.0, "cart": 14.0, "robot": 6.0}[platform]
        assert speed.sum() * 0.01 > least
        height = motion.position(t)[:, 2]
        assert np.abs(height - carrier.height).max() < 0.05


def test_hand_faces_other_ways_and_wheels_follow_their_line(tours):
    t = np.arange(1, DURATION, 0.05)

    def angles(motion):
        velocity = motion.rotation(t).inv().apply(motion.velocity(t))
        fast = np.linalg.norm(velocity[:, :2], axis=1) > 0.25
        return np.rad2deg(np.abs(np.arctan2(velocity[fast, 1], velocity[fast, 0])))

    hand = np.concatenate([angles(tours["handheld", s]) for s in SEEDS])
    assert 0.3 < (hand < 30).mean() < 0.9 and (hand > 60).mean() > 0.05
    for platform in ("cart", "robot"):
        wheels = np.concatenate([angles(tours[platform, s]) for s in SEEDS])
        # Ahead or straight back, and ahead for most of the time: for the cart 0.5 to 1.0 of a tour, 0.8 on average.
        assert np.minimum(wheels, 180 - wheels).max() < 35
        assert (wheels < 35).mean() > 0.5


@pytest.mark.parametrize("platform", list(PLATFORMS))
def test_no_jerk(tours, platform):
    """Acceleration is continuous, also with gait: muscles and motors need time."""
    t = np.arange(0, DURATION, 0.01)
    most = {"handheld": 60.0, "cart": 6.0, "robot": 6.0}[platform]
    for seed in SEEDS:
        jerk = np.diff(tours[platform, seed].velocity(t)[:, :2], n=2, axis=0) / 0.01**2
        assert np.linalg.norm(jerk, axis=1).max() < most


def test_hand_comes_back(tours):
    """In each handheld tour the sensor returns to within a metre of a place visited at least ten seconds and five
    metres before."""
    t = np.arange(0, DURATION, 0.25)
    for seed in SEEDS:
        motion = tours["handheld", seed]
        place = motion.position(t)[:, :2]
        apart = np.linalg.norm(place[:, None] - place[None], axis=2)
        i, j = np.nonzero((apart < 1.0) & (t[None] - t[:, None] > 10))
        away = [apart[a, a:b].max() for a, b in zip(i, j, strict=True)]
        assert len(away) and max(away) > 3.0


def test_same_generator_same_tour(office, tours):
    again = plan_motion(office, "robot", DURATION, np.random.default_rng(0))
    t = np.linspace(0, DURATION, 50)
    assert np.array_equal(again.position(t), tours["robot", 0].position(t))


def test_mounting_is_the_users(office):
    mounting = Mounting.parse("0.3, 0.05, 0.1, 0 10 90")
    motion = plan_motion(office, "robot", 5.0, np.random.default_rng(0), mounting=mounting)
    t = np.array([0.0, 3.0])
    offset = motion.attitude(t).inv().apply(motion.position(t) - motion.path(t))
    assert offset == pytest.approx(np.tile([0.3, 0.05, 0.1], (2, 1)))
    # Looking to the left of the body's axis; rolled against the body's x axis is then nose down.
    forward = motion.attitude(t).inv().apply(motion.rotation(t).apply([1.0, 0, 0]))
    turned = [0.0, np.cos(np.deg2rad(10)), -np.sin(np.deg2rad(10))]
    assert forward == pytest.approx(np.tile(turned, (2, 1)), abs=1e-9)


@pytest.mark.parametrize("text", ["1 2 3", "a b c d e f", "0 0 0 0 0 nan"])
def test_bad_mounting(text):
    with pytest.raises(InputError, match="mounting is .* expected six numbers"):
        Mounting.parse(text)


def test_nowhere_to_go():
    box = Scene("cell", [SceneObject("cell", shapes.box((0, 0, 1), (0.8, 0.8, 2)), MATERIALS["metal"])])
    with pytest.raises(InputError, match="cell.*no room to move"):
        plan_motion(box, "handheld", 5.0, np.random.default_rng(0))
    with pytest.raises(InputError, match="platform is 'drone'"):
        plan_motion(box, "drone", 5.0, np.random.default_rng(0))
    with pytest.raises(InputError, match="duration"):
        plan_motion(box, "cart", float("nan"), np.random.default_rng(0))


def tum(folder, rows):
    path = folder / "poses.tum"
    path.write_text("# time x y z qx qy qz qw\n" + "\n".join(rows) + "\n")
    return path


GOOD = [f"{100 + 0.1 * i} {i} 0 1 0 0 {np.sin(0.05 * i)} {np.cos(0.05 * i)}" for i in range(20)]


def test_tum(tmp_path):
    motion = motion_from_tum(tum(tmp_path, GOOD))
    assert motion.duration == pytest.approx(1.9)
    t = np.array([0.0, 0.55, 1.9])
    assert motion.position(t) == pytest.approx(np.stack([10 * t, 0 * t, 1 + 0 * t], axis=1))
    assert motion.velocity(t)[1] == pytest.approx([10, 0, 0])
    assert motion.angular_velocity(t)[1] == pytest.approx([0, 0, 1], abs=1e-6)
    assert motion.position(np.array([5.0])) == pytest.approx(np.array([[19, 0, 1]]))
    assert not motion.velocity(np.array([5.0])).any()


BENT = ["0 0 0 0 0 0 0 1", "0.5 5 0 0 0 0 0 1", "1 9 0 0 0 0 0 1"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([*GOOD[:3], "100.3 nan 0 1 0 0 0 1", *GOOD[4:]], "line 5: .*expected finite numbers"),
        ([*GOOD[:3], GOOD[2]], "line 5: has time .* ascending"),
        (["1 2 3"], "line 2: .*expected eight numbers"),
        ([*GOOD[:3], "x 0 0 1 0 0 0 1"], "line 5: .*expected eight numbers"),
        ([*GOOD[:3], "100.3 0 0 1 0 0 0 0"], "line 5: has a quaternion of length 0"),
        (GOOD[:3], "3 poses, expected at least 4"),
        ([], "holds no poses"),
        (
            ["0 0 0 0 0 0 0 1", "1 0 0 0 0 0 0 1", "1.01 9 0 0 0 0 0 1", "2 9 0 0 0 0 0 1"],
            "times 1.000 and 1.010.* 9 m",
        ),
        ([*GOOD[:9], "100.9 9 0 1 0 0 1 0"], "times 100.800 and 100.900 the poses turn by 134 degrees"),
        ([*BENT, "109 9 0 0 0 0 0 1", "109.01 9.1 0 0 0 0 0 1"], "between times 1.000 and 109.000 a smooth curve"),
    ],
)
def test_bad_tum(tmp_path, rows, message):
    with pytest.raises(InputError, match=message):
        motion_from_tum(tum(tmp_path, rows))


def test_missing_tum(tmp_path):
    with pytest.raises(InputError, match="gone.tum"):
        motion_from_tum(tmp_path / "gone.tum")


def test_tum_with_uneven_stamps_passes_every_pose(tmp_path):
    rng = np.random.default_rng(0)
    t = 5.0 + np.cumsum(rng.uniform(0.002, 0.3, 60))
    place = np.column_stack([np.sin(t), t / 5, 1 + 0.1 * np.cos(t)])
    turn = Rotation.from_euler("ZYX", np.column_stack([np.cos(t), 0.1 * np.sin(t), 0 * t])).as_quat()
    path = tmp_path / "uneven.tum"
    np.savetxt(path, np.column_stack([t, place, turn]), fmt="%.12f")
    motion = motion_from_tum(path)
    assert motion.position(t - t[0]) == pytest.approx(place, abs=1e-9)
    assert np.max((motion.rotation(t - t[0]).inv() * Rotation.from_quat(turn)).magnitude()) < 1e-6
    between = (t[1:] + t[:-1]) / 2
    truth = np.column_stack([np.cos(between), 0 * between + 0.2, -0.1 * np.sin(between)])
    assert np.abs(motion.velocity(between - t[0]) - truth)[3:-3].max() < 0.02


def test_tum_of_a_body_carries_the_sensor(tmp_path):
    motion = motion_from_tum(tum(tmp_path, GOOD), Mounting.of((0.2, 0, 0), (0, 0, 90)))
    assert motion.position(np.array([0.0])) == pytest.approx(np.array([[0.2, 0, 1]]))
    assert motion.rotation(np.array([0.0])).apply([1.0, 0, 0]) == pytest.approx(np.array([[0, 1, 0]]))


def test_long_tum_is_read_in_a_moment(tmp_path):
    """Eight minutes at 200 Hz."""
    t = np.arange(100_000) / 200
    zero = 0 * t
    path = tmp_path / "long.tum"
    np.savetxt(path, np.column_stack([t, np.sin(t), np.cos(t), zero, zero, zero, zero, zero + 1]), fmt="%.6f")
    start = time.process_time()
    motion = motion_from_tum(path)
    assert time.process_time() - start < 5
    assert motion.duration == pytest.approx(t[-1])
