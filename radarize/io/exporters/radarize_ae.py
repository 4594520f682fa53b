"""Export of a recording as a ROS 1 bag in the layout of the Radarize paper's data set, for the paper's published code.

    /radar0/radar_data  xwr_raw_ros/RadarFrameFull: words Q Q I I in firing order, no stamp in the header; received when
                        the burst is over
    /tracking/odom/sample  Odometry at 200 Hz: true poses        /tracking/imu  Imu
    /camera/depth/image_rect_raw/compressedDepth  CompressedImage: 12 bytes and a PNG of 848 x 100 pixels, mm
    /ti_mmwave/radar_scan_pcl_0  PointCloud2: x, y, z, intensity (SNR, dB), velocity (receding positive)

The published code uses the times of receipt as stamps. Its settings are those of one radar (``calib/1843/1843_v1.cfg``,
preset ``radarize``) and of one lens: for another radar, set its ``RADAR_CONFIG`` to the ``.cfg`` that ``--format bin``
writes.
"""

import heapq
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from PIL import Image
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation, Slerp

from radarize.io.errors import InputError
from radarize.io.exporters.ros2 import stamp_offset
from radarize.io.importers.companions import STRIP
from radarize.io.importers.rosbag import FRAME_DEFINITION, FRAME_TYPE
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.radar.cfg import cfg_headers
from radarize.radar.config import RadarConfig, fired
from radarize.radar.dca1000 import encode
from radarize.signal.points import PointClouds

RADAR, ODOMETRY, IMU = "/radar0/radar_data", "/tracking/odom/sample", "/tracking/imu"
POINTS, DEPTH = "/ti_mmwave/radar_scan_pcl_0", "/camera/depth/image_rect_raw/compressedDepth"
#: s, interval between poses.
_TICK = 1 / 200
#: m/s, speed of light in the published code.
_LIGHT = 3e8
_BATCH = 16
_FLOAT32 = 7
_TYPES = get_typestore(Stores.ROS1_NOETIC)
_TYPES.register(get_types_from_msg(FRAME_DEFINITION, FRAME_TYPE))
#: Time of receipt (s), topic, message.
Event = tuple[float, str, Any]


def export_radarize_ae(
    source: Path, output: Path, *, time_offset: float | None = None, progress: Callable[[int, int], None]
) -> Path:
    """Write a bag, ``NAME.bag``; see `exporters.export`.

    Raises:
        InputError: not a recording, depth images of another lens, or the file cannot be written.
    """
    output = output.with_suffix(".bag") if output.suffix != ".bag" else output
    with Recording(source) as recording, replacing(output) as part:
        later = round(1e9 * stamp_offset(recording.times, time_offset))
        streams = [_frames(recording), _poses(recording), _inertial(recording), _depth(recording), _points(recording)]
        connections: dict[str, Connection] = {}
        part.unlink(missing_ok=True)  # the library does not write over a file
        done = 0
        with Writer(part) as bag:
            for time, topic, content in heapq.merge(*streams, key=lambda event: event[0]):
                kind = content.__msgtype__
                if topic not in connections:
                    connections[topic] = bag.add_connection(topic, kind, typestore=_TYPES)
                data = _TYPES.serialize_ros1(_stamped(content, later), kind)
                bag.write(connections[topic], round(1e9 * time) + later, data)
                if topic == RADAR:
                    done += 1
                    progress(done, len(recording))
    return output


def _message(kind: str, **fields: Any) -> Any:
    return _TYPES.types[kind](**fields)


def _header(time: float | None, frame: str = "") -> Any:
    """Return a header with a stamp, s, or without one."""
    seconds, nanoseconds = divmod(0 if time is None else round(1e9 * time), 10**9)
    stamp = _message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return _message("std_msgs/msg/Header", seq=0, stamp=stamp, frame_id=frame)


def _stamped(content: Any, later: int) -> Any:
    """Return the message with its stamp, if it has one, shifted by `later` ns."""
    stamp = content.header.stamp
    if content.__msgtype__ != FRAME_TYPE:
        seconds, nanoseconds = divmod(stamp.sec * 10**9 + stamp.nanosec + later, 10**9)
        content.header.stamp = _message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
    return content


