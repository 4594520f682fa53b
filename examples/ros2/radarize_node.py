"""A ROS 2 node: radar SLAM on a real radar, or on a recording in real time.

    /scan  LaserScan, in `radar`        /odom  Odometry        /map  OccupancyGrid, latched
    /tf    map -> odom -> base_link; the launch file gives the pose of the radar on base_link

Parameters: `config` (a preset or a .cfg) and `port` of a radar, or `replay` (a recording); `odometry` and `scans`
(methods; those of choice for the radar if empty). It is a file rather than a package, for rclpy comes with ROS and not
with pip: install radarize into the Python that ROS uses, and see docs/howto/ros2.md.
"""

import math
import threading

import numpy as np
import rclpy
from geometry_msgs.msg import Pose, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from radarize.capture.live import TOGETHER, prepare
from radarize.capture.replay import Replay
from radarize.capture.sensor import Sensor
from radarize.capture.stream import follow
from radarize.io.pose import between, compose, inverse
from radarize.odometry.uncertainty import MotionCovariance
from radarize.pipeline.method import Inputs
from radarize.pipeline.methods import choose_methods, make_pipeline, pace
from radarize.pipeline.runfolder import OccupancyMap
from radarize.radar.presets import load_config
from radarize.signal.batch import Preprocessor
from radarize.signal.bearings import BEARINGS

MAP, ODOM, BASE, RADAR = "map", "odom", "base_link", "radar"
#: s between maps.
MAP_INTERVAL = 2.0
#: A ROS message's covariance has x y z roll pitch yaw; a planar pose has these.
PLANE = np.ix_([0, 1, 5], [0, 1, 5])


class RadarizeNode(Node):
    """Publishes what the pipeline finds."""

    def __init__(self):
        super().__init__("radarize")
        given = {
            name: self.declare_parameter(name, "").value for name in ("replay", "config", "port", "odometry", "scans")
        }
        if given["replay"]:
            self.stream = Replay(given["replay"])
        else:
            config, text = load_config(given["config"] or "radarize")
            self.stream = Sensor(config, text, given["config"] or "radarize", given["port"])
        radar = self.stream.config
        methods, _ = choose_methods(radar, given["odometry"], given["scans"])
        self.inputs = prepare(Inputs(radar, every=pace(methods["odometry"], radar)), methods)
        self.pipeline = make_pipeline(self.inputs, **methods, endless=True)
        self.scans = self.create_publisher(LaserScan, "scan", 10)
        self.odometry = self.create_publisher(Odometry, "odom", 10)
        self.transforms = self.create_publisher(TFMessage, "/tf", 10)
        self.maps = self.create_publisher(OccupancyGrid, "map", latched())
        self._map_due = -math.inf
        self._motion: MotionCovariance | None = None  # since the first frame

    def run(self, stopping: threading.Event) -> None:
        """Follow the radar until it ends or ROS does."""
        preprocessor = Preprocessor(self.inputs.signal, self.inputs.every)
        with self.stream:
            for came in follow(self.stream, stopping, most=TOGETHER):
                if batch := preprocessor.process(came["adc"], came["time"], came["valid"]):
                    self.publish(self.pipeline.push(batch), batch.centers)
                if not rclpy.ok():
                    stopping.set()

    def publish(self, result, stamps: np.ndarray) -> None:
        """Send what a batch gave; stamps are of its frames' scans, s."""
        radar, slam, track = self.inputs.radar, self.pipeline.slam, result.track
        for ranges, stamp in zip(result.ranges, stamps, strict=True):
            self.scans.publish(scan_message(float(stamp), ranges, radar.max_range, radar.frame_period))
        if not len(track.pose):
            return
        for k, step in enumerate(track.step):
            if self._motion is None:
                self._motion = MotionCovariance(track.errors.variance[k])
            else:
                self._motion.step(step, track.errors[k])
        stamp, pose = float(track.time[-1]), track.pose[-1]
        self.odometry.publish(odometry_message(stamp, pose, track.velocity[-1], self._motion.covariance))
        node = slam.nodes[-1] if slam.nodes else None
        on_map = compose(slam.graph.poses[-1], between(slam.odometry.pose(node.time), pose)) if node else pose
        links = [transform(stamp, MAP, ODOM, compose(on_map, inverse(pose))), transform(stamp, ODOM, BASE, pose)]
        self.transforms.publish(TFMessage(transforms=links))
        if node and stamp >= self._map_due:
            self.maps.publish(map_message(stamp, OccupancyMap.of(slam.map())))
            self._map_due = stamp + MAP_INTERVAL


