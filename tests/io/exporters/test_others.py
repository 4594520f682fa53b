"""Exports for radarize_ae, roverd, mmWave Studio's readers and point viewers, read back by independent code."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation
from xwr.rsp import iqiq_from_iiqq

from radarize.io.errors import InputError
from radarize.io.exporters import export
from radarize.io.importers import Given, import_recording
from radarize.io.recording import Product, Recording, RecordingWriter, Stream
from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"].model_copy(
    update={"loops": 8, "range_bias": 0.07, "channel_calibration": tuple((1.0, 0.01 * k) for k in range(12))}
)
COUNT = 7
STAMPS = CONFIG.frame_period * np.arange(COUNT)
MIDDLE = STAMPS + CONFIG.burst_center
RATE = 0.4  # rad/s


def poses(times: np.ndarray) -> np.ndarray:
    """Poses along x at 0.9 m/s and 1.2 m height, turning left."""
    turn = Rotation.from_rotvec(RATE * times[:, None] * [0, 0, 1]).as_quat()
    return np.column_stack([0.9 * times, 0 * times, 1.2 + 0 * times, turn])


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    rng = np.random.default_rng(0)
    streams = {
        "truth/time": Stream((), "f8", "s", ""),
        "truth/pose": Stream((7,), "f8", "m", ""),
        "truth/depth": Stream((100, 848), "u2", "mm", ""),
        "imu/time": Stream((), "f8", "s", "", "imu/time"),
        "imu/accelerometer": Stream((3,), "f4", "m/s^2", "", "imu/time"),
        "imu/gyroscope": Stream((3,), "f4", "rad/s", "", "imu/time"),
        "points/frame": Stream((), "i4", "", "", "points/frame"),
        "points/cloud": Stream((6,), "f4", "m", "", "points/frame"),
    }
    ticks = np.arange(0.001, COUNT * CONFIG.frame_period, 0.005)
    rows = {
        "truth/time": MIDDLE,
        "truth/pose": poses(MIDDLE),
        "truth/depth": rng.integers(0, 9000, (COUNT, 100, 848), np.uint16),
        "imu/time": ticks,
        "imu/accelerometer": rng.normal(size=(len(ticks), 3)),
        "imu/gyroscope": rng.normal(size=(len(ticks), 3)),
        "points/frame": np.array([0, 0, 4]),
        "points/cloud": np.array([[1, 2, 0.5, 0.3, 12, 1], [2, 0, 0, -0.2, 10, 1], [3, 0, 1, 0.1, 9, 1.0]]),
    }
    path = tmp_path_factory.mktemp("recording") / "walk.h5"
    valid = np.ones((COUNT, CONFIG.loops, 3), bool)
    valid[2, 1, 0] = False
    with RecordingWriter(path, CONFIG, streams=streams) as writer:
        adc = rng.integers(-900, 900, (COUNT, *CONFIG.frame_shape), np.int16)
        adc[~valid] = 0
        writer.append(adc, STAMPS, valid, rows=rows)
    return path


# --- radarize_ae ------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def bag(recording, tmp_path_factory) -> Path:
    return export(recording, "radarize-ae", tmp_path_factory.mktemp("bag") / "walk_csl_1_0.bag", time_offset=1.7e9)


def messages(path: Path) -> dict[str, list]:
    found: dict[str, list] = {}
    with AnyReader([path]) as reader:
        for connection, time, data in reader.messages():
            found.setdefault(connection.topic, []).append(
                (1e-9 * time - 1.7e9, reader.deserialize(data, connection.msgtype))
            )
    return found


def test_frames_are_those_of_xwr_raw_ros(bag, recording):
    """Fields as its RadarConfig.get_params gives them of 1843_v1.cfg; words Q Q I I of TX1, TX3, TX2."""
    found = messages(bag)["/radar0/radar_data"]
    assert [time for time, _ in found] == pytest.approx(STAMPS + CONFIG.burst_time, abs=1e-6)
    with Recording(recording) as source:
        adc = source.adc(0, COUNT)
    for frame, (_, message) in zip(adc, found, strict=True):
        assert message.header.stamp.sec == message.header.stamp.nanosec == 0
        words = message.data.reshape(CONFIG.loops, 3, 4, 48, 4)
        for k in (0, 1):
            assert np.array_equal(words[..., k], frame[:, [0, 2, 1]][..., k::2, 1])
            assert np.array_equal(words[..., 2 + k], frame[:, [0, 2, 1]][..., k::2, 0])
    _, message = found[0]
    assert (message.platform, message.adc_output_fmt) == ("xWR18xx", 1)
    assert message.shape.tolist() == [3 * CONFIG.loops, 4, 96] and message.rx.tolist() == [1] * 4
    assert message.tx.tolist() == [1] * 3 and message.range_bias == pytest.approx(0.07)
    assert message.rx_phase_bias.tolist() == pytest.approx([x for k in range(12) for x in (1, 0.01 * k)])
    expected = {
        "chirp_time": 172, "chirp_slope": 80e12, "frame_time": 33.333, "sample_rate": 2285e3, "range_max": 4.284375,
        "range_res": 4.284375 / 96, "velocity_max": 3e8 / 77e9 / (4 * 172e-6),
    }  # fmt: skip
    for name, value in expected.items():
        assert getattr(message, name) == pytest.approx(value, rel=1e-6), name


def test_other_topics_of_the_published_code(bag, recording):
    found = messages(bag)
    ticks = np.array([time for time, _ in found["/tracking/odom/sample"]])
    assert np.diff(ticks) == pytest.approx(0.005, abs=1e-6) and ticks[0] == pytest.approx(MIDDLE[0], abs=1e-6)
    for time, message in found["/tracking/odom/sample"]:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        expected = poses(np.array([time]))[0]
        assert [place.x, place.y, place.z] == pytest.approx(expected[:3], abs=1e-6)
        assert [turn.z, turn.w] == pytest.approx(expected[5:], abs=1e-6)
    with Recording(recording) as source:
        for k, (time, message) in enumerate(found["/camera/depth/image_rect_raw/compressedDepth"]):
            picture = np.asarray(Image.open(io.BytesIO(bytes(message.data)[12:])))
            assert np.array_equal(picture, source.rows("truth/depth", k, k + 1)[0])
            assert time == pytest.approx(MIDDLE[k], abs=1e-6) and message.format.startswith("16UC1; compressedDepth")
        force = np.array([m.linear_acceleration.y for _, m in found["/tracking/imu"]])
        assert force == pytest.approx(source.read("imu/accelerometer")[:, 1])
    clouds = [m.data.view("<f4").reshape(-1, 5) for _, m in found["/ti_mmwave/radar_scan_pcl_0"]]
    assert [len(cloud) for cloud in clouds] == [2, 0, 0, 0, 1, 0, 0]
    assert clouds[0][0] == pytest.approx([1, 2, 0.5, 12, -0.3])  # the firmware's velocity is positive going away


def test_the_bag_comes_back_as_the_recording(bag, recording, tmp_path):
    given = Given(config=CONFIG)
    with Recording(import_recording(bag, tmp_path / "a.h5", given)) as copy, Recording(recording) as source:
        assert np.array_equal(copy.adc(0, COUNT), source.adc(0, COUNT))
        assert copy.times == pytest.approx(1.7e9 + STAMPS, abs=1e-4)
        assert copy.read("truth/pose")[1:-1] == pytest.approx(source.read("truth/pose")[1:-1], abs=1e-4)
        assert np.array_equal(copy.read("truth/depth"), source.read("truth/depth"))
        assert copy.read("points/cloud")[:, :5] == pytest.approx(source.read("points/cloud")[:, :5])


def test_depth_of_another_lens_is_refused(tmp_path):
    streams = {"truth/depth": Stream((100, 848), "u2", "mm", "")}
    products = {"truth/depth_intrinsics": Product(np.array([400.0, 400, 424, 50]), "pixels", "")}
    with RecordingWriter(tmp_path / "a.h5", CONFIG, streams=streams, products=products) as writer:
        adc, rows = np.zeros((2, *CONFIG.frame_shape), np.int16), {"truth/depth": np.ones((2, 100, 848), np.uint16)}
        writer.append(adc, STAMPS[:2], rows=rows)
    with pytest.raises(InputError, match="has depth pictures of 848 x 100 pixels, expected .* depth-strip"):
        export(tmp_path / "a.h5", "radarize-ae", tmp_path / "a.bag")
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


# --- roverd -----------------------------------------------------------------------------------------------------------
def test_a_sequence_of_roverd(recording, tmp_path):
    """Words as read by the format's authors; velocities in the world; and the import of the export."""
    folder = export(recording, "roverd", tmp_path / "walk")
    about = json.loads((folder / "radar/meta.json").read_text())
    assert about["iq"]["shape"] == [8, 3, 4, 192] and about["ts"]["type"] == "f8" and about["valid"]["type"] == "u1"
    words = np.fromfile(folder / "radar/iq", "<i2").reshape(COUNT, 8, 3, 4, -1)
    with Recording(recording) as source:
        assert np.array_equal(iqiq_from_iiqq(words), source.adc(0, COUNT))  # TX1, TX2, TX3
    assert np.fromfile(folder / "radar/valid", "u1").tolist() == [1, 1, 0, 1, 1, 1, 1]
    resolutions = json.loads((folder / "radar/radar.json").read_text())
    assert resolutions["range_resolution"] == pytest.approx(CONFIG.range_resolution)
    assert resolutions["doppler_resolution"] == pytest.approx(CONFIG.velocity_resolution)
    chirps = yaml.safe_load((folder / "config.yaml").read_text())["radar"]["args"]["radar"]
    assert chirps["idle_time"] == 122.0 and chirps["freq_slope"] == 80.0 and chirps["device"] == "AWR1843"
    pose = np.load(folder / "_radar/pose.npz")
    assert pose["vel"] == pytest.approx(np.tile([0.9, 0, 0], (COUNT, 1)), abs=1e-6)
    assert np.einsum("nij,i->nj", pose["rot"], [0.9, 0, 0])[:, 1] == pytest.approx(
        -0.9 * np.sin(RATE * MIDDLE)
    )  # to its right
    with Recording(import_recording(folder, tmp_path / "a.h5", Given())) as copy, Recording(recording) as source:
        assert np.array_equal(copy.adc(0, COUNT), source.adc(0, COUNT)) and copy.times == pytest.approx(source.times)
        assert np.array_equal(copy.valid(0, COUNT), source.valid(0, COUNT))
        assert copy.config.tx_order == CONFIG.tx_order == (0, 2, 1)
        for name in ("slope", "idle_time", "adc_start_time", "ramp_end_time", "sample_rate", "frame_period"):
            assert getattr(copy.config, name) == getattr(CONFIG, name), name
    with pytest.raises(InputError, match="already exists, expected the name of a new folder for the sequence"):
        export(recording, "roverd", folder)