def _vector(values: np.ndarray, kind: str = "Vector3") -> Any:
    return _message(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", map(float, values), strict=False)))


def _middles(recording: Recording) -> Float[np.ndarray, "frame"]:
    return recording.times + recording.config.burst_center


def _frames(recording: Recording) -> Iterator[Event]:
    config = recording.config.model_copy(update={"iq_order": "qqii"})
    fields = _parameters(config)
    for frames, adc in recording.batches(_BATCH):
        for time, frame in zip(recording.times[frames], adc, strict=True):
            words = encode(frame[None], config)
            yield time + config.burst_time, RADAR, _message(FRAME_TYPE, header=_header(None), data=words, **fields)


def _parameters(config: RadarConfig) -> dict[str, Any]:
    """Return the fields common to all frames, computed from a configuration as in xwr_raw_ros."""
    loops, tx, rx, samples, _ = config.frame_shape
    enabled = sorted({transmitter for firing in config.tx for transmitter in fired(firing)})
    chirp = config.idle_time + config.ramp_end_time
    velocity_max = _LIGHT / config.start_frequency / (4 * chirp)
    range_max = config.sample_rate * _LIGHT / (2 * config.slope)
    return {
        "platform": cfg_headers(config)[1].split(":")[1],
        "adc_output_fmt": 1,
        "range_bias": config.range_bias,
        "rx_phase_bias": np.ascontiguousarray(config.channel_factors).view(float).ravel().astype(np.float32),
        "chirp_time": 1e6 * chirp,
        "chirp_slope": config.slope,
        "frame_time": 1e3 * config.frame_period,
        "velocity_max": velocity_max,
        "velocity_res": velocity_max / (loops * tx),
        "sample_rate": config.sample_rate,
        "range_max": range_max,
        "range_res": range_max / samples,
        "rx": np.isin(np.arange(max(config.rx) + 1), config.rx).astype(np.uint8),
        "tx": np.isin(np.arange(max(enabled) + 1), enabled).astype(np.uint8),
        "shape": np.array([loops * tx, rx, samples], np.uint32),
    }


def _poses(recording: Recording) -> Iterator[Event]:
    """Yield true poses at 200 Hz, interpolated linearly in position and at constant angular speed."""
    truth = recording.true_poses()
    if truth is None or len(truth[0]) < 2:
        return
    times, poses = truth
    ticks = times[0] + _TICK * np.arange(int((times[-1] - times[0]) / _TICK) + 1)
    places = np.column_stack([np.interp(ticks, times, column) for column in poses[:, :3].T])
    turns = Slerp(times, Rotation.from_quat(poses[:, 3:]))(ticks.clip(times[0], times[-1])).as_quat()
    still, unknown = _vector(np.zeros(3)), np.zeros(36)
    for time, place, turn in zip(ticks, places, turns, strict=True):
        pose = _message(
            "geometry_msgs/msg/Pose", position=_vector(place, "Point"), orientation=_vector(turn, "Quaternion")
        )
        twist = _message("geometry_msgs/msg/Twist", linear=still, angular=still)
        yield time, ODOMETRY, _message(
            "nav_msgs/msg/Odometry", header=_header(time, "tracking_odom_frame"), child_frame_id="tracking_pose_frame",
            pose=_message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
            twist=_message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
        )  # fmt: skip


def _inertial(recording: Recording) -> Iterator[Event]:
    """Yield IMU samples on the axes of the radar."""
    if not recording.has("imu/time"):
        return
    level, none = _vector(np.array([0, 0, 0, 1]), "Quaternion"), np.zeros(9)
    unknown = np.array([-1.0, *[0] * 8])  # no orientation: sensor_msgs/Imu
    for k in range(len(recording)):
        columns = (recording.rows(f"imu/{name}", k, k + 1) for name in ("time", "accelerometer", "gyroscope"))
        for time, force, turn in zip(*columns, strict=True):
            yield time, IMU, _message(
                "sensor_msgs/msg/Imu", header=_header(time, "imu"), orientation=level, orientation_covariance=unknown,
                angular_velocity=_vector(turn), angular_velocity_covariance=none, linear_acceleration=_vector(force),
                linear_acceleration_covariance=none,
            )  # fmt: skip


def _depth(recording: Recording) -> Iterator[Event]:
    if not recording.has("truth/depth"):
        return
    shape = recording.describe("truth/depth")["shape"]
    assert isinstance(shape, tuple)
    lens = STRIP.get(shape[1:])
    known = recording.has("truth/depth_intrinsics")
    if lens is None or (known and not np.allclose(recording.read("truth/depth_intrinsics"), lens, rtol=1e-4)):
        raise InputError(
            f"{recording.path}: has depth pictures of {shape[2]} x {shape[1]} pixels, expected the 848 x 100 of the "
            "published code's lens (radarsim simulate --sensors depth-strip)"
        )
    for k, time in enumerate(_middles(recording)):
        packed = io.BytesIO()
        Image.fromarray(recording.rows("truth/depth", k, k + 1)[0]).save(packed, format="PNG")
        yield time, DEPTH, _message(
            "sensor_msgs/msg/CompressedImage", header=_header(time, "camera_depth_optical_frame"),
            format="16UC1; compressedDepth png", data=np.frombuffer(bytes(12) + packed.getvalue(), np.uint8),
        )  # fmt: skip


def _points(recording: Recording) -> Iterator[Event]:
    """Yield the stored points, or else those that the radar's firmware would detect; receding speeds are positive, as
    in the firmware."""
    stored = recording.has("points/frame") and recording.has("points/cloud")
    maker = None if stored else PointClouds(recording.config)
    end = recording.config.burst_time
    fields = [
        _message("sensor_msgs/msg/PointField", name=name, offset=4 * k, datatype=_FLOAT32, count=1)
        for k, name in enumerate(("x", "y", "z", "intensity", "velocity"))
    ]
    for k, time in enumerate(recording.times + end):
        cloud = recording.rows("points/cloud", k, k + 1) if maker is None else maker(recording.adc(k, k + 1))[0]
        table = np.column_stack([cloud[:, :3], cloud[:, 4], -cloud[:, 3]]).astype("<f4")
        yield time, POINTS, _message(
            "sensor_msgs/msg/PointCloud2", header=_header(time, "ti_mmwave_pcl"), height=1, width=len(table),
            fields=fields, is_bigendian=False, point_step=20, row_step=20 * len(table), is_dense=True,
            data=np.frombuffer(table.tobytes(), np.uint8),
        )  # fmt: skip
