"""Poses of the rig of a real walk (`radarize.baselines.walks.walks`): from a file, or by SLAM with the lidar."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.baselines.walks.clock import Clock
from radarize.baselines.walks.walks import PERIOD, Walk
from radarize.io.errors import InputError
from radarize.io.pose import wrap
from radarize.io.tum import planar, read_tum
from radarize.signal import polar
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

#: Bearings of scans made from point clouds, rad.
BEARINGS = np.radians(np.linspace(-90, 90, 181))
#: Only every N-th scan is used by SLAM without odometry, where scan matching has to search widely.
EVERY = 2


def poses_of(walk: Walk, folder: Path | str | None) -> Float[np.ndarray, "frame 3"]:
    """Return `true_poses` of a folder, or `lidar_poses` if no folder is given."""
    return true_poses(Path(folder), walk) if folder else lidar_poses(walk)


def true_poses(folder: Path, walk: Walk) -> Float[np.ndarray, "frame 3"]:
    """Read x, y (m), yaw (rad) of each frame of a walk from FOLDER/NUMBER.tum, whose time starts at the first frame.

    Raises:
        InputError: no such file, or a frame without a pose.
    """
    path = Path(folder) / f"{walk.number}.tum"
    times, poses = read_tum(path)
    frames = np.rint(times / PERIOD).astype(int)
    if not set(range(walk.frames)) <= set(frames.tolist()):
        raise InputError(f"{path}: has {len(times)} poses, expected one every {PERIOD} s for {walk.frames} frames")
    found = np.empty((walk.frames, 3))
    inside = (frames >= 0) & (frames < walk.frames)
    found[frames[inside]] = planar(poses)[inside]
    return found


def lidar_poses(
    walk: Walk, progress: Callable[[int, int], None] = lambda done, total: None
) -> Float[np.ndarray, "frame 3"]:
    """Estimate x, y (m), yaw (rad) of each frame by SLAM with the lidar's scans; `progress` takes frames done and in
    all."""
    slam = Slam(SlamConfig.preset("lidar"))
    for frame in range(0, walk.frames, EVERY):
        slam.add_scan(PERIOD * frame, BEARINGS, scan(polar.cartesian(walk.lidar(frame))))
        progress(frame, walk.frames)
    slam.finish()
    return at(stamps(walk.frames), *slam.trajectory())


def stamps(frames: int) -> Float[np.ndarray, "frame"]:
    """Return the time of each frame of a walk since the first one, s."""
    return PERIOD * np.arange(frames)


def at(
    times: Float[np.ndarray, "instant"], known: Float[np.ndarray, "pose"], poses: Float[np.ndarray, "pose 3"]
) -> Float[np.ndarray, "instant 3"]:
    """Interpolate poses x, y (m), yaw (rad) at some times (s)."""
    columns = poses[:, 0], poses[:, 1], np.unwrap(poses[:, 2])
    x, y, yaw = (np.interp(times, known, column) for column in columns)
    return np.column_stack([x, y, wrap(yaw)])


def matched_by_time(poses: Float[np.ndarray, "frame 3"], clock: Clock) -> Float[np.ndarray, "frame 3"]:
    """Interpolate the poses of the lidar's frames at the times of the radar's frames; NaN outside of the lidar's."""
    frames = clock.lidar(np.arange(len(poses)))
    found = at(PERIOD * frames, stamps(len(poses)), poses)
    found[(frames < 0) | (frames > len(poses) - 1)] = np.nan
    return found


def scan(points: Float[np.ndarray, "point 2"]) -> Float[np.ndarray, "bearing"]:
    """Return the range of the nearest point on each of `BEARINGS`, m; inf on bearings without a point."""
    found = np.full(len(BEARINGS), np.inf)
    bearing = np.arctan2(points[:, 1], points[:, 0])
    column = np.rint((bearing - BEARINGS[0]) / (BEARINGS[1] - BEARINGS[0])).astype(int)
    np.minimum.at(found, column.clip(0, len(BEARINGS) - 1), np.hypot(*points.T))
    return found