# --- others -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("order", "first"), [("iiqq", 0), ("qqii", 1)])
def test_order_of_i_and_q(recording, tmp_path, order, first):
    path = export(recording, "bin", tmp_path / "a.bin", iq_order=order)
    words = np.fromfile(path, "<i2").reshape(COUNT, 8, 3, 4, 48, 4)
    with Recording(recording) as source:
        assert np.array_equal(words[..., 0], source.adc(0, COUNT)[:, :, [0, 2, 1]][..., ::2, first])
    text = path.with_suffix(".cfg").read_text()
    assert f"adcbufCfg -1 0 {first} 1 1" in text
    lines = text.splitlines()
    assert "% Created for SDK ver:03.06" in lines and "% Platform:xWR18xx" in lines


def test_options_that_a_format_has_not(recording, tmp_path):
    with pytest.raises(InputError, match="export format is tum, but iq_order is given, expected that of bin only"):
        export(recording, "tum", tmp_path / "a.tum", iq_order="iiqq")
    with pytest.raises(InputError, match="iq_order"):
        export(recording, "bin", tmp_path / "a.bin", iq_order="qi")


def ply(path: Path) -> tuple[str, np.ndarray]:
    """Read header and table of a binary PLY file."""
    header, _, data = path.read_bytes().partition(b"end_header\n")
    kinds = {"double": "<f8", "float": "<f4", "int": "<i4"}
    fields = [line.split()[1:] for line in header.decode().splitlines() if line.startswith("property")]
    return header.decode(), np.frombuffer(data, [(name, kinds[kind]) for kind, name in fields])


