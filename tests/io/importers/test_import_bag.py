"""ROS bags in the published layout, written from a recording whose truth is known in closed form."""

import sqlite3
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin

from radarize.io.errors import InputError
from radarize.io.importers import Given, import_recording
from radarize.io.importers.bag import open_bag
from radarize.io.importers.companions import depth_picture
from radarize.io.recording import Recording, RecordingWriter, Stream
from radarize.io.tum import planar, planar_poses, read_tum
from radarize.odometry.inertial import Imu
from radarize.pipeline.run import run
from radarize.radar.config import RadarConfig
from radarize.radar.presets import PRESETS
from radarize.signal.points import PointClouds
from tests.echoes import record
from tests.io.importers.ros import EPOCH, RADAR, BagWriter, write_published
from tests.rooms import antenna_gain, furnished_room, walk

CONFIG = PRESETS["radarize"]
DURATION = 2.0


@pytest.fixture(scope="module")
def motion():
    return walk(np.random.default_rng(4), DURATION + 1)


def poses(motion, times: np.ndarray) -> np.ndarray:
    position, yaw = motion(times)
    found = planar_poses(np.column_stack([position[..., :2], yaw]))
    found[:, 2] = position[:, 2]
    return found


@pytest.fixture(scope="module")
def original(motion, tmp_path_factory) -> Path:
    """A walk of 2 s through a room of point scatterers, with tracked poses, IMU, depth and point clouds."""
    rng = np.random.default_rng(5)
    points, amplitudes = furnished_room(rng, density=3.0)
    stamps = CONFIG.frame_period * np.arange(round(DURATION / CONFIG.frame_period))
    adc = record(CONFIG, motion, points, amplitudes, stamps, rng, noise=20.0, block=32, gain=antenna_gain)
    ticks = np.arange(0.001, DURATION, 0.005)  # none at a frame's very start
    clouds, frame = PointClouds(CONFIG)(adc)
    streams = {
        "truth/time": Stream((), "f8", "s", ""),
        "truth/pose": Stream((7,), "f8", "m", ""),
        "truth/depth": Stream((100, 848), "u2", "mm", ""),
        **{f"{name}/time": Stream((), "f8", "s", "", f"{name}/time") for name in ("tracking", "imu")},
        "tracking/pose": Stream((7,), "f8", "m", "", "tracking/time"),
        "imu/accelerometer": Stream((3,), "f4", "m/s^2", "", "imu/time"),
        "imu/gyroscope": Stream((3,), "f4", "rad/s", "", "imu/time"),
        "points/frame": Stream((), "i4", "", "", "points/frame"),
        "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
    }
    path = tmp_path_factory.mktemp("original") / "walk.h5"
    middle = stamps + CONFIG.burst_center
    with RecordingWriter(path, CONFIG, streams=streams) as writer:
        rows = {
            "truth/time": middle,
            "truth/pose": poses(motion, middle),
            "truth/depth": np.arange(len(stamps) * 84800).reshape(-1, 100, 848).astype(np.uint16),
            "tracking/time": ticks,
            "tracking/pose": poses(motion, ticks),
            "imu/time": ticks,
            "imu/accelerometer": rng.normal(size=(len(ticks), 3)),
            "imu/gyroscope": rng.normal(size=(len(ticks), 3)),
            "points/frame": frame,
            "points/cloud": clouds,
        }
        writer.append(adc, stamps, rows=rows)
    return path


