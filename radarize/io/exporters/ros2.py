"""Export of a recording and its run as a ROS 2 bag, for Cartographer, slam_toolbox, RViz and others.

    of a run        /scan  LaserScan        /odom  Odometry        /tf  odom -> base_link
    of a recording  /radar/heatmap  PointCloud2 of the range-azimuth map, intensity in dB
                    /radar/points  PointCloud2        /imu  Imu        /camera/depth/image_rect_raw, camera_info
                    /truth/odom  Odometry, the truth as far as it is known        /tf  world -> truth
    always          /tf_static  base_link -> radar, imu, camera_depth_frame -> camera_depth_optical_frame

``base_link`` is the radar: x forward, y left, z up (REP 103). ``map`` is left to the SLAM program. The frames of the
truth are below: with a run, ``odom -> world`` is fixed such that both coincide at the start, so that drift is visible;
without a run, ``base_link -> world`` places base_link at the true pose. In either case ``map -> odom`` of a SLAM
program does not conflict with a second parent.

Stamps near zero, as of a simulator, are shifted by 1,700,000,000 s (14 November 2023), since ROS treats a zero stamp as
unset.
"""

import heapq
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarize.io.exporters.bagwriter import BagWriter, Message, header, message, vector
from radarize.io.pose import NOWHERE, OPTICAL_TURN, between, frame_between
from radarize.io.recording import Recording
from radarize.io.tum import planar_poses
from radarize.pipeline.log import Log
from radarize.radar.config import RadarConfig
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import COLUMNS

#: Time (s), topic, message.
Event = tuple[float, str, Message]
BASE, ODOM, RADAR, WORLD, TRUTH = "base_link", "odom", "radar", "world", "truth"
#: s, added to stamps of the first day of 1970; length of that day.
EPOCH, _DAY = 1_700_000_000.0, 86_400.0
CAMERA, OPTICAL = "camera_depth_frame", "camera_depth_optical_frame"
_BATCH = 16
_FLOAT32 = 7
#: Data sets with the pose of a sensor on the radar, and its coordinate frame.
_MOUNTS = {"imu/mount": "imu", "truth/depth_mount": CAMERA}


def export_ros2(
    source: Path,
    output: Path,
    *,
    run: Path | None = None,
    time_offset: float | None = None,
    progress: Callable[[int, int], None],
) -> Path:
    """Write a bag from a recording, a run folder, or a recording and its run; see `exporters.export`.

    Raises:
        InputError: unusable source, a run of another recording, or `output` exists.
    """
    if source.is_dir():
        if run is not None:
            raise InputError(f"{source}: is a run's folder, and {run} another, expected a recording and a run")
        log = Log.read(source)
        bag = BagWriter(output, stamp_offset(log.times, time_offset))
        return _write(bag, [_scans(log, None), _odometry(log)], [], "/scan", partial(_report, progress, len(log.times)))
    log_of_run = Log.read(run) if run is not None else None
    with Recording(source) as recording:
        if not len(recording):
            raise InputError(f"{source}: has no whole frame, expected at least one")
        streams = [_heatmaps(recording), _depth(recording), _inertial(recording), _points(recording)]
        mounts = _mounts(recording)
        if run is not None and log_of_run is not None:
            _check_pair(recording, log_of_run, run)
            streams += [_scans(log_of_run, recording.config), _odometry(log_of_run)]
            mounts += _world(recording, log_of_run)
        streams.append(_truth(recording, BASE if log_of_run is None else None))
        bag = BagWriter(output, stamp_offset(recording.times, time_offset))
        return _write(bag, streams, mounts, "/radar/heatmap", partial(_report, progress, len(recording)))


def stamp_offset(times: Float[np.ndarray, "frame"], given: float | None) -> float:
    """Return the time added to stamps, s, see `exporters.export`."""
    return given if given is not None else EPOCH if len(times) and abs(times[0]) < _DAY else 0.0


def _report(progress: Callable[[int, int], None], total: int, done: int) -> None:
    progress(done, total)


def _write(
    bag: BagWriter,
    streams: list[Iterator[Event]],
    mounts: list[tuple[str, str, np.ndarray]],
    counted: str,
    report: Callable[[int], None],
) -> Path:
    """Merge streams by time and write them; report progress by the messages of one topic."""
    done, placed = 0, False
    with bag:
        for time, topic, content in heapq.merge(*streams, key=lambda event: event[0]):
            if not placed:
                static = [_transform(time, *mount) for mount in ((BASE, RADAR, NOWHERE), *mounts)]
                bag.write("/tf_static", time, message("tf2_msgs/msg/TFMessage", transforms=static))
                placed = True
            bag.write(topic, time, content)
            if topic == counted:
                done += 1
                report(done)
    return bag.path


def _check_pair(recording: Recording, log: Log, run: Path) -> None:
    middle = _middles(recording)
    if len(log.times) != len(middle) or np.abs(log.times - middle).max() > recording.config.frame_period:
        raise InputError(
            f"{run}: has {len(log.times)} scans from {log.times[0]:.3f} s on, expected the run of {recording.path} "
            f"with {len(middle)} frames from {middle[0]:.3f} s on"
        )


