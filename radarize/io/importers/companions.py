"""Further topics beside raw frames in a ROS bag, assigned to the frames: true poses, depth, IMU, point clouds.

Names, units and conventions are those of the simulator's sensors, so that later steps treat them equally.
"""

import io
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, UInt16
from scipy.spatial.transform import Rotation, Slerp

from radarize.io.errors import InputError
from radarize.io.importers.rosbag import Message
from radarize.io.pixels import read_picture
from radarize.io.pose import OPTICAL_TURN
from radarize.io.recording import Product, Stream
from radarize.radar.config import RadarConfig
from radarize.signal.depthlabel import LABEL, label_streams, occupancy
from radarize.signal.points import COLUMNS

#: s, maximum difference of a header stamp from the time of receipt if both are on the same clock.
SAME_CLOCK = 0.5
#: s, longest gap between poses that is interpolated.
_LARGEST_GAP = 0.25
#: Bytes before the image in a compressedDepth message: an enumeration and two float32 (image_transport_plugins).
_DEPTH_HEADER = 12
#: Maximum number of pixels, more than any depth camera has; a few compressed bytes may declare more.
_MOST_PIXELS = 1 << 24
#: fx fy cx cy (pixels) of depth images in the Radarize data set, which has no camera_info.
STRIP = {(100, 848): (423.993, 423.993, 432.966, 50.938)}


def header_time(message: Message) -> float:
    """Return the stamp of a message's header, s; minus infinity without a header."""
    header = getattr(message, "header", None)
    return header.stamp.sec + 1e-9 * header.stamp.nanosec if header is not None else -np.inf


class Companion(ABC):
    """Reader of a topic beside the radar's: takes message by message, returns rows for each batch of frames.

    Args:
        first: first message of the topic.

    Attributes:
        streams, products: data sets of the recording by path.
        damaged: number of unusable messages.
    """

    streams: Mapping[str, Stream]
    products: Mapping[str, Product] = {}

    def __init__(self, config: RadarConfig, first: Message):
        self.config = config
        self.damaged = 0
        self._own_clock: bool | None = None
        self._last = -np.inf
        self._waiting: deque[tuple] = deque()

    def take(self, message: Message, received: float) -> None:
        """Store a message until its frame is processed.

        Args:
            message: message from the bag.
            received: time of receipt, s; used if the header has no stamp.
        """
        stamp = header_time(message)
        if self._own_clock is None:
            self._own_clock = abs(stamp - received) < SAME_CLOCK
        time = stamp if self._own_clock else received
        if time > self._last:  # repeated messages and those out of order are ignored
            self._last = time
            try:
                self._waiting.append((time, *self.read(message)))
            except InputError:
                self.damaged += 1

    @abstractmethod
    def read(self, message: Message) -> tuple:
        """Return the content of a message that is stored."""

    @abstractmethod
    def rows(self, times: Float[np.ndarray, "frame"], first: int, end: float) -> dict[str, np.ndarray]:
        """Return rows of the streams for the next frames.

        Args:
            times: stamps of the frames, s.
            first: number of the first frame.
            end: stamp of the frame after them, s.
        """

    def forget(self, before: float) -> None:
        """Drop messages before a time, s, since no frames are before it."""
        self._until(before)

    def _until(self, end: float) -> list[tuple]:
        """Return and remove the messages before `end`."""
        found = []
        while self._waiting and self._waiting[0][0] < end:
            found.append(self._waiting.popleft())
        return found


class TrackedPose(Companion):
    """Odometry of a tracking camera as truth: interpolated poses, and velocities over a frame period.

    Rows are not-a-number if there is no pose within 0.25 s before and after.
    """

    streams = {
        "truth/time": Stream((), "f8", "s", "middle of the frame's burst: the instant of the other truth streams"),
        "truth/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the tracking camera in its world"),
        "truth/velocity": Stream((6,), "f8", "m/s, rad/s", "linear, then angular velocity of the tracking camera"),
    }

    def read(self, message: Message) -> tuple:
        """Return the pose."""
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        return (np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]),)

    def rows(self, times: Float[np.ndarray, "frame"], first: int, end: float) -> dict[str, np.ndarray]:
        """Return pose and velocity in the middle of the bursts; velocity is the difference over one frame period around
        it, or over the known half of it.
        """
        half = self.config.frame_period / 2
        middle = times + self.config.burst_center
        known = [
            (time, pose)
            for time, pose in self._waiting
            if np.isfinite(pose).all() and 0.5 < np.abs(pose[3:]).max() < 2  # else not a rotation
        ]
        pose, before, after = (_interpolated(known, at) for at in (middle, middle - half, middle + half))
        velocity, span = np.full((len(times), 6), np.nan), np.zeros((len(times), 1))
        for side in (before, after):
            there = np.isfinite(side[:, :1])
            side[:] = np.where(there, side, pose)
            span += half * there
        moved = np.isfinite(pose[:, 0]) & (span[:, 0] > 0)
        if moved.any():
            turn = Rotation.from_quat(pose[moved, 3:])
            linear = turn.inv().apply(after[moved, :3] - before[moved, :3])
            angular = (Rotation.from_quat(before[moved, 3:]).inv() * Rotation.from_quat(after[moved, 3:])).as_rotvec()
            velocity[moved] = np.hstack([linear, angular]) / span[moved]
        self._until(end - _LARGEST_GAP - half)
        return {"truth/time": middle, "truth/pose": pose, "truth/velocity": velocity}