@pytest.fixture(scope="module", params=["ros1", "ros2 sqlite3", "ros2 mcap"])
def bag(request, original, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("bag")
    if request.param == "ros1":
        return write_published(folder / "cart_sc_1_0.bag", original)
    storage = StoragePlugin.MCAP if "mcap" in request.param else StoragePlugin.SQLITE3
    return write_published(folder / "cart", original, 2, storage)


@pytest.fixture(scope="module")
def imported(bag) -> Path:
    return import_recording(bag, bag.with_suffix(".h5"))


def test_samples_and_stamps_are_the_same(original, imported):
    with Recording(original) as a, Recording(imported) as b:
        assert np.array_equal(a.adc(0, len(a)), b.adc(0, len(b))) and len(a) == len(b)
        assert b.times - EPOCH == pytest.approx(a.times, abs=1e-6)
        assert b.valid(0, len(b)).all()
        assert b.config == a.config
        assert b.attributes["warnings"] == ""
        assert b.attributes["assumed"] == "configuration: preset radarize, iq_order, latency, imu/mount"


def test_other_sensors_come_along(original, imported):
    with Recording(original) as a, Recording(imported) as b:
        for name in ("imu/accelerometer", "imu/gyroscope", "truth/depth", "points/frame"):
            assert np.array_equal(a.read(name), b.read(name))
        assert b.read("imu/time") - EPOCH == pytest.approx(a.read("imu/time"), abs=1e-6)
        assert np.array_equal(a.read("points/cloud")[:, :5], b.read("points/cloud")[:, :5])
        assert np.isnan(b.read("points/cloud")[:, 5]).all()  # their noise level is not published
        assert b.read("truth/depth_intrinsics") == pytest.approx([423.993, 423.993, 432.966, 50.938])
        for k in (0, 40, len(a) - 1):
            assert len(a.rows("points/cloud", k, k + 1)) == len(b.rows("points/cloud", k, k + 1))


def test_tracked_poses_are_brought_to_the_frames(original, imported, motion):
    with Recording(original) as a, Recording(imported) as b:
        times, pose, velocity = (b.read(f"truth/{name}") for name in ("time", "pose", "velocity"))
        middle = a.times + CONFIG.burst_center
    assert times - EPOCH == pytest.approx(middle, abs=1e-6)
    assert planar(pose) == pytest.approx(planar(poses(motion, middle)), abs=1e-4)
    step = 1e-4
    (before, yaw_before), (after, yaw_after) = motion(middle - step), motion(middle + step)
    vx, vy, _ = ((after - before) / (2 * step)).T
    yaw = motion(middle)[1]
    truth = np.column_stack([np.cos(yaw) * vx + np.sin(yaw) * vy, np.cos(yaw) * vy - np.sin(yaw) * vx])
    assert velocity[1:-1, :2] == pytest.approx(truth[1:-1], abs=0.005)
    assert velocity[:, :2] == pytest.approx(truth, abs=0.05)  # one-sided at the ends
    assert velocity[1:-1, 5] == pytest.approx((yaw_after - yaw_before)[1:-1] / (2 * step), abs=0.02)


def test_the_same_trajectory_comes_out(original, bag, imported, tmp_path):
    if bag.is_dir():
        pytest.skip("the samples are the same, as another test checks: one bag is sufficient")
    found = []
    for path in (original, imported):
        out = run(path, tmp_path / path.stem, odometry="doppler", scans="first-echo").path
        times, pose = read_tum(out / "trajectory.tum")
        found.append((times - times[0], planar(pose)))
    assert found[0][0] == pytest.approx(found[1][0], abs=1e-6)
    assert found[0][1] == pytest.approx(found[1][1], abs=1e-3)
    assert np.ptp(found[0][1][:, :2], axis=0).max() > 0.4
    assert (tmp_path / imported.stem / "reference.tum").is_file()


# --- made up frame by frame -------------------------------------------------------------------------------------------
SMALL = RadarConfig(
    start_frequency=77e9, slope=60e12, idle_time=20e-6, adc_start_time=5e-6, ramp_end_time=60e-6, samples=32,
    sample_rate=5e6, loops=4, frame_period=50e-3, tx_order=(0, 2, 1),
)  # fmt: skip


def noise(config: RadarConfig, count: int) -> np.ndarray:
    return np.random.default_rng(0).integers(-2000, 2000, (count, *config.frame_shape), np.int16)


def write(path: Path, config: RadarConfig, times, **more) -> Path:
    with BagWriter(path, 1) as bag:
        for time, frame in zip(times, noise(config, len(times)), strict=True):
            bag.frame(time, frame, config, **more)
    return path


def test_calibration_and_sizes_come_from_the_frames(tmp_path):
    """The virtual antenna of TX2 and RX3 gets its own factor in any firing order."""
    factors = np.random.default_rng(1).normal(size=(12, 2)).astype(np.float32).round(3)
    config = SMALL.model_copy(update={"range_bias": 0.07})
    write(tmp_path / "a.bag", config, 0.05 * np.arange(3), calibration=factors)
    given = {"tx": (0, 2, 1), "slope": 60e12, "iq_order": "qqii", "frame_period": 0.05}
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(overrides=given))) as recording:
        assert recording.config.frame_shape == SMALL.frame_shape
        assert recording.config.range_bias == pytest.approx(0.07)
        assert np.asarray(recording.config.channel_calibration) == pytest.approx(factors, abs=1e-6)
        assert np.array_equal(recording.adc(0, 3), noise(SMALL, 3))
        assert {"start_frequency", "idle_time"} <= set(recording.attributes["assumed"].split(", "))


