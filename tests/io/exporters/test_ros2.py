"""ROS 2 bags of a recording and its run, read back directly by the `rosbags` library."""

import io
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.importers.companions import depth_picture
from radarize.io.pose import compose, exponential
from radarize.io.recording import Product, Recording, RecordingWriter, Stream
from radarize.io.tum import planar, planar_poses, write_tum
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.log import run as slam
from radarize.pipeline.runfolder import OccupancyMap
from radarize.radar.presets import PRESETS
from radarize.signal.bearings import BEARINGS
from radarize.signal.heatmaps import Heatmaps
from radarize.slam.config import SlamConfig

CONFIG = PRESETS["radarize"].model_copy(update={"loops": 4})
COUNT = 25
STAMPS = 1_700_000_000 + CONFIG.frame_period * np.arange(COUNT)
MIDDLE = STAMPS + CONFIG.burst_center
STEP = exponential(np.array([0.03, 0.01]), 0.02)
RANGES = 2 + np.sin(BEARINGS * 3) * np.ones((COUNT, 1))


def poses() -> np.ndarray:
    found = [np.zeros(3)]
    for _ in range(COUNT - 1):
        found.append(compose(found[-1], STEP))
    return np.array(found)


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    rng = np.random.default_rng(0)
    streams = {
        "truth/time": Stream((), "f8", "s", ""),
        "truth/pose": Stream((7,), "f8", "m", ""),
        "truth/depth": Stream((6, 8), "u2", "mm", ""),
        "imu/time": Stream((), "f8", "s", "", "imu/time"),
        "imu/accelerometer": Stream((3,), "f4", "m/s^2", "", "imu/time"),
        "imu/gyroscope": Stream((3,), "f4", "rad/s", "", "imu/time"),
        "points/frame": Stream((), "i4", "", "", "points/frame"),
        "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
    }
    mount = np.array([0.01, 0.02, 0.06, 0, 0, 0, 1])
    products = {
        "truth/depth_intrinsics": Product(np.array([5.0, 6.0, 3.5, 2.5]), "", ""),
        "truth/depth_mount": Product(mount, "", ""),
        "imu/mount": Product(mount, "", ""),
    }
    truth = planar_poses(poses())
    truth[3] = np.nan  # a moment without tracking
    ticks = STAMPS[0] + np.arange(0, COUNT * CONFIG.frame_period, 0.01)
    path = tmp_path_factory.mktemp("recording") / "walk.h5"
    with RecordingWriter(path, CONFIG, streams=streams, products=products) as writer:
        rows = {
            "truth/time": MIDDLE,
            "truth/pose": truth,
            "truth/depth": rng.integers(0, 9000, (COUNT, 6, 8), np.uint16),
            "imu/time": ticks,
            "imu/accelerometer": rng.normal(size=(len(ticks), 3)),
            "imu/gyroscope": rng.normal(size=(len(ticks), 3)),
            "points/frame": np.array([0, 0, 2]),
            "points/cloud": rng.normal(size=(3, 6)),
        }
        writer.append(rng.integers(-900, 900, (COUNT, *CONFIG.frame_shape), np.int16), STAMPS, rows=rows)
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """A run folder made by the SLAM back end from scans and odometry, with the files of `radarize run`."""
    folder = tmp_path_factory.mktemp("run")
    given = {
        "ranges": RANGES,
        "angle_min": BEARINGS[0],
        "angle_increment": np.radians(1),
        "range_max": 4,
        "times": MIDDLE,
    }
    np.savez(folder / "scans.npz", **given)
    write_tum(folder / "odometry.tum", MIDDLE, planar_poses(poses()))
    return slam(folder / "scans.npz", folder / "odometry.tum", folder / "run", config=SlamConfig.preset("radar"))


def read(folder: Path) -> dict[str, list[tuple[float, object]]]:
    """Return messages by topic, with their times of receipt."""
    found: dict[str, list] = {}
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((1e-9 * time, message))
    return found


