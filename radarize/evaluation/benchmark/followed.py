"""Odometry frame by frame: velocities and turns of a run beside the truth, and what it claims to know of them."""

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
    """One recording by one method.

    Attributes:
        velocity, true_velocity: m/s, sensor frame; covariance: claimed, m^2/s^2.
        poses: by odometry; true_yaw: rad.
        errors: of their steps.
        period: s, from frame to frame.
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
        """From a run's folder.

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

    def turned(self, seconds: float) -> tuple[Float[np.ndarray, "window"], Float[np.ndarray, "window"]]:
        """Errors of the yaw over all windows of a span (one frame at least), rad, and their claimed variance, rad^2."""
        window = max(round(seconds / self.period), 1)
        turns = wrap(np.diff(self.poses[:, 2], prepend=0.0))
        return turn_errors(turns, self.true_yaw, window), self.errors.turns(window)


def true_poses(run: RunFolder) -> Pose:
    """True poses of a run's frames: truth has one for every frame, a run one for every frame that was not lost."""
    assert run.odometry is not None  # whose poses are judged
    true, true_times, times = planar(run.scans["truth/pose"]), run.scans["truth/time"], run.odometry[0]
    return true if len(times) == len(true) else true[np.abs(true_times[:, None] - times).argmin(axis=0)]


def joined(found: Sequence[FrameErrors]) -> dict[str, np.ndarray]:
    """Frames of several recordings, one after the other, by attribute."""
    names = [each.name for each in fields(FrameErrors) if each.name not in ("errors", "period")]
    return {name: np.concatenate([getattr(one, name) for one in found]) for name in names}


def turned(found: Sequence[FrameErrors], seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """`FrameErrors.turned` of several recordings, one after the other."""
    errors, claims = zip(*(one.turned(seconds) for one in found), strict=True)
    return np.concatenate(errors), np.concatenate(claims)


def turn_nees(found: Sequence[FrameErrors], seconds: float) -> float:
    """Mean squared error of `turned` over its claims; NaN without any, infinite where nothing is claimed."""
    errors, claims = map(pd.Series, turned(found, seconds))
    return float((errors**2 / claims).mean())
