"""Export of a recording, a run, or both to an MCAP file for Foxglove; topics and frames as in `foxglove`."""

from collections.abc import Callable
from pathlib import Path

import foxglove
import numpy as np

from radarize.evaluation.foxglove import Messages
from radarize.evaluation.shownmaps import ShownMaps
from radarize.evaluation.viewer import PATH_TYPE_COLORS, opened
from radarize.io.pose import NOWHERE, OPTICAL_TURN, frame_between
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.io.tum import planar
from radarize.pipeline.runfolder import RunFolder
from radarize.signal.points import COLUMNS

_BATCH = 16
CAMERA, OPTICAL = "camera_depth_frame", "camera_depth_optical_frame"
#: Colours of path types by label, red, green, blue; noise (255) and unknown labels are black.
_COLORS = [tuple(bytes.fromhex(color[1:])) for color in PATH_TYPE_COLORS]
_PALETTE = np.array([*_COLORS, (0, 0, 0)], np.uint8)


def write_mcap(
    source: Path,
    run: Path | None,
    output: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write an MCAP file.

    Args:
        source: a recording (``.h5``), of which heat maps are written and, if it has them, true poses, depth pictures,
            points and path types; or the folder of a run.
        run: run of the recording: poses, path, map and scans.
        output: file to write (``.mcap``).
        progress: called with (frames done, frames in all).

    Raises:
        InputError: unusable source, or the file cannot be written.
    """
    context = foxglove.Context()
    shown = Messages(context)
    with opened(source, run) as (recording, folder), replacing(output) as part:
        with foxglove.open_mcap(part, allow_overwrite=True, context=context):
            if folder is not None:
                _write_run(shown, folder)
            if recording is not None:
                _write_truth(shown, recording, folder)
                _write_frames(shown, recording, progress)
    return output


def _write_run(shown: Messages, run: RunFolder) -> None:
    times, slam = run.trajectory
    poses, followed = planar(slam), np.zeros((len(times), 3))
    if run.odometry is not None:
        at = np.searchsorted(run.odometry[0], times).clip(0, len(run.odometry[0]) - 1)
        followed = planar(run.odometry[1])[at]
    for time, pose, moved in zip(times, poses, followed, strict=True):
        shown.pose(float(time), pose, moved)
    shown.path(float(times[0]), poses)
    if run.map is not None:
        shown.map(float(times[0]), run.map)
    if run.scans:
        for time, ranges in zip(run.scans["time"], run.scans["ranges"], strict=True):
            shown.scan(float(time), ranges, run.scans["azimuths"])


def _write_truth(shown: Messages, recording: Recording, run: RunFolder | None) -> None:
    """Write true poses and path. With odometry, the frame `world` is fixed in `odom` by the first pose; without it,
    `world` moves relative to the radar, as in ROS 2 bags (`radarize.io.exporters.ros2`)."""
    truth = recording.true_poses()
    start = float(recording.times[0] + recording.config.burst_center)
    if recording.has("truth/depth_mount"):
        optical = (CAMERA, OPTICAL, np.array([0.0, 0, 0, *OPTICAL_TURN]))
        shown.links(start, [("base_link", CAMERA, recording.read("truth/depth_mount")), optical])
    if truth is None or not len(truth[0]):
        return
    times, poses = truth
    shown.true_path(float(times[0]), poses)
    odometry = None if run is None else run.odometry
    if odometry is not None and len(odometry[0]):
        k = int(np.abs(odometry[0] - times[0]).argmin())
        shown.links(float(times[0]), [("odom", "world", frame_between(odometry[1][k], poses[0]))])
    elif run is None:
        shown.links(start, [("base_link", "radar", NOWHERE)])
    for time, pose in zip(times, poses, strict=True):
        own = [("base_link", "world", frame_between(NOWHERE, pose))] if run is None else []
        shown.links(float(time), [("world", "truth", pose), *own])


def _write_frames(shown: Messages, recording: Recording, progress: Callable[[int, int], None]) -> None:
    maps = ShownMaps(recording)
    times = recording.times + recording.config.burst_center
    for first in range(0, len(recording), _BATCH):
        last = min(first + _BATCH, len(recording))
        for name, images in maps.of(first, last).items():
            for time, pixels in zip(times[first:last], images, strict=True):
                shown.picture(float(time), name, pixels)
        for k in range(first, last):
            _write_sensors(shown, recording, k, float(times[k]))
        progress(last, len(recording))


def _write_sensors(shown: Messages, recording: Recording, frame: int, time: float) -> None:
    """Write path types, depth picture and points of a frame, if the recording has them."""
    if recording.has("truth/cause"):
        cause = recording.rows("truth/cause", frame, frame + 1)[0, ::-1, ::-1]
        shown.picture(time, "cause", _PALETTE[np.minimum(cause, len(_PALETTE) - 1)])
    if recording.has("truth/depth"):
        known = recording.has("truth/depth_intrinsics")
        lens = recording.read("truth/depth_intrinsics") if known else None
        shown.depth(time, recording.rows("truth/depth", frame, frame + 1)[0], lens)
    if recording.has("points/frame") and recording.has("points/cloud"):
        shown.points(time, recording.rows("points/cloud", frame, frame + 1), COLUMNS)
