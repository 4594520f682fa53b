"""Results of a pipeline as Foxglove messages, and a server for them.

    /tf         map -> odom -> base_link -> radar, as in ROS (REP 105)
    /scan       LaserScan, in `radar`        /path  PosesInFrame, in `map`
    /map        Grid, in `map`: occupancy of 0, 100 or -1, as in nav_msgs/OccupancyGrid
    /radar/...  heat maps and, of a simulated recording, path types as images; /radar/points  PointCloud, in `radar`
    /truth/path  PosesInFrame, in `world`; the frame `truth` has the true pose of the radar
    /camera/depth/image_rect_raw  RawImage (16UC1, mm) and /camera/depth/camera_info

``base_link`` is the radar: x forward, y left, z up (REP 103). Poses are planar, except the true ones.
"""

import math
from collections.abc import Sequence

import foxglove
import numpy as np
from foxglove import channels, messages
from jaxtyping import Float, UInt8, UInt16

from radarize.io.errors import InputError
from radarize.io.pose import compose, inverse
from radarize.pipeline.runfolder import OccupancyMap
from radarize.signal.bearings import BEARINGS

_HERE = np.zeros(3)
_OCCUPANCY = messages.PackedElementField(name="occupancy", offset=0, type=messages.PackedElementFieldNumericType.Int8)


class Messages:
    """Publisher of Foxglove messages; times are time stamps in s.

    Args:
        context: Foxglove context to publish to.
    """

    def __init__(self, context: foxglove.Context):
        self._context = context
        self._tf = channels.FrameTransformsChannel("/tf", context=context)
        self._scan = channels.LaserScanChannel("/scan", context=context)
        self._path = channels.PosesInFrameChannel("/path", context=context)
        self._map = channels.GridChannel("/map", context=context)
        self._true_path = channels.PosesInFrameChannel("/truth/path", context=context)
        self._points = channels.PointCloudChannel("/radar/points", context=context)
        self._depth = channels.RawImageChannel("/camera/depth/image_rect_raw", context=context)
        self._lens = channels.CameraCalibrationChannel("/camera/depth/camera_info", context=context)
        self._pictures: dict[str, channels.RawImageChannel] = {}

    def pose(self, time: float, slam: Float[np.ndarray, "3"], odometry: Float[np.ndarray, "3"]) -> None:
        """Publish the pose of the radar by SLAM (in `map`) and by odometry (in `odom`)."""
        links = (
            ("map", "odom", compose(slam, inverse(odometry))),
            ("odom", "base_link", odometry),
            ("base_link", "radar", _HERE),
        )
        transforms = [
            messages.FrameTransform(
                timestamp=_stamp(time), parent_frame_id=parent, child_frame_id=child,
                translation=messages.Vector3(x=float(pose[0]), y=float(pose[1]), z=0.0), rotation=_turn(pose[2]),
            )
            for parent, child, pose in links
        ]  # fmt: skip
        self._tf.log(messages.FrameTransforms(transforms=transforms), log_time=_nanoseconds(time))

    def scan(
        self, time: float, ranges: Float[np.ndarray, "beam"], azimuths: Float[np.ndarray, "beam"] = BEARINGS
    ) -> None:
        """Publish a scan: ranges (m; inf without a return) at uniformly spaced azimuths (rad)."""
        self._scan.log(
            messages.LaserScan(
                timestamp=_stamp(time), frame_id="radar", pose=_pose(_HERE), start_angle=float(azimuths[0]),
                end_angle=float(azimuths[-1]), ranges=[float(r) for r in ranges], intensities=[],
            ),
            log_time=_nanoseconds(time),
        )  # fmt: skip

    def path(self, time: float, poses: Float[np.ndarray, "node 3"]) -> None:
        """Publish the path so far, in `map`."""
        way = messages.PosesInFrame(timestamp=_stamp(time), frame_id="map", poses=[_pose(pose) for pose in poses])
        self._path.log(way, log_time=_nanoseconds(time))

    def map(self, time: float, found: OccupancyMap) -> None:
        """Publish the map so far."""
        rows, columns = found.pixels.shape
        cells = np.where(found.occupied, 100, np.where(found.free, 0, -1)).astype(np.int8)[::-1]
        self._map.log(
            messages.Grid(
                timestamp=_stamp(time), frame_id="map", pose=_pose(np.array(found.origin)), column_count=columns,
                cell_size=messages.Vector2(x=found.resolution, y=found.resolution), row_stride=columns, cell_stride=1,
                fields=[_OCCUPANCY], data=cells.tobytes(),
            ),
            log_time=_nanoseconds(time),
        )  # fmt: skip

    def links(self, time: float, links: Sequence[tuple[str, str, Float[np.ndarray, "7"]]]) -> None:
        """Publish transforms: parent, child, and x y z (m) qx qy qz qw of the child in the parent."""
        transforms = [
            messages.FrameTransform(
                timestamp=_stamp(time), parent_frame_id=parent, child_frame_id=child,
                translation=_vector(pose[:3]), rotation=_quaternion(pose[3:]),
            )
            for parent, child, pose in links
        ]  # fmt: skip
        self._tf.log(messages.FrameTransforms(transforms=transforms), log_time=_nanoseconds(time))

    def true_path(self, time: float, poses: Float[np.ndarray, "pose 7"]) -> None:
        """Publish the true path, in `world`."""
        way = [messages.Pose(position=_vector(pose[:3]), orientation=_quaternion(pose[3:])) for pose in poses]
        found = messages.PosesInFrame(timestamp=_stamp(time), frame_id="world", poses=way)
        self._true_path.log(found, log_time=_nanoseconds(time))

    def points(self, time: float, cloud: Float[np.ndarray, "point column"], names: Sequence[str]) -> None:
        """Publish the points of a frame, in `radar`; named columns include x, y and z (m)."""
        float32 = messages.PackedElementFieldNumericType.Float32
        fields = [messages.PackedElementField(name=name, offset=4 * k, type=float32) for k, name in enumerate(names)]
        self._points.log(
            messages.PointCloud(
                timestamp=_stamp(time), frame_id="radar", pose=_pose(_HERE), point_stride=4 * len(names),
                fields=fields, data=cloud.astype("<f4").tobytes(),
            ),
            log_time=_nanoseconds(time),
        )  # fmt: skip

    def depth(
        self, time: float, picture: UInt16[np.ndarray, "row column"], pinhole: Float[np.ndarray, "4"] | None
    ) -> None:
        """Publish a depth picture (mm), and the intrinsics fx, fy, cx, cy (pixels) of its camera."""
        rows, columns = picture.shape
        image = messages.RawImage(
            timestamp=_stamp(time), frame_id="camera_depth_optical_frame", width=columns, height=rows,
            encoding="16UC1", step=2 * columns, data=picture.astype("<u2").tobytes(),
        )  # fmt: skip
        self._depth.log(image, log_time=_nanoseconds(time))
        if pinhole is not None:
            fx, fy, cx, cy = map(float, pinhole)
            lens = messages.CameraCalibration(
                timestamp=_stamp(time), frame_id="camera_depth_optical_frame", width=columns, height=rows,
                distortion_model="plumb_bob", D=[0.0] * 5, K=[fx, 0, cx, 0, fy, cy, 0, 0, 1],
                R=[1, 0, 0, 0, 1, 0, 0, 0, 1], P=[fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0],
            )  # fmt: skip
            self._lens.log(lens, log_time=_nanoseconds(time))

    def picture(self, time: float, name: str, pixels: UInt8[np.ndarray, "row column color"]) -> None:
        """Publish a heat map as an image with channels red, green, blue and optionally alpha."""
        if name not in self._pictures:
            self._pictures[name] = channels.RawImageChannel(f"/radar/{name}", context=self._context)
        rows, columns, colors = pixels.shape
        image = messages.RawImage(
            timestamp=_stamp(time), frame_id="radar", width=columns, height=rows,
            encoding="rgba8" if colors == 4 else "rgb8", step=colors * columns,
            data=np.ascontiguousarray(pixels).tobytes(),
        )  # fmt: skip
        self._pictures[name].log(image, log_time=_nanoseconds(time))