# --- of a run ---------------------------------------------------------------------------------------------------------
def _scans(log: Log, config: RadarConfig | None) -> Iterator[Event]:
    """Yield a LaserScan per frame; inf means no echo, as in REP 117."""
    seen = log.ranges[np.isfinite(log.ranges)]
    farthest = config.max_range if config else float(seen.max(initial=0)) + 0.1
    step = float(log.azimuths[1] - log.azimuths[0])
    period = float(np.median(np.diff(log.times))) if len(log.times) > 1 else 0.0
    for time, ranges in zip(log.times, log.ranges, strict=True):
        yield time, "/scan", message(
            "sensor_msgs/msg/LaserScan", header=header(time, RADAR), angle_min=float(log.azimuths[0]),
            angle_max=float(log.azimuths[-1]), angle_increment=step, time_increment=0.0, scan_time=period,
            range_min=0.05, range_max=farthest, ranges=ranges.astype(np.float32), intensities=np.zeros(0, np.float32),
        )  # fmt: skip


def _odometry(log: Log) -> Iterator[Event]:
    """Yield odometry, with covariances of the pose since the start and of the velocity since the previous pose, and its
    transform. The first pose has the velocity of the second."""
    count = len(log.odometry)
    poses, spreads = planar_poses(log.odometry), np.zeros((count, 3, 3))
    velocities, velocity_spreads = np.zeros((count, 3)), np.zeros((count, 3, 3))
    if count > 1:
        span = np.diff(log.odometry_times)[:, None]
        velocities[1:] = between(log.odometry[:-1], log.odometry[1:]) / span
        if log.errors is not None:
            spreads = log.errors.since_start(log.odometry)
            steps = log.errors.motions(log.odometry, np.arange(count - 1), 1)
            velocity_spreads[1:] = steps / span[..., None] ** 2
        velocities[0], velocity_spreads[0] = velocities[1], velocity_spreads[1]
    for k, (time, pose) in enumerate(zip(log.odometry_times, log.odometry, strict=True)):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])  # on the axes of the odometry's own frame
        twist = np.array([*velocities[k, :2], 0, 0, 0, velocities[k, 2]])
        spread = np.stack([turn @ spreads[k] @ turn.T, velocity_spreads[k]])
        yield time, "/odom", _odometry_message(time, (ODOM, BASE), poses[k], twist, spread)
        yield time, "/tf", message("tf2_msgs/msg/TFMessage", transforms=[_transform(time, ODOM, BASE, poses[k])])


def _odometry_message(
    time: float,
    frames: tuple[str, str],
    pose: Float[np.ndarray, "7"],
    twist: Float[np.ndarray, "6"],
    spread: Float[np.ndarray, "2 3 3"],
) -> Message:
    """Return odometry of the second frame in the first, with covariances of x, y and yaw of pose and twist."""
    covariance = np.zeros((2, 6, 6))
    covariance[np.ix_([0, 1], [0, 1, 5], [0, 1, 5])] = spread
    place = message(
        "geometry_msgs/msg/Pose", position=vector(pose[:3], "Point"), orientation=vector(pose[3:], "Quaternion")
    )
    motion = message("geometry_msgs/msg/Twist", linear=vector(twist[:3]), angular=vector(twist[3:]))
    return message(
        "nav_msgs/msg/Odometry", header=header(time, frames[0]), child_frame_id=frames[1],
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=place, covariance=covariance[0].reshape(-1)),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=motion, covariance=covariance[1].reshape(-1)),
    )  # fmt: skip


def _transform(time: float, frame: str, child: str, pose: Float[np.ndarray, "7"]) -> Message:
    place = {"translation": vector(pose[:3]), "rotation": vector(pose[3:], "Quaternion")}
    motion = message("geometry_msgs/msg/Transform", **place)
    stamp = header(time, frame)
    return message("geometry_msgs/msg/TransformStamped", header=stamp, child_frame_id=child, transform=motion)


# --- of a recording ---------------------------------------------------------------------------------------------------
def _middles(recording: Recording) -> Float[np.ndarray, "frame"]:
    """Return stamps of the middle of the bursts, s, the time that frames refer to."""
    return recording.times + recording.config.burst_center


def _mounts(recording: Recording) -> list[tuple[str, str, np.ndarray]]:
    """Return the poses of other sensors on the radar, if the recording has them."""
    found = [(BASE, frame, recording.read(name)) for name, frame in _MOUNTS.items() if recording.has(name)]
    return [*found, (CAMERA, OPTICAL, np.array([0.0, 0, 0, *OPTICAL_TURN]))]


def _heatmaps(recording: Recording) -> Iterator[Event]:
    maps = Heatmaps(recording.config)
    r, a = np.meshgrid(maps.ranges, maps.azimuths, indexing="ij")
    cells = np.stack([r * np.cos(a), r * np.sin(a), np.zeros_like(r), np.zeros_like(r)], -1).astype(np.float32)
    for frames, adc in recording.batches(_BATCH):
        power = maps.range_azimuth(adc, recording.valid(frames.start, frames.stop)).numpy()
        decibels = 10 * np.log10(np.maximum(np.nan_to_num(power), 1e-9))
        for time, picture in zip(_middles(recording)[frames], decibels, strict=True):
            cells[..., 3] = picture
            yield time, "/radar/heatmap", _cloud(time, cells, ("x", "y", "z", "intensity"))