def latched() -> QoSProfile:
    """Who subscribes later gets the last map, too."""
    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def stamped(message, stamp: float, frame: str):
    """A message with its header filled in; `stamp` in s."""
    message.header.stamp = Time(nanoseconds=round(1e9 * stamp)).to_msg()
    message.header.frame_id = frame
    return message


def scan_message(stamp: float, ranges: np.ndarray, farthest: float, period: float) -> LaserScan:
    """A scan on `BEARINGS`, m, inf where nothing is seen (REP 117)."""
    scan = stamped(LaserScan(), stamp, RADAR)
    scan.angle_min, scan.angle_max = float(BEARINGS[0]), float(BEARINGS[-1])
    scan.angle_increment = float(BEARINGS[1] - BEARINGS[0])
    scan.range_min, scan.range_max, scan.scan_time = 0.05, float(farthest), float(period)
    scan.ranges = [float(each) for each in ranges]
    return scan


def odometry_message(stamp: float, pose: np.ndarray, velocity: np.ndarray, covariance: np.ndarray) -> Odometry:
    """Odometry: a pose in `odom`, m and rad; velocity, m/s, and the pose's covariance on the axes of `base_link`."""
    message = stamped(Odometry(), stamp, ODOM)
    message.child_frame_id = BASE
    place(message.pose.pose, pose)
    message.twist.twist.linear.x, message.twist.twist.linear.y = map(float, velocity[:2])
    c, s = math.cos(pose[2]), math.sin(pose[2])
    axes = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])  # the message wants it on those of `odom`
    spread = np.zeros((6, 6))
    spread[PLANE] = axes @ covariance @ axes.T
    message.pose.covariance = spread.reshape(-1).tolist()
    return message


def transform(stamp: float, frame: str, child: str, pose: np.ndarray) -> TransformStamped:
    """Where a frame is in another, m and rad."""
    link = stamped(TransformStamped(), stamp, frame)
    link.child_frame_id = child
    link.transform.translation.x, link.transform.translation.y = map(float, pose[:2])
    turn(link.transform.rotation, float(pose[2]))
    return link


def map_message(stamp: float, found: OccupancyMap) -> OccupancyGrid:
    """A map of 0 (free), 100 (occupied) and -1 (unknown), the row of smallest y first."""
    message = stamped(OccupancyGrid(), stamp, MAP)
    message.info.map_load_time = message.header.stamp
    message.info.resolution = float(found.resolution)
    message.info.height, message.info.width = found.pixels.shape
    place(message.info.origin, np.array(found.origin))
    cells = np.where(found.occupied, 100, np.where(found.free, 0, -1))[::-1]
    message.data = [int(cell) for cell in cells.reshape(-1)]
    return message


def place(message: Pose, pose: np.ndarray) -> None:
    """Fill in a planar pose."""
    message.position.x, message.position.y = map(float, pose[:2])
    turn(message.orientation, float(pose[2]))


def turn(message, yaw: float) -> None:
    """Fill in a quaternion about z."""
    message.z, message.w = math.sin(yaw / 2), math.cos(yaw / 2)


def main() -> None:
    """Entry point: `python3 radarize_node.py --ros-args -p replay:=walk.h5`."""
    rclpy.init()
    node = RadarizeNode()
    try:
        node.run(threading.Event())
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