def test_bags_without_definitions_are_read(tmp_path):
    """In bags of ROS 2 Humble and before, the frame's message is that of xwr_raw_ros."""
    config = SMALL.model_copy(update={"range_bias": 0.0625})
    with BagWriter(tmp_path / "a", 2, published=True) as bag:
        for k, frame in enumerate(noise(config, 3)):
            bag.frame(0.05 * k, frame, config)
    (path,) = (tmp_path / "a").glob("*.db3")
    with sqlite3.connect(path) as base:
        base.execute("drop table message_definitions")
        base.execute("update schema set schema_version = 3")
    meta = tmp_path / "a" / "metadata.yaml"
    meta.write_text(meta.read_text().replace("version: 8", "version: 5"))
    given = Given(config=SMALL.model_copy(update={"channel_calibration": None}))
    with Recording(import_recording(tmp_path / "a", tmp_path / "a.h5", given)) as recording:
        assert np.array_equal(recording.adc(0, 3), noise(SMALL, 3)) and recording.config.range_bias == 0.0625


def test_stamps_are_the_receipt_less_the_latency_or_the_headers(tmp_path):
    """Received 30 ms after their start. Without a given latency, the burst duration, 1 ms, is used."""
    times = 0.05 * np.arange(3)
    write(tmp_path / "a.bag", SMALL, times, latency=0.03)
    with BagWriter(tmp_path / "b.bag", 1) as bag:
        for time, frame in zip(times, noise(SMALL, 3), strict=True):
            bag.frame(time, frame, SMALL, latency=0.03, stamp=time + 0.001)
    assert SMALL.burst_time == pytest.approx(0.96e-3)
    for name, latency, late, assumed in (
        ("a.bag", None, 0.03 - 0.96e-3, "latency"),
        ("a.bag", 0.03, 0, ""),
        ("a.bag", 0.0, 0.03, ""),
        ("b.bag", None, 0.001, ""),
        ("b.bag", 0.03, 0, ""),
    ):
        out = import_recording(tmp_path / name, tmp_path / "a.h5", Given(config=SMALL, latency=latency))
        with Recording(out) as recording:
            assert recording.times - EPOCH == pytest.approx(times + late, abs=1e-6), (name, latency)
            assert recording.attributes["assumed"] == assumed
            assert ("headers" in recording.attributes["stamps"]) == (name == "b.bag" and latency is None)


def test_frames_that_a_computer_held_up_are_moved_to_the_radars_period(tmp_path):
    """Receipts are delayed by 4 ms on average, once by 0.4 s; clocks differ by 80 ppm; three frames are missing."""
    rng = np.random.default_rng(3)
    starts = SMALL.frame_period * (1 + 80e-6) * np.delete(np.arange(600), [100, 101, 300])
    received = starts + SMALL.burst_time + rng.exponential(4e-3, len(starts))
    received[200:208] = received[208] - 1e-3 * np.arange(8, 0, -1)
    assert (np.diff(received) > 0).all()
    with BagWriter(tmp_path / "a.bag", 1) as bag:
        for time, frame, at in zip(starts, noise(SMALL, len(starts)), received, strict=True):
            bag.frame(time, frame, SMALL, latency=at - time)
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        assert recording.times - EPOCH == pytest.approx(starts, abs=1.5e-3)
        assert np.std(recording.times - starts) < 0.2e-3
        assert "3 frames are missing" in recording.attributes["warnings"]
        assert "by 2.92 ms in the median and 393.18 ms at most" in recording.attributes["stamps"]


