"""Odometry of a recording, without SLAM."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from radarize.io.errors import InputError
from radarize.io.load import Source, frames_of
from radarize.io.trajectory import Trajectory
from radarize.io.tum import planar_poses
from radarize.odometry.integration import Track
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.config import Configuration
from radarize.pipeline.methods import ODOMETRY, choose_methods, make_odometry, make_scans
from radarize.pipeline.session import batches, inputs_of
from radarize.signal.batch import Preprocessor
from radarize.signal.polar import pictured


def estimate_odometry(
    frames: Source,
    method: str | None = None,
    *,
    scans: str | None = None,
    weights: str | Path | None = None,
    config: Configuration | str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Trajectory:
    """Estimate the motion of the radar frame by frame, without loop closure. ``rz.odometry`` is the same function.

    Args:
        frames: frames of a recording: ``rec``, a part of it ``rec[100:400]``, or every second frame ``rec[::2]``.
        method: a value of ``radarize run --odometry``, such as ``"fused"`` or ``"doppler"``; by default networks if
            they fit the radar, else ``"doppler"``, which has none.
        scans: method of the scans, for odometry that is computed from scans.
        weights: folder with network weights; by default the shipped ones.
        config: pipeline settings, or a YAML file of them (``radarize config`` prints all).
        progress: called with (frames done, frames in all).

    Returns:
        Poses at the frames' burst centres, starting at the origin, with velocities and covariances. Lost frames are
        left out.

    Raises:
        InputError: a recording without frames, an unknown method, or one that lacks weights, samples or an IMU.

    Example:
        >>> odometry = rz.odometry(rec, method="doppler")
        >>> odometry
        <odometry: 24 poses, ... m in 0.77 s>
        >>> odometry.velocity.shape, odometry.covariance.shape
        ((24, 2), (24, 3, 3))
    """
    frames = frames_of(frames)
    chosen, _ = choose_methods(
        frames.config, method, scans, own_weights=bool(weights), pictures=pictured(frames.recording)
    )
    inputs = inputs_of(frames, weights, configuration(config))
    estimator = make_odometry(inputs, chosen["odometry"])
    extractor = make_scans(inputs, chosen["scans"]) if ODOMETRY[chosen["odometry"]].scans else None
    tracks = []
    for batch in batches(frames, Preprocessor(inputs.signal, inputs.every), progress or (lambda done, total: None)):
        if batch:
            batch.ranges = extractor.extract(batch) if extractor else None
            tracks.append(estimator.update(batch))
    if not tracks:
        raise InputError(f"{frames.recording.path}: all its {len(frames)} frames are lost or silent, expected samples")
    return trajectory(tracks)


def configuration(config: Configuration | str | Path | None) -> Configuration:
    """Return settings of the pipeline, from a file if a path is given.

    Raises:
        InputError: the file is missing or malformed.
    """
    if config is None or isinstance(config, Configuration):
        return config or Configuration()
    return Configuration.load(config)


def trajectory(tracks: list[Track]) -> Trajectory:
    """Join tracks of consecutive batches to one trajectory."""

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(track, name) for track in tracks])

    pose, errors = joined("pose"), ErrorModel.joined([track.errors for track in tracks])
    return Trajectory(
        joined("time"), planar_poses(pose), errors.since_start(pose), joined("velocity"),
        joined("velocity_covariance"), name="odometry",
    )  # fmt: skip
