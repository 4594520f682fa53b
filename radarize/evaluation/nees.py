"""Normalised estimation error squared (NEES): whether errors agree with their estimated covariances."""

import numpy as np
from evo.core.trajectory import PoseTrajectory3D
from jaxtyping import Float

from radarize.evaluation.metrics import TrajectoryErrors
from radarize.io.alignment import yaws
from radarize.io.pose import between

#: s from the start of a trajectory, left out because poses have next to no uncertainty there.
EARLY = 5.0


def nees(
    errors: Float[np.ndarray, "sample axis"], covariances: Float[np.ndarray, "sample axis axis"]
) -> Float[np.ndarray, "sample"]:
    """Return the NEES of each sample, divided by the number of dimensions: its mean is 1 if covariances are consistent.

    Raises:
        np.linalg.LinAlgError: a covariance is singular.
    """
    whitened = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return (errors * whitened).sum(axis=1) / errors.shape[1]


def pose_nees(
    errors: TrajectoryErrors, times: Float[np.ndarray, "pose"], covariances: Float[np.ndarray, "covariance 3 3"]
) -> float:
    """Return the mean NEES per dimension of the motion since the first pose: 1 if its covariances are consistent.

    Args:
        errors: errors of the trajectory.
        times: time stamps of all of its poses, s.
        covariances: covariance of (x, y, yaw) of each pose, in the frame of that pose, given the first pose.

    Returns:
        NaN if no pose is more than `EARLY` after the start, or if a covariance is missing or singular.
    """
    late = errors.time > times[0] + EARLY
    if not late.any() or len(covariances) != len(times):
        return float("nan")
    estimated = covariances[np.searchsorted(times, errors.time[late])]
    if not (np.isfinite(estimated).all() and (np.linalg.det(estimated) > 0).all()):
        return float("nan")
    estimate, truth = (_since_start(some)[late] for some in (errors.estimate, errors.reference))
    return float(nees(between(truth, estimate), estimated).mean())


def _since_start(poses: PoseTrajectory3D) -> Float[np.ndarray, "pose 3"]:
    planar = np.column_stack([poses.positions_xyz[:, :2], yaws(poses)])
    return between(planar[:1], planar)