@pytest.mark.parametrize("jump", [0.2, 1.0, 3600.0])
def test_a_header_ahead_of_its_receipt_is_not_believed(tmp_path, jump):
    """The other headers are kept, also when they advance by half a second after a pause."""
    times = SMALL.frame_period * np.arange(60)
    times[40:] += 0.5
    stamps = times.copy()
    stamps[[20, 30, 31]] += jump
    with BagWriter(tmp_path / "a.bag", 1) as bag:
        for k, (time, frame) in enumerate(zip(times, noise(SMALL, 60), strict=True)):
            bag.frame(time, frame, SMALL, latency=0.02 + (0.025 if k == 10 else 0.001 * (k % 3)), stamp=stamps[k])
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        assert len(recording) == 60 and np.array_equal(recording.adc(0, 99), noise(SMALL, 60))
        assert recording.times - EPOCH == pytest.approx(times, abs=1e-6)
        assert "3 frames have a header ahead of their receipt" in recording.attributes["warnings"]


def test_missing_frames_leave_a_gap_and_repeated_ones_are_dropped(tmp_path):
    times = np.array([0, 1, 2, 5, 5, 6]) * 0.05
    write(tmp_path / "a.bag", SMALL, times)
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        assert recording.times - EPOCH == pytest.approx(np.unique(times), abs=1e-6)
        assert "2 frames are missing" in recording.attributes["warnings"]
        assert "1 frames are repeated" in recording.attributes["warnings"]


def test_an_imu_is_read_on_the_radars_axes(tmp_path):
    """The IMU of a tracking camera has an optical frame. If neither the frame's name nor the user states this, it is
    not on the radar's axes, since gravity is along another one."""
    force, turn = np.array([0.3, -0.2, 9.8]), np.array([0.1, 0.2, 0.5])
    optical = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # x right, y down, z ahead
    named, given = Given(config=SMALL), Given(config=SMALL, imu_turn=(-90.0, 0.0, -90.0))
    for frame, options, known in (
        ("tracking_imu_optical_frame", named, True),
        ("imu", given, True),
        ("imu", named, False),
    ):
        with BagWriter(tmp_path / "a.bag", 1) as bag:
            for k, each in enumerate(noise(SMALL, 20)):
                bag.frame(0.05 * k, each, SMALL)
                for tick in 0.05 * k + 0.005 * np.arange(10):
                    bag.imu(tick, optical @ force, optical @ turn, frame)
        (tmp_path / "a.h5").unlink(missing_ok=True)
        with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", options)) as recording:
            assert ("imu/mount" in recording.attributes["assumed"]) == (not known)
            if known:
                found = Imu.of(recording).samples
                assert found == pytest.approx(np.tile([*force, *turn], (len(found), 1)), abs=1e-5)
            else:
                with pytest.raises(InputError, match=r"no /imu/mount, and mean specific force is \[0.2, -9.8, 0.3\]"):
                    Imu.of(recording)
        (tmp_path / "a.bag").unlink()
    with pytest.raises(InputError, match="is no ROS bag, but imu_turn is"):
        (tmp_path / "a.bin").write_bytes(bytes(9))
        import_recording(tmp_path / "a.bin", tmp_path / "b.h5", given)


def test_poses_are_unknown_where_tracking_was_lost(tmp_path):
    with BagWriter(tmp_path / "a.bag", 1) as bag:
        for k, frame in enumerate(noise(SMALL, 60)):
            bag.frame(0.05 * k, frame, SMALL)
            for tick in 0.05 * k + 0.01 * np.arange(5):
                if not 1 < tick < 2:
                    bag.odometry(tick, np.array([tick, 0, 0, 0, 0, 0, 1.0]), tick)
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        pose, times = recording.read("truth/pose"), recording.read("truth/time") - EPOCH
    lost = (times > 1.0) & (times < 2.0)
    assert np.isnan(pose[lost]).all() and np.isfinite(pose[~lost & (times < 2.9)]).all()
    assert pose[~lost & (times < 2.9), 0] == pytest.approx(times[~lost & (times < 2.9)], abs=1e-4)