@pytest.fixture(scope="module")
def bag(recording, run, tmp_path_factory) -> dict:
    steps = []
    folder = tmp_path_factory.mktemp("bag") / "walk"
    assert export(recording, "ros2", folder, run=run, progress=lambda *where: steps.append(where)) == folder
    assert steps == [(k + 1, COUNT) for k in range(COUNT)]
    assert [path.name for path in folder.parent.iterdir()] == ["walk"]
    assert sorted(path.name for path in folder.iterdir()) == ["metadata.yaml", "walk.db3"]
    return read(folder)


def stamp(message) -> float:
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def test_topics(bag):
    assert {topic: len(found) for topic, found in bag.items()} == {
        "/scan": COUNT, "/odom": COUNT, "/tf": 2 * COUNT - 1, "/tf_static": 1, "/radar/heatmap": COUNT,
        "/radar/points": COUNT, "/imu": 84, "/camera/depth/image_rect_raw": COUNT, "/camera/depth/camera_info": COUNT,
        "/truth/odom": COUNT - 1,
    }  # fmt: skip
    for topic, found in bag.items():
        if topic not in ("/tf", "/tf_static"):
            assert [stamp(message) for _, message in found] == pytest.approx([time for time, _ in found], abs=1e-6)


def test_scans(bag):
    for (time, scan), middle in zip(bag["/scan"], MIDDLE, strict=True):
        assert time == pytest.approx(middle, abs=1e-6) and scan.header.frame_id == "radar"
        assert scan.ranges == pytest.approx(RANGES[0], abs=1e-5)
        assert len(scan.ranges) == 1 + round((scan.angle_max - scan.angle_min) / scan.angle_increment) == 88
        assert scan.angle_min == pytest.approx(np.radians(-44)) and scan.range_max == pytest.approx(CONFIG.max_range)


def test_odometry_and_its_transform(bag):
    links = [tf for _, tf in bag["/tf"] if tf.transforms[0].child_frame_id == "base_link"]
    for (_, odometry), tf, expected in zip(bag["/odom"], links, poses(), strict=True):
        place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        found = planar(np.array([[place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]]))[0]
        assert found == pytest.approx(expected, abs=1e-8)
        (transform,) = tf.transforms
        moved, turned = transform.transform.translation, transform.transform.rotation
        assert (moved.x, moved.y, turned.z, turned.w) == (place.x, place.y, turn.z, turn.w)
        assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    twist = bag["/odom"][-1][1].twist.twist
    assert np.array([twist.linear.x, twist.linear.y, twist.angular.z]) * CONFIG.frame_period == pytest.approx(
        STEP, abs=1e-5
    )


def test_covariance_adds_up_as_in_a_simulation():
    """Many walks with errors of the given covariance: the scatter of positions is that in the bag."""
    from radarize.io.exporters.ros2 import _odometry
    from radarize.pipeline.log import Log

    rng, error = np.random.default_rng(1), np.diag([0.01, 0.02, 0.01]) ** 2
    errors = ErrorModel.independent(np.tile(error, (COUNT, 1, 1)))
    log = Log(MIDDLE, BEARINGS, RANGES, MIDDLE, poses(), errors)
    *_, last = [message for _, topic, message in _odometry(log) if topic == "/odom"]
    covariance = last.pose.covariance.reshape(6, 6)
    walks = np.zeros((20_000, 3))
    for _ in range(COUNT - 1):
        walks = compose(compose(walks, STEP), rng.multivariate_normal(np.zeros(3), error, len(walks)))
    assert covariance[np.ix_([0, 1, 5], [0, 1, 5])] == pytest.approx(np.cov(walks.T), rel=0.1, abs=2e-4)


def test_covariance_of_the_velocity_is_that_of_a_step():
    from radarize.io.exporters.ros2 import _odometry
    from radarize.pipeline.log import Log

    error = np.diag([0.01, 0.02, 0.03]) ** 2
    log = Log(MIDDLE, BEARINGS, RANGES, MIDDLE, poses(), ErrorModel.independent(np.tile(error, (COUNT, 1, 1))))
    twists = [message.twist for _, topic, message in _odometry(log) if topic == "/odom"]
    for twist in (twists[0], twists[7]):
        covariance = twist.covariance.reshape(6, 6)[np.ix_([0, 1, 5], [0, 1, 5])]
        assert covariance == pytest.approx(error / CONFIG.frame_period**2, rel=0.02, abs=1e-4)
        assert twist.twist.linear.x == pytest.approx(STEP[0] / CONFIG.frame_period, abs=1e-4)