def test_points_as_ply(recording, tmp_path):
    """Points in the world are at the sensor's position, rotated with it."""
    header, table = ply(export(recording, "ply", tmp_path / "points"))
    assert "element vertex 3" in header and "in the world" in header
    turn, place = RATE * MIDDLE[4], 0.9 * MIDDLE[4]
    assert table["frame"].tolist() == [0, 0, 4] and table["time"][2] == pytest.approx(MIDDLE[4])
    found = [table[name][2] for name in ("x", "y", "z", "velocity", "snr")]
    assert found == pytest.approx([place + 3 * np.cos(turn), 3 * np.sin(turn), 2.2, 0.1, 9], abs=1e-5)


def test_scans_of_a_run_as_ply(tmp_path):
    from radarize.io.tum import planar_poses, write_tum
    from radarize.pipeline.log import run
    from radarize.slam.config import SlamConfig

    ranges = np.full((COUNT, 9), 2.0)
    ranges[:, 4] = np.inf
    np.savez(
        tmp_path / "scans.npz", ranges=ranges, angle_min=-0.4, angle_increment=0.1, range_max=4.0, times=MIDDLE
    )  # fmt: skip
    moved = np.column_stack([0.1 * np.arange(COUNT), np.zeros(COUNT), np.zeros(COUNT)])
    write_tum(tmp_path / "odometry.tum", MIDDLE, planar_poses(moved))
    folder = run(tmp_path / "scans.npz", tmp_path / "odometry.tum", tmp_path / "run", config=SlamConfig.preset("radar"))
    _, table = ply(export(folder, "ply", tmp_path / "scans.ply"))
    assert len(table) == 8 * COUNT and np.bincount(table["frame"]).tolist() == [8] * COUNT
    slam = np.loadtxt(folder / "trajectory.tum")
    away = np.hypot(table["x"] - slam[table["frame"], 1], table["y"] - slam[table["frame"], 2])
    assert away == pytest.approx(2.0, abs=1e-3) and (table["z"] == 0).all()