def _interpolated(known: list[tuple[float, np.ndarray]], at: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 7"]:
    """Interpolate poses: linearly in position, and at constant angular speed."""
    result = np.full((len(at), 7), np.nan)
    if len(known) < 2:
        return result
    times, poses = np.array([time for time, _ in known]), np.stack([pose for _, pose in known])
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    inside = (at >= times[0]) & (at <= times[-1]) & (times[after] - times[after - 1] <= _LARGEST_GAP)
    if inside.any():
        place = [np.interp(at[inside], times, column) for column in poses[:, :3].T]
        turn = Slerp(times, Rotation.from_quat(poses[:, 3:]))(at[inside]).as_quat()
        result[inside] = np.column_stack([*place, turn])
    return result


class Depth(Companion):
    """Depth images, the nearest to the middle of each burst; all 0 if none is within half a frame period.

    If the lens is known, each image also has its occupancy label.
    """

    def __init__(self, config: RadarConfig, first: Message):
        super().__init__(config, first)
        self._shape = depth_picture(first).shape
        self.streams = {
            "truth/depth": Stream(
                self._shape, "u2", "mm", "depth along the optical axis, row by row from the upper left; 0: no value"
            )
        }
        if self._shape in STRIP:
            self.calibrate(STRIP[self._shape])

    def calibrate(self, pinhole: tuple[float, float, float, float]) -> None:
        """Set the pinhole model fx, fy, cx, cy (pixels)."""
        about = "fx fy cx cy of the depth camera"
        self._pinhole = np.asarray(pinhole, float)
        label, axes = label_streams(self.config)
        self.streams = {"truth/depth": self.streams["truth/depth"], **label}
        self.products = {"truth/depth_intrinsics": Product(self._pinhole, "pixels", about), **axes}

    def read(self, message: Message) -> tuple:
        """Return the message unchanged; only images of frames are unpacked."""
        return (message,)

    def rows(self, times: Float[np.ndarray, "frame"], first: int, end: float) -> dict[str, np.ndarray]:
        """Return depth images in mm."""
        pictures = np.zeros((len(times), *self._shape), np.uint16)
        taken = np.array([time for time, _ in self._waiting])
        for index, middle in enumerate(times + self.config.burst_center if len(taken) else ()):
            nearest = int(np.abs(taken - middle).argmin())
            if abs(taken[nearest] - middle) <= 0.6 * self.config.frame_period:
                try:
                    picture = depth_picture(self._waiting[nearest][1])
                except InputError:
                    picture = None
                if picture is None or picture.shape != self._shape:
                    self.damaged += 1
                else:
                    pictures[index] = picture
        self._until(end - self.config.frame_period)
        label = {LABEL: occupancy(pictures, self._pinhole, self.config)} if LABEL in self.streams else {}
        return {"truth/depth": pictures, **label}


def depth_picture(message: Message) -> UInt16[np.ndarray, "row column"]:
    """Return depth in mm of an Image (``16UC1``, ``32FC1``) or a CompressedImage of transport ``compressedDepth``.

    Raises:
        InputError: another encoding, or a damaged picture.
    """
    if not hasattr(message, "format"):
        kinds = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
        if message.encoding not in kinds:
            raise InputError(f"depth picture has encoding {message.encoding!r}, expected one of {', '.join(kinds)}")
        kind = np.dtype(kinds[message.encoding]).newbyteorder(">" if message.is_bigendian else "<")
        data = np.asarray(message.data, np.uint8)
        rows, step = int(message.height), int(message.step)
        if not 0 < int(message.width) * kind.itemsize <= step or data.size < rows * step:
            raise InputError(f"depth picture of {message.width} x {rows} has {data.size} bytes, expected {rows * step}")
        used = data[: rows * step].reshape(rows, step)[:, : int(message.width) * kind.itemsize]
        depth = np.ascontiguousarray(used).view(kind)
        return depth.astype(np.uint16) if kind.kind == "u" else _millimetres(depth)
    packed = bytes(message.data)
    picture = read_picture(
        io.BytesIO(packed[_DEPTH_HEADER:]), f"depth picture ({message.format})", most=_MOST_PIXELS, gray=False
    )
    if picture.ndim != 2:
        raise InputError(f"depth picture ({message.format}) has {picture.ndim} axes, expected one grey value a pixel")
    if message.format.strip().startswith("32FC1"):  # quantised inverse depth: a / (value - b)
        scale, offset = np.frombuffer(packed[4:_DEPTH_HEADER], "<f4").astype(float)
        with np.errstate(divide="ignore"):
            return _millimetres(np.where(picture > 0, scale / (picture - offset), 0))
    return picture.astype(np.uint16)


def _millimetres(metres: np.ndarray) -> UInt16[np.ndarray, "row column"]:
    usable = np.isfinite(metres) & (metres > 0) & (metres < 65.5)
    return np.rint(1000 * np.where(usable, metres, 0)).astype(np.uint16)


class InertialSensor(Companion):
    """Specific force and angular velocity at the sensor's own rate.

    Its axes are those of the radar, unless its frame is named optical (z forward, x right: REP 103) or `turn` is
    called.
    """

    streams = {
        "imu/time": Stream((), "f8", "s", "instants of the IMU's samples", "imu/time"),
        "imu/accelerometer": Stream((3,), "f4", "m/s^2", "specific force x y z: +g upward at rest", "imu/time"),
        "imu/gyroscope": Stream((3,), "f4", "rad/s", "angular velocity x y z", "imu/time"),
    }

    def __init__(self, config: RadarConfig, first: Message):
        super().__init__(config, first)
        frame = str(getattr(first.header, "frame_id", ""))
        if "optical" in frame:
            self.turn(Rotation.from_quat(OPTICAL_TURN), f"its frame is {frame}")

    def turn(self, rotation: Rotation, why: str) -> None:
        """Set the rotation of the IMU relative to the radar."""
        place = np.array([0.0, 0, 0, *rotation.as_quat()])
        about = f"x y z qx qy qz qw of the IMU in the radar's frame; {why}; its place is not known"
        self.products = {"imu/mount": Product(place, "m, quaternion", about)}

    def read(self, message: Message) -> tuple:
        """Return specific force and angular velocity."""
        force, turn = message.linear_acceleration, message.angular_velocity
        return (force.x, force.y, force.z, turn.x, turn.y, turn.z)

    def rows(self, times: Float[np.ndarray, "frame"], first: int, end: float) -> dict[str, np.ndarray]:
        """Return samples until the next frame."""
        table = np.array(self._until(end), float).reshape(-1, 7)
        table = table[table[:, 0] >= times[0]] if first == 0 else table
        return {"imu/time": table[:, 0], "imu/accelerometer": table[:, 1:4], "imu/gyroscope": table[:, 4:]}


class ChipPoints(Companion):
    """Point clouds of the radar's firmware, each assigned to the frame nearest in time.

    Raises:
        InputError: clouds without x, y and z as float32.
    """

    def __init__(self, config: RadarConfig, first: Message):
        super().__init__(config, first)
        cloud_columns(first)
        about = f"{' '.join(COLUMNS)} of TI's point cloud in the sensor frame, closing velocity positive"
        clock = "points/frame"
        self.streams = {
            clock: Stream((), "i4", "", "number of the frame that a point belongs to", clock),
            "points/cloud": Stream((len(COLUMNS),), "f4", "m, m/s, dB", about, clock),
        }

    def read(self, message: Message) -> tuple:
        """Return the points."""
        return (cloud_columns(message),)

    def rows(self, times: Float[np.ndarray, "frame"], first: int, end: float) -> dict[str, np.ndarray]:
        """Return the points of the frames, one frame after another."""
        clouds = self._until((times[-1] + end) / 2)
        nearest = [int(np.abs(times - time).argmin()) for time, _ in clouds]
        frames = [np.full(len(cloud), first + index) for index, (_, cloud) in zip(nearest, clouds, strict=True)]
        return {
            "points/frame": np.concatenate([*frames, np.zeros(0)]).astype(np.int32),
            "points/cloud": np.concatenate([*(cloud for _, cloud in clouds), np.zeros((0, len(COLUMNS)))]),
        }


def cloud_columns(message: Message) -> Float[np.ndarray, "point column"]:
    """Return points of a PointCloud2 as `radarize.signal.points.COLUMNS`; missing columns are not-a-number.

    The chip's velocities are positive when receding, and its intensity is the SNR in dB (ti_mmwave_rospkg).

    Raises:
        InputError: no x, y and z as float32, or fewer bytes than points.
    """
    fields = {field.name: field for field in message.fields}
    count, step = int(message.width) * int(message.height), int(message.point_step)
    data = np.asarray(message.data, np.uint8)
    if data.size < count * step:
        raise InputError(f"point cloud of {count} points has {data.size} bytes, expected {count * step}")
    usable = {name: f.offset for name, f in fields.items() if f.datatype == 7 and f.offset + 4 <= step}  # 7: float32
    if not {*"xyz"} <= usable.keys():
        raise InputError(f"point cloud has fields {', '.join(fields) or '(none)'}, expected float32 x, y, z")
    formats = [">f4" if message.is_bigendian else "<f4"] * len(usable)
    kind = np.dtype({"names": [*usable], "formats": formats, "offsets": [*usable.values()], "itemsize": step})
    table = np.ascontiguousarray(data[: count * step]).view(kind)
    columns = {name: table[name].astype(float) for name in usable}
    columns["snr"] = columns.get("intensity", unknown := np.full(count, np.nan))
    columns["velocity"] = -columns.get("velocity", unknown)
    return np.column_stack([columns.get(name, unknown) for name in COLUMNS])
