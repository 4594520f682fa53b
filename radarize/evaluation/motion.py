"""Velocities and turns against the truth, step by step, before they are integrated; and whether their claimed
uncertainties are honest.
"""

import numpy as np
from jaxtyping import Float

from radarize.evaluation.claims import normalised
from radarize.evaluation.metrics import Statistics, over
from radarize.io.pose import wrap

#: m/s: from this speed on, there is a direction of motion.
MOVING = 0.1


def velocity_errors(
    estimate: Float[np.ndarray, "frame 2"],
    true: Float[np.ndarray, "frame 2"],
    covariance: Float[np.ndarray, "frame 2 2"] | None = None,
) -> dict[str, float]:
    """Estimated against true velocity in the sensor frame, forward and left.

    Args:
        estimate, true: m/s; NaN where there is none.
        covariance: of the estimate, m^2/s^2.

    Returns:
        ``mean``, ``rmse``, ``max``, ``median``, ``p90``: of the difference's length, m/s. ``forward``, ``left``: root
        mean squares, m/s. ``bias``: mean of the difference along the true motion while there is any, m/s; positive: too
        fast. ``missing``: share of frames without an estimate. With covariances, ``nees``: mean of the squared error in
        units of its covariance over its expectation, 2, and ``nees_median``: median over its expectation, 2 ln 2: both
        are 1 if the covariance is right, and outliers move only the first. NaN where there is nothing to average.
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
            squared = normalised(difference, covariance[known])
            result["nees"], result["nees_median"] = float(squared.mean()), float(np.median(squared) / np.log(2))
        except np.linalg.LinAlgError:
            result["nees"] = result["nees_median"] = np.nan
    return result


def turn_errors(
    steps: Float[np.ndarray, "frame"], true_yaw: Float[np.ndarray, "frame"], frames: int
) -> Float[np.ndarray, "window"]:
    """Errors of the change of yaw over windows of a recording, one starting at every frame, rad.

    Args:
        steps: estimated turn since the frame before, rad; the first one's is not used.
        true_yaw: rad, wrapped or not.
        frames: steps of a window.
    """
    turned = np.concatenate([[0.0], np.cumsum(steps[1:])])
    return wrap((turned[frames:] - turned[:-frames]) - (true_yaw[frames:] - true_yaw[:-frames]))
