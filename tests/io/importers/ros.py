"""ROS bags in the layout of the published Radarize data set, written from recordings, message by message."""

import io
from pathlib import Path

import numpy as np
from PIL import Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from radarize.io.recording import Recording
from radarize.radar.dca1000 import encode

RADAR, ODOMETRY, IMU = "/radar0/radar_data", "/tracking/odom/sample", "/tracking/imu"
CLOUD, DEPTH = "/ti_mmwave/radar_scan_pcl_0", "/camera/depth/image_rect_raw/compressedDepth"
FRAME = "xwr_raw_ros/msg/RadarFrameFull"
#: The message as xwr_raw_ros defines it (github.com/ConnectedSystemsLab/xwr_raw_ros, msg/RadarFrameFull.msg), by name
#: and type.
PUBLISHED = [
    ("header", "std_msgs/Header"), ("platform", "string"), ("adc_output_fmt", "uint8"), ("range_bias", "float32"),
    ("rx_phase_bias", "float32[]"), ("chirp_time", "float32"), ("chirp_slope", "float32"), ("frame_time", "float32"),
    ("velocity_max", "float32"), ("velocity_res", "float32"), ("sample_rate", "float32"), ("range_max", "float32"),
    ("range_res", "float32"), ("rx", "uint8[]"), ("tx", "uint8[]"), ("shape", "uint32[]"), ("data", "int16[]"),
]  # fmt: skip
#: Not what the importer falls back on: fields in another order, and other ones.
DEFINITION = """std_msgs/Header header
string platform
uint8 adc_output_fmt
float64 range_bias
float64[] rx_phase_bias
uint8[4] rx
uint8[3] tx
float32 max_range
int64[3] shape
uint32 LIMIT = 7
int16[] data
"""
#: Seconds between 1970 and the recording's zero.
EPOCH = 1_700_000_000.0