def place(links, frame, root) -> np.ndarray:
    """Return the pose of a frame in another as a matrix, from the chain of transforms between them."""
    found = np.eye(4)
    while frame != root:
        parent, t = links[frame]
        step = np.eye(4)
        q = t.rotation
        step[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        step[:3, 3] = t.translation.x, t.translation.y, t.translation.z
        found, frame = step @ found, parent
    return found


def test_the_truth_hangs_in_one_tree_with_the_odometry(bag, recording, tmp_path):
    """With a run, truth and odometry start at the same pose and drift apart; without one, base_link is at the truth."""
    links = {t.child_frame_id: (t.header.frame_id, t.transform) for t in bag["/tf_static"][0][1].transforms}
    expected = planar_poses(poses())
    for _, tf in bag["/tf"]:
        links |= {t.child_frame_id: (t.header.frame_id, t.transform) for t in tf.transforms}
        if "truth" in links:
            assert np.linalg.norm(place(links, "truth", "odom")[:2, 3]) <= np.linalg.norm(expected[-1, :2]) + 0.1
    assert place(links, "truth", "odom") == pytest.approx(place(links, "base_link", "odom"), abs=1e-6)
    alone = read(export(recording, "ros2", tmp_path / "alone"))
    links = {t.child_frame_id: (t.header.frame_id, t.transform) for t in alone["/tf"][5][1].transforms}
    assert links["world"][0] == "base_link" and place(links, "truth", "base_link") == pytest.approx(np.eye(4), abs=1e-9)


def test_stamps_near_zero_are_moved(recording, tmp_path):
    """A simulated walk begins at 0 s, which ROS treats as unset, so it is shifted; stamps of a real one are kept."""
    with Recording(recording) as source, RecordingWriter(tmp_path / "a.h5", CONFIG) as writer:
        writer.append(source.adc(0, 3), STAMPS[:3] - STAMPS[0])
    for later, given in ((1.7e9, None), (0.0, 0.0), (5.0, 5.0)):
        found = read(export(tmp_path / "a.h5", "ros2", tmp_path / f"bag{later}", time_offset=given))
        for k, (time, cloud) in enumerate(found["/radar/heatmap"]):
            assert time == pytest.approx(later + k * CONFIG.frame_period + CONFIG.burst_center, abs=1e-6)
            assert stamp(cloud) == pytest.approx(time, abs=1e-6)
        assert found["/tf_static"][0][1].transforms[0].header.stamp.sec == int(later)


def test_stamps_of_all_topics_are_moved_once(bag, recording, run, tmp_path):
    found = read(export(recording, "ros2", tmp_path / "moved", run=run, time_offset=7.25))
    assert found.keys() == bag.keys()
    for topic, messages in found.items():
        assert [time - 7.25 for time, _ in messages] == pytest.approx([time for time, _ in bag[topic]], abs=1e-6)
        for time, message in messages:
            for each in getattr(message, "transforms", [message]):
                assert stamp(each) == pytest.approx(time, abs=1e-6)


def test_heat_map_is_the_pipelines(bag, recording):
    maps = Heatmaps(CONFIG)
    with Recording(recording) as source:
        power = maps.range_azimuth(source.adc(7, 8)).numpy()[0]
    _, cloud = bag["/radar/heatmap"][7]
    table = cloud.data.view("<f4").reshape(cloud.height, cloud.width, 4)
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "intensity"]
    assert table[..., 3] == pytest.approx(10 * np.log10(power), abs=0.01)
    assert np.hypot(table[..., 0], table[..., 1])[:, 3] == pytest.approx(maps.ranges, abs=1e-4)
    assert np.arctan2(table[5:, :, 1], table[5:, :, 0])[0] == pytest.approx(maps.azimuths, abs=1e-4)  # left is +y


