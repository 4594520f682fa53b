"""A recording, a run, or both as an MCAP file, which Foxglove opens; topics and frames as in `foxglove`."""

from collections.abc import Callable
from pathlib import Path

import foxglove
import numpy as np

from radarize.evaluation.foxglove import Messages
from radarize.evaluation.shownmaps import ShownMaps
from radarize.evaluation.viewer import opened
from radarize.io.recording import Recording
from radarize.io.replacing import replacing
from radarize.io.tum import planar
from radarize.pipeline.runfolder import RunFolder

_BATCH = 16


def write_mcap(
    source: Path,
    run: Path | None,
    output: Path,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Write a file.

    Args:
        source: a recording (``.h5``), of which heat maps are written, or a run's folder.
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


def _write_frames(shown: Messages, recording: Recording, progress: Callable[[int, int], None]) -> None:
    maps = ShownMaps(recording)
    times = recording.times + recording.config.burst_center
    for first in range(0, len(recording), _BATCH):
        last = min(first + _BATCH, len(recording))
        for name, images in maps.of(first, last).items():
            for time, pixels in zip(times[first:last], images, strict=True):
                shown.picture(float(time), name, pixels)
        progress(last, len(recording))