def test_a_silent_radar_does_not_keep_the_others_waiting(tmp_path):
    """After ten seconds without frames, earlier messages are dropped, and the next frames still get their poses."""
    with BagWriter(tmp_path / "a.bag", 1) as bag:
        frames = noise(SMALL, 20)
        for k in range(1200):
            tick = 0.01 * k
            if k % 5 == 0 and not 0.5 <= tick < 11.5:
                bag.frame(tick, frames[k // 5 % 20], SMALL)
            bag.odometry(tick, np.array([tick, 0, 0, 0, 0, 0, 1.0]), tick)
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        pose, times = recording.read("truth/pose"), recording.read("truth/time") - EPOCH
        assert len(recording) == 20 and "220 frames are missing" in recording.attributes["warnings"]
    assert pose[:-1, 0] == pytest.approx(times[:-1], abs=1e-4)


def test_damaged_depth_pictures_are_counted(tmp_path):
    with BagWriter(tmp_path / "a.bag", 1) as bag:
        for k, frame in enumerate(noise(SMALL, 4)):
            bag.frame(0.05 * k, frame, SMALL)
            bag.depth(0.05 * k, np.full((2, 3), k + 1, np.uint16) if k != 2 else np.full((5, 5), 9, np.uint16))
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        assert recording.read("truth/depth")[:, 0, 0].tolist() == [1, 2, 0, 4]
        assert "compressedDepth: 1 messages could not be used" in recording.attributes["warnings"]
        assert not recording.has("truth/depth_intrinsics")


def test_memory_does_not_grow_with_the_bag(tmp_path, monkeypatch):
    """Four times as many messages need at most a quarter more memory."""
    monkeypatch.setattr("radarize.io.importers.capture.BATCH_BYTES", 16 * SMALL.frame_bytes)
    peaks = []
    for seconds in (10, 40):
        path = tmp_path / f"{seconds}.bag"
        with BagWriter(path, 1) as bag:
            frames = noise(SMALL, 20)
            for k in range(100 * seconds):
                if k % 5 == 0:
                    bag.frame(0.01 * k, frames[k // 5 % 20], SMALL)
                bag.imu(0.01 * k, np.zeros(3), np.zeros(3))
        capture = open_bag(path, Given(config=SMALL))
        tracemalloc.start()
        count = sum(len(batch.times) for batch in capture.batches)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert count == 20 * seconds
    assert peaks[1] < 1.25 * peaks[0]


def test_a_bag_without_raw_samples_is_refused(recordings, tmp_path):
    source = recordings / "ti-pointcloud-imu" / "demo_ti_mmwave_rospkg_format.bag"
    with pytest.raises(InputError, match=r"no raw radar frames.*/ti_mmwave/radar_scan_pcl \(sensor_msgs"):
        import_recording(source, tmp_path / "a.h5")
    assert not list(tmp_path.iterdir())


def test_point_clouds_of_a_real_bag(recordings):
    """Clouds of TI's ROS driver are in front of the radar, and close when the sensor moves forward."""
    from radarize.io.importers.companions import cloud_columns
    from radarize.io.importers.rosbag import Bag

    with Bag(recordings / "ti-pointcloud-imu" / "demo_ti_mmwave_rospkg_format.bag") as bag:
        assert bag.topics["/sensor_platform/imu"] == ("sensor_msgs/msg/Imu", 8270)
        clouds = [cloud_columns(message) for _, _, message in bag.messages(["/ti_mmwave/radar_scan_pcl"])]
    assert len(clouds) == 412
    points = np.concatenate(clouds)
    assert (points[:, 0] > 0).mean() > 0.99 and np.ptp(points[:, 1]) > 1
    assert np.isfinite(points[:, :4]).all()


def test_refusals(tmp_path):
    write(tmp_path / "a.bag", SMALL, [0.0, 0.05])
    content = (tmp_path / "a.bag").read_bytes()
    cases = {
        "text.bag": b"hello\n",
        "empty.bag": b"",
        "cut.bag": content[: len(content) // 2],
        "noise.mcap": bytes(200),
        "noise.db3": bytes(200),
    }
    for name, data in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=f"{name}: is no readable ROS bag"):
            import_recording(tmp_path / name, tmp_path / "out.h5", Given(config=SMALL))
    with pytest.raises(InputError, match="2 frames do not have the 73728 words"):
        import_recording(tmp_path / "a.bag", tmp_path / "out.h5", Given(config=CONFIG))
    with pytest.raises(InputError, match="stamps of its own, but start_time is 5"):
        import_recording(tmp_path / "a.bag", tmp_path / "out.h5", Given(config=SMALL, start_time=5.0))
    with pytest.raises(InputError, match="is no array, but shape"):
        import_recording(tmp_path / "a.bag", tmp_path / "out.h5", Given(config=SMALL, shape="frame,sample"))
    assert not (tmp_path / "out.h5").exists()


def test_a_bag_that_breaks_off_inside_says_so(tmp_path):
    write(tmp_path / "a.bag", SMALL, 0.05 * np.arange(100))
    data = bytearray((tmp_path / "a.bag").read_bytes())
    at = data.index(b"conn=", 30_000)
    data[at - 4 : at] = b"\xff\xff\xff\x7f"
    (tmp_path / "b.bag").write_bytes(data)
    with pytest.raises(InputError, match="b.bag: is no readable ROS bag"):
        import_recording(tmp_path / "b.bag", tmp_path / "out.h5", Given(config=SMALL))


LAST = "where timestamp = (select max(timestamp) from messages)"


@pytest.mark.parametrize(
    ("change", "value", "message"),
    [
        (f"messages set timestamp = ? {LAST}", "noon", "/radar0/radar_data has no number for its time, 'noon'"),
        (f"messages set timestamp = ? {LAST}", b"noon", "/radar0/radar_data has no number for its time, b'noon'"),
        (f"messages set timestamp = ? {LAST}", 0.5, "/radar0/radar_data has no number for its time, 0.5"),
        (f"messages set data = ? {LAST}", "noon", ""),
        ("topics set name = ?", b"radar", "a topic is named b'radar', expected text"),
        ("topics set type = ?", b"type", ""),
    ],
)
def test_values_of_any_type_are_refused(tmp_path, change, value, message):
    """SQLite accepts values of any type in any column."""
    with BagWriter(tmp_path / "a", 2) as bag:
        for k, frame in enumerate(noise(SMALL, 3)):
            bag.frame(0.05 * k, frame, SMALL)
    (path,) = (tmp_path / "a").glob("*.db3")
    with sqlite3.connect(path) as base:
        base.execute(f"update {change}", [value])
    with pytest.raises(InputError, match=f"a.db3: .*{message}"):
        import_recording(path, tmp_path / "out.h5", Given(config=SMALL))
    assert not (tmp_path / "out.h5").exists()


def test_depth_encodings():
    class Message:
        def __init__(self, **fields):
            self.__dict__.update(fields)

    metres = np.array([[0.5, np.nan, 3.25]], np.float32)
    plain = Message(
        encoding="32FC1", is_bigendian=0, height=1, width=3, step=12, data=metres.view(np.uint8).reshape(-1)
    )
    assert depth_picture(plain).tolist() == [[500, 0, 3250]]
    big = Message(
        encoding="16UC1", is_bigendian=1, height=1, width=2, step=6, data=np.array([1, 2, 3, 4, 9, 9], np.uint8)
    )
    assert depth_picture(big).tolist() == [[258, 772]]
    with pytest.raises(InputError, match="encoding 'rgb8'"):
        depth_picture(Message(encoding="rgb8", is_bigendian=0, height=1, width=1, step=3, data=np.zeros(3, np.uint8)))
    with pytest.raises(InputError, match="no readable PNG"):
        depth_picture(Message(format="16UC1; compressedDepth", data=np.zeros(20, np.uint8)))


def test_frames_named_once_are_enough(tmp_path):
    """The radar's topic may have any name."""
    write(tmp_path / "a.bag", SMALL, [0.0, 0.05])
    data = (tmp_path / "a.bag").read_bytes().replace(RADAR.encode(), b"/other7/radar_data")
    (tmp_path / "a.bag").write_bytes(data)
    with Recording(import_recording(tmp_path / "a.bag", tmp_path / "a.h5", Given(config=SMALL))) as recording:
        assert recording.attributes["topics"] == "/other7/radar_data"