def test_other_sensors(bag, recording):
    with Recording(recording) as source:
        for k, (_, picture) in enumerate(bag["/camera/depth/image_rect_raw"]):
            assert np.array_equal(depth_picture(picture), source.rows("truth/depth", k, k + 1)[0])
        forces = np.array([[m.linear_acceleration.x, m.angular_velocity.z] for _, m in bag["/imu"]])
        force, turn = source.read("imu/accelerometer"), source.read("imu/gyroscope")
        assert forces == pytest.approx(np.column_stack([force[:, 0], turn[:, 2]]))
        clouds = [m.data.view("<f4").reshape(-1, 6) for _, m in bag["/radar/points"]]
        assert [len(cloud) for cloud in clouds[:4]] == [2, 0, 1, 0]
        assert np.concatenate(clouds) == pytest.approx(source.read("points/cloud"))
    _, info = bag["/camera/depth/camera_info"][0]
    assert info.k.reshape(3, 3).tolist() == [[5, 0, 3.5], [0, 6, 2.5], [0, 0, 1]]


def test_places_of_sensors(bag):
    """The camera's forward axis (z) is the radar's x, its right axis (x) the radar's -y."""
    found = {t.child_frame_id: (t.header.frame_id, t.transform) for t in bag["/tf_static"][0][1].transforms}
    assert {child: parent for child, (parent, _) in found.items()} == {
        "radar": "base_link", "imu": "base_link", "camera_depth_frame": "base_link",
        "camera_depth_optical_frame": "camera_depth_frame", "world": "odom",
    }  # fmt: skip
    assert found["camera_depth_frame"][1].translation.z == pytest.approx(0.06)
    q = found["camera_depth_optical_frame"][1].rotation
    turn = Rotation.from_quat([q.x, q.y, q.z, q.w])
    assert turn.apply([[0, 0, 1], [1, 0, 0]]) == pytest.approx(np.array([[1, 0, 0], [0, -1, 0]]), abs=1e-9)


def test_parts_of_it(recording, run, tmp_path):
    alone = read(export(recording, "ros2", tmp_path / "recording"))
    assert "/scan" not in alone and "/radar/heatmap" in alone
    alone = read(export(run, "ros2", tmp_path / "run"))
    assert set(alone) == {"/scan", "/odom", "/tf", "/tf_static"}


def test_refusals(recording, run, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "mine").touch()
    with pytest.raises(InputError, match="already exists"):
        export(recording, "ros2", tmp_path / "there")
    with pytest.raises(InputError, match="expected a recording and a run"):
        export(run, "ros2", tmp_path / "x", run=run)
    with pytest.raises(InputError, match="expected that of ros2 only"):
        export(recording, "bin", tmp_path / "x", run=run)
    with RecordingWriter(tmp_path / "other.h5", CONFIG) as writer:
        writer.append(np.zeros((2, *CONFIG.frame_shape), np.int16), np.arange(2.0))
    with pytest.raises(InputError, match="has 25 scans .* expected the run of .*other.h5 with 2 frames"):
        export(tmp_path / "other.h5", "ros2", tmp_path / "x", run=run)
    with pytest.raises(InputError, match="trajectory.tum"):
        export(tmp_path / "there", "ros2", tmp_path / "x")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.h5", "there"]


def test_a_failure_leaves_nothing(recording, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(recording, "ros2", tmp_path / "walk", progress=stop)
    assert not list(tmp_path.iterdir())


def test_maps_and_trajectories(recording, run, tmp_path):
    written = export(run, "map", tmp_path / "floor.pgm")
    assert written.name == "floor.yaml" and yaml.safe_load(written.read_text())["image"] == "floor.pgm"
    assert np.array_equal(OccupancyMap.read(written).pixels, OccupancyMap.read(run / "map.yaml").pixels)
    export(run, "tum", tmp_path / "slam.tum")
    assert np.loadtxt(tmp_path / "slam.tum") == pytest.approx(np.loadtxt(run / "trajectory.tum"), abs=1e-8)
    export(recording, "tum", tmp_path / "truth.tum")
    assert len(np.loadtxt(io.StringIO((tmp_path / "truth.tum").read_text()))) == COUNT - 1  # one is not known
    with pytest.raises(InputError, match="has no map, expected the folder of a run"):
        export(recording, "map", tmp_path / "x")