class Server(Messages):
    """Server for Foxglove; use as a context manager.

    Args:
        address: address to listen on, ``HOST:PORT``; port 0 selects a free one.

    Attributes:
        url: URL for "Open connection" in Foxglove.

    Raises:
        InputError: the address cannot be used.
    """

    def __init__(self, address: str = "127.0.0.1:8765"):
        context = foxglove.Context()
        super().__init__(context)
        host, _, port = address.rpartition(":")
        try:
            self._server = foxglove.start_server(
                name="radarize", host=host or "127.0.0.1", port=int(port), context=context
            )
        except (OSError, ValueError, OverflowError, RuntimeError) as error:
            raise InputError(f"--foxglove {address}: {error}, expected HOST:PORT to listen on") from error
        self.url = f"ws://{host or '127.0.0.1'}:{self._server.port}"

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()


def _nanoseconds(time: float) -> int:
    return round(1e9 * time)


def _stamp(time: float) -> messages.Timestamp:
    return messages.Timestamp(*divmod(_nanoseconds(time), 10**9))


def _turn(yaw: float) -> messages.Quaternion:
    return messages.Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))


def _vector(values: Float[np.ndarray, "3"]) -> messages.Vector3:
    return messages.Vector3(x=float(values[0]), y=float(values[1]), z=float(values[2]))


def _quaternion(values: Float[np.ndarray, "4"]) -> messages.Quaternion:
    x, y, z, w = map(float, values)
    return messages.Quaternion(x=x, y=y, z=z, w=w)


def _pose(pose: Float[np.ndarray, "3"]) -> messages.Pose:
    position = messages.Vector3(x=float(pose[0]), y=float(pose[1]), z=0.0)
    return messages.Pose(position=position, orientation=_turn(float(pose[2])))