def _points(recording: Recording) -> Iterator[Event]:
    if not (recording.has("points/frame") and recording.has("points/cloud")):
        return
    for k, time in enumerate(_middles(recording)):
        cloud = recording.rows("points/cloud", k, k + 1).astype(np.float32)
        yield time, "/radar/points", _cloud(time, cloud[None], COLUMNS)


def _cloud(time: float, cells: Float[np.ndarray, "row column field"], names: tuple[str, ...]) -> Message:
    fields = [
        message("sensor_msgs/msg/PointField", name=name, offset=4 * k, datatype=_FLOAT32, count=1)
        for k, name in enumerate(names)
    ]
    height, width, count = cells.shape
    return message(
        "sensor_msgs/msg/PointCloud2", header=header(time, RADAR), height=height, width=width, fields=fields,
        is_bigendian=False, point_step=4 * count, row_step=4 * count * width, is_dense=bool(np.isfinite(cells).all()),
        data=np.frombuffer(cells.astype("<f4").tobytes(), np.uint8),
    )  # fmt: skip


def _truth(recording: Recording, base: str | None) -> Iterator[Event]:
    """Yield the truth as odometry and as a transform; the world is placed relative to `base` if given."""
    if not (recording.has("truth/pose") and recording.has("truth/time")):
        return
    times, poses = recording.read("truth/time"), recording.read("truth/pose")
    twists = recording.read("truth/velocity") if recording.has("truth/velocity") else np.zeros((len(times), 6))
    for time, pose, twist in zip(times, poses, twists, strict=False):
        if np.isfinite(pose).all():
            yield time, "/truth/odom", _odometry_message(time, (WORLD, TRUTH), pose, twist, np.zeros((2, 3, 3)))
            links = [_transform(time, WORLD, TRUTH, pose)]
            if base is not None:
                links.append(_transform(time, base, WORLD, frame_between(NOWHERE, pose)))
            yield time, "/tf", message("tf2_msgs/msg/TFMessage", transforms=links)


def _world(recording: Recording, log: Log) -> list[tuple[str, str, np.ndarray]]:
    """Return the pose of the world in the odometry frame: both coincide at the first odometry pose with known truth."""
    truth = recording.true_poses()
    if truth is None or not len(truth[0]) or not len(log.odometry):
        return []
    k = int(np.abs(log.odometry_times - truth[0][0]).argmin())
    return [(ODOM, WORLD, frame_between(planar_poses(log.odometry[k : k + 1])[0], truth[1][0]))]


def _depth(recording: Recording) -> Iterator[Event]:
    """Yield depth images in mm, each with the camera's pinhole model."""
    if not recording.has("truth/depth"):
        return
    pinhole = recording.read("truth/depth_intrinsics") if recording.has("truth/depth_intrinsics") else None
    for k, time in enumerate(_middles(recording)):
        picture = recording.rows("truth/depth", k, k + 1)[0]
        height, width = picture.shape
        about = header(time, OPTICAL)
        yield time, "/camera/depth/image_rect_raw", message(
            "sensor_msgs/msg/Image", header=about, height=height, width=width, encoding="16UC1", is_bigendian=0,
            step=2 * width, data=np.frombuffer(picture.astype("<u2").tobytes(), np.uint8),
        )  # fmt: skip
        if pinhole is not None:
            yield time, "/camera/depth/camera_info", _camera_info(about, width, height, pinhole)


def _camera_info(about: Message, width: int, height: int, pinhole: Float[np.ndarray, "4"]) -> Message:
    fx, fy, cx, cy = map(float, pinhole)
    region = message("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return message(
        "sensor_msgs/msg/CameraInfo", header=about, height=height, width=width, distortion_model="plumb_bob",
        d=np.zeros(5), k=np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1]), r=np.eye(3).reshape(-1),
        p=np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0]), binning_x=0, binning_y=0, roi=region,
    )  # fmt: skip


def _inertial(recording: Recording) -> Iterator[Event]:
    if not recording.has("imu/time"):
        return
    level = vector(np.array([0, 0, 0, 1]), "Quaternion")
    unknown = np.array([-1.0, *[0] * 8])  # no orientation: sensor_msgs/Imu
    for k in range(len(recording)):
        columns = (recording.rows(f"imu/{name}", k, k + 1) for name in ("time", "accelerometer", "gyroscope"))
        for time, force, turn in zip(*columns, strict=True):
            yield time, "/imu", message(
                "sensor_msgs/msg/Imu", header=header(time, "imu"), orientation=level,
                orientation_covariance=unknown, angular_velocity=vector(turn), angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(force), linear_acceleration_covariance=np.zeros(9),
            )  # fmt: skip