class BagWriter:
    """Writes messages of keyword fields; `version` 1 or 2 of ROS; frames by a definition of ours, or `published`."""

    def __init__(
        self, path: Path, version: int, storage: StoragePlugin = StoragePlugin.SQLITE3, published: bool = False
    ):
        self.version, self.published = version, published
        self.types = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        definition = "\n".join(f"{kind} {name}" for name, kind in PUBLISHED) if published else DEFINITION
        self.types.register(get_types_from_msg(definition, FRAME))
        self.bag = Writer1(path) if version == 1 else Writer2(path, version=8, storage_plugin=storage)
        self.connections = {}

    def __enter__(self):
        self.bag.open()
        return self

    def __exit__(self, *_):
        self.bag.close()

    def make(self, kind: str, **fields):
        return self.types.types[kind](**fields)

    def header(self, time: float | None, frame: str = "map"):
        nanoseconds = 0 if time is None else round(1e9 * (EPOCH + time))
        stamp = self.make("builtin_interfaces/msg/Time", sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        counter = {"seq": 0} if self.version == 1 else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **counter)

    def vector(self, values, kind="geometry_msgs/msg/Vector3"):
        return self.make(kind, **dict(zip("xyzw", map(float, values), strict=False)))

    def write(self, topic: str, kind: str, received: float, **fields) -> None:
        if topic not in self.connections:
            self.connections[topic] = self.bag.add_connection(topic, kind, typestore=self.types)
        encode_message = self.types.serialize_ros1 if self.version == 1 else self.types.serialize_cdr
        data = encode_message(self.make(kind, **fields), kind)
        self.bag.write(self.connections[topic], round(1e9 * (EPOCH + received)), data)

    def frame(self, time: float, samples: np.ndarray, config, calibration=None, latency=None, stamp=None) -> None:
        """A raw frame that began at `time`, received when its burst is over or `latency` later; its header's stamp is
        not set, as in the data set, unless given.
        """
        received = time + (config.burst_time if latency is None else latency)
        words = encode(samples[None], config)
        pairs = config.channel_factors.view(float) if calibration is None else np.asarray(calibration, float)
        loops, tx, rx, count, _ = config.frame_shape
        others = {"max_range": 4.0, "LIMIT": 7, "shape": np.array([loops, tx * rx, count])}
        if self.published:
            others = {name: 0.0 for name, kind in PUBLISHED[5:] if kind == "float32"}
            others["shape"] = np.array([loops * tx, rx, count], np.uint32)
            pairs = pairs.astype(np.float32)
        self.write(
            RADAR, FRAME, received, header=self.header(stamp), platform="xWR18xx", adc_output_fmt=1,
            range_bias=config.range_bias, rx_phase_bias=pairs.ravel(),
            rx=np.isin(np.arange(4), config.rx).astype(np.uint8), tx=np.isin(np.arange(3), config.tx).astype(np.uint8),
            data=words, **others,
        )  # fmt: skip

    def odometry(self, time: float, pose: np.ndarray, received: float) -> None:
        pose = self.make(
            "geometry_msgs/msg/Pose",
            position=self.vector(pose[:3], "geometry_msgs/msg/Point"),
            orientation=self.vector(pose[3:], "geometry_msgs/msg/Quaternion"),
        )
        still = self.make("geometry_msgs/msg/Twist", linear=self.vector([0] * 3), angular=self.vector([0] * 3))
        unknown = np.zeros(36)
        self.write(
            ODOMETRY, "nav_msgs/msg/Odometry", received, header=self.header(time), child_frame_id="camera",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=still, covariance=unknown),
        )  # fmt: skip

    def imu(self, time: float, force: np.ndarray, turn: np.ndarray, frame: str = "map") -> None:
        self.write(
            IMU, "sensor_msgs/msg/Imu", time, header=self.header(time, frame),
            orientation=self.vector([0, 0, 0, 1], "geometry_msgs/msg/Quaternion"),
            orientation_covariance=np.zeros(9), angular_velocity=self.vector(turn),
            angular_velocity_covariance=np.zeros(9), linear_acceleration=self.vector(force),
            linear_acceleration_covariance=np.zeros(9),
        )  # fmt: skip

    def depth(self, time: float, picture: np.ndarray) -> None:
        """A compressedDepth picture: twelve bytes, then a PNG of 16 bits."""
        packed = io.BytesIO()
        Image.fromarray(picture).save(packed, format="PNG")
        data = np.frombuffer(bytes(12) + packed.getvalue(), np.uint8)
        self.write(
            DEPTH, "sensor_msgs/msg/CompressedImage", time, header=self.header(time),
            format="16UC1; compressedDepth", data=data,
        )  # fmt: skip

    def cloud(self, time: float, points: np.ndarray) -> None:
        """A cloud as ti_mmwave_rospkg has it: receding velocities positive."""
        table = np.column_stack([points[:, :3], points[:, 4], -points[:, 3]]).astype("<f4")
        fields = [
            self.make("sensor_msgs/msg/PointField", name=name, offset=4 * k, datatype=7, count=1)
            for k, name in enumerate(("x", "y", "z", "intensity", "velocity"))
        ]
        self.write(
            CLOUD, "sensor_msgs/msg/PointCloud2", time, header=self.header(time), height=1, width=len(table),
            fields=fields, is_bigendian=False, point_step=20, row_step=20 * len(table),
            data=table.view(np.uint8).reshape(-1), is_dense=True,
        )  # fmt: skip


def write_published(path: Path, source: Path, version: int = 1, storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    """Write a recording as a bag, with its tracking poses, IMU, depth and points."""
    with Recording(source) as recording, BagWriter(path, version, storage) as bag:
        config, middle = recording.config, recording.times + recording.config.burst_center
        events = [(time + config.burst_time, bag.frame, (k,)) for k, time in enumerate(recording.times)]
        if recording.has("tracking/time"):
            name = "tracking/true_pose" if recording.has("tracking/true_pose") else "tracking/pose"
            tracked = zip(recording.read("tracking/time"), recording.read(name), strict=True)
            events += [(time + 0.004, bag.odometry, (time, pose, time + 0.004)) for time, pose in tracked]
        if recording.has("imu/time"):
            columns = (recording.read(f"imu/{name}") for name in ("time", "accelerometer", "gyroscope"))
            events += [(row[0], bag.imu, row) for row in zip(*columns, strict=True)]
        if recording.has("truth/depth"):
            events += [(time, bag.depth, (time, k)) for k, time in enumerate(middle)]
        if recording.has("points/frame"):
            frame, cloud = recording.read("points/frame"), recording.read("points/cloud")
            events += [
                (time + 0.01, bag.cloud, (time + 0.01, cloud[frame == k])) for k, time in enumerate(recording.times)
            ]
        for time, write, values in sorted(events, key=lambda event: event[0]):
            if write == bag.frame:
                bag.frame(recording.times[values[0]], recording.adc(values[0], values[0] + 1)[0], config)
            elif write == bag.depth:
                bag.depth(time, recording.rows("truth/depth", values[1], values[1] + 1)[0])
            else:
                write(*values)
    return path
