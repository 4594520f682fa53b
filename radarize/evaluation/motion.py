"""Errors of velocities and changes of yaw, frame by frame, before they are integrated; and the consistency of their
covariances.
"""

import numpy as np
from jaxtyping import Float

from radarize.evaluation.metrics import Statistics, over
from radarize.evaluation.nees import nees
from radarize.io.pose import wrap

#: Least speed at which the direction of motion is defined, m/s.
MOVING = 0.1


def velocity_errors(
    estimate: Float[np.ndarray, "frame 2"],
    true: Float[np.ndarray, "frame 2"],
    covariance: Float[np.ndarray, "frame 2 2"] | None = None,
) -> dict[str, float]:
    """Return statistics of the errors of velocities in the sensor frame (forward, left).

    Args:
        estimate, true: velocities, m/s; NaN where there is none.
        covariance: estimated covariance of each velocity, m^2/s^2.

    Returns:
        ``mean``, ``rmse``, ``max``, ``median``, ``p90``: statistics of the norm of the error, m/s. ``forward``,
        ``left``: RMS error of each component, m/s. ``bias``: mean error along the true direction of motion over frames
        in which the sensor moves, m/s; positive: estimated too fast. ``missing``: share of frames without an estimate.
        With covariances, ``nees``: mean NEES over its expectation, 2, and ``nees_median``: median NEES over its
        expectation, 2 ln 2. Both are 1 if covariances are consistent; outliers change the mean only. NaN if there is
        nothing to average.
    """
    known = np.isfinite(estimate).all(axis=1) & np.isfinite(true).all(axis=1)
    difference, motion = (estimate - true)[known], true[known]
    length, speed = np.linalg.norm(difference, axis=1), np.linalg.norm(motion, axis=1)
    moving = speed > MOVING
    along = (difference[moving] * motion[moving]).sum(axis=1) / speed[moving]
    statistics = Statistics.of(length)
    result = {
        "mean": statistics.mean,
        "rmse": statistics.rmse,
        "max": statistics.max,
        "median": over(length, np.median),
        "p90": over(length, lambda lengths: np.quantile(lengths, 0.9)),
        "forward": Statistics.of(difference[:, 0]).rmse,
        "left": Statistics.of(difference[:, 1]).rmse,
        "bias": Statistics.of(along).mean,
        "missing": 1 - over(known),
    }
    if covariance is not None and len(length):
        try:
            squared = nees(difference, covariance[known])
            result["nees"], result["nees_median"] = float(squared.mean()), float(np.median(squared) / np.log(2))
        except np.linalg.LinAlgError:
            result["nees"] = result["nees_median"] = np.nan
    return result


def turn_errors(
    steps: Float[np.ndarray, "frame"], true_yaw: Float[np.ndarray, "frame"], frames: int
) -> Float[np.ndarray, "window"]:
    """Return errors of the change of yaw over windows of a number of frames, one window per first frame, rad.

    Args:
        steps: estimated change of yaw since the previous frame, rad; that of the first frame is not used.
        true_yaw: true yaw of each frame, rad, wrapped or not.
        frames: length of a window, frames.
    """
    turned = np.concatenate([[0.0], np.cumsum(steps[1:])])
    return wrap((turned[frames:] - turned[:-frames]) - (true_yaw[frames:] - true_yaw[:-frames]))
