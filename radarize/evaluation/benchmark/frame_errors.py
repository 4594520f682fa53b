"""Velocities and yaws of a run's odometry with their covariances and the truth, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from radarize.evaluation.motion import turn_errors
from radarize.io.pose import Pose, wrap
from radarize.io.tum import planar
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.runfolder import RunFolder


@dataclass(frozen=True)
class FrameErrors:
    """Estimates of one method of odometry on one recording, with the truth.

    Attributes:
        velocity, true_velocity: in the sensor frame (forward, left), m/s.
        covariance: estimated covariance of `velocity`, m^2/s^2.
        poses: poses by odometry, x, y (m), yaw (rad).
        true_yaw: rad.
        errors: error model of the relative motions between poses.
        period: time between frames, s.
    """

    velocity: Float[np.ndarray, "frame 2"]
    covariance: Float[np.ndarray, "frame 2 2"]
    true_velocity: Float[np.ndarray, "frame 2"]
    poses: Pose
    true_yaw: Float[np.ndarray, "frame"]
    errors: ErrorModel
    period: float

    @classmethod
    def read(cls, run: Path) -> "FrameErrors":
        """Read the estimates and the truth from the folder of a run.

        Raises:
            InputError: a damaged file.
        """
        folder = RunFolder(run)
        assert folder.odometry is not None and folder.errors is not None  # every method of odometry leaves both
        scans, (times, poses) = folder.scans, folder.odometry
        return cls(
            scans["velocity"],
            scans["velocity_covariance"],
            scans["truth/velocity"][:, :2],
            planar(poses),
            true_poses(folder)[:, 2],
            folder.errors,
            float(np.median(np.diff(times))),
        )

    def yaw_errors(self, seconds: float) -> tuple[Float[np.ndarray, "window"], Float[np.ndarray, "window"]]:
        """Return errors of the change of yaw over all windows of a length in s (at least one frame), rad, and their
        estimated variances, rad^2."""
        window = max(round(seconds / self.period), 1)
        turns = wrap(np.diff(self.poses[:, 2], prepend=0.0))
        return turn_errors(turns, self.true_yaw, window), self.errors.turns(window)


def true_poses(run: RunFolder) -> Pose:
    """Return the true pose of each frame of a run. Frames that a recording has lost are in the truth alone."""
    assert run.odometry is not None  # whose poses are judged
    true, true_times, times = planar(run.scans["truth/pose"]), run.scans["truth/time"], run.odometry[0]
    return true if len(times) == len(true) else true[np.abs(true_times[:, None] - times).argmin(axis=0)]


def joined(found: Sequence[FrameErrors]) -> dict[str, np.ndarray]:
    """Concatenate the frames of several recordings, by attribute of `FrameErrors`."""
    names = [each.name for each in fields(FrameErrors) if each.name not in ("errors", "period")]
    return {name: np.concatenate([getattr(one, name) for one in found]) for name in names}


def joined_yaw_errors(found: Sequence[FrameErrors], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Concatenate `FrameErrors.yaw_errors` of several recordings."""
    errors, variances = zip(*(one.yaw_errors(seconds) for one in found), strict=True)
    return np.concatenate(errors), np.concatenate(variances)


def yaw_nees(found: Sequence[FrameErrors], seconds: float) -> float:
    """Return the mean NEES of changes of yaw over windows of a length in s; NaN without windows, infinite if a variance
    is zero."""
    errors, variances = map(pd.Series, joined_yaw_errors(found, seconds))
    return float((errors**2 / variances).mean())
