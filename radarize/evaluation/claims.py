"""Whether estimates are as far from the truth as they say."""

import numpy as np
from evo.core.trajectory import PoseTrajectory3D
from jaxtyping import Float

from radarize.evaluation.metrics import TrajectoryErrors
from radarize.io.alignment import yaws
from radarize.io.pose import between

#: s from the start on, in which hardly anything is uncertain yet.
EARLY = 5.0


def normalised(
    errors: Float[np.ndarray, "sample axis"], covariances: Float[np.ndarray, "sample axis axis"]
) -> Float[np.ndarray, "sample"]:
    """Squared errors in units of their covariances, per dimension: 1 on average if these are honest.

    Raises:
        np.linalg.LinAlgError: a covariance is singular.
    """
    whitened = np.linalg.solve(covariances, errors[..., None])[..., 0]
    return (errors * whitened).sum(axis=1) / errors.shape[1]


def pose_nees(
    errors: TrajectoryErrors, times: Float[np.ndarray, "pose"], covariances: Float[np.ndarray, "claim 3 3"]
) -> float:
    """Mean squared error of the way since the start in units of its covariance, per dimension: 1 if claims are honest.

    Args:
        errors: of the trajectory.
        times: of all its poses, s.
        covariances: of each pose, (x, y, yaw) in its own frame, given the first.

    Returns:
        NaN where nothing lies more than `EARLY` after the start, or where there is no covariance.
    """
    late = errors.time > times[0] + EARLY
    if not late.any() or len(covariances) != len(times):
        return float("nan")
    claimed = covariances[np.searchsorted(times, errors.time[late])]
    if not (np.isfinite(claimed).all() and (np.linalg.det(claimed) > 0).all()):
        return float("nan")
    estimate, truth = (_since_start(some)[late] for some in (errors.estimate, errors.reference))
    return float(normalised(between(truth, estimate), claimed).mean())


def _since_start(poses: PoseTrajectory3D) -> Float[np.ndarray, "pose 3"]:
    planar = np.column_stack([poses.positions_xyz[:, :2], yaws(poses)])
    return between(planar[:1], planar)
