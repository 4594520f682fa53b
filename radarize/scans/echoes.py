"""Which of the echoes on a bearing is the surface seen directly.

Behind the first surface of a bearing everything a radar reports has been reflected at least once more, so keeping the
first occupied cell is the echo suppression (paper, section 4.3).
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike


def first(
    occupied: Bool[np.ndarray, "frame range azimuth"], power: Float[np.ndarray, "frame range azimuth"]
) -> Float[np.ndarray, "frame azimuth"]:
    """Fractional range bin of the first echo of every bearing, inf where there is none.

    An echo is a run of occupied cells; it lies at the strongest of them.
    """
    start = occupied.argmax(axis=1)
    bins = np.arange(occupied.shape[1])[:, None]
    # The run ends at the first free cell behind its start.
    free_behind = ~occupied & (bins > start[:, None])
    end = np.where(free_behind.any(axis=1), free_behind.argmax(axis=1), occupied.shape[1])
    run = (bins >= start[:, None]) & (bins < end[:, None])
    return _peak(run, power, occupied.any(axis=1))


def strongest(
    occupied: Bool[np.ndarray, "frame range azimuth"], power: Float[np.ndarray, "frame range azimuth"]
) -> Float[np.ndarray, "frame azimuth"]:
    """Fractional range bin of the strongest echo of every bearing, inf where there is none: no suppression."""
    return _peak(occupied, power, occupied.any(axis=1))


def bins_to_ranges(
    bins: Float[np.ndarray, "frame azimuth"], ranges: Float[np.ndarray, "range"]
) -> Float[np.ndarray, "frame azimuth"]:
    """Ranges (m) of fractional bins, inf where there is none, by those of whole bins, evenly spaced."""
    return np.where(np.isfinite(bins), ranges[0] + bins * (ranges[1] - ranges[0]), np.inf)


def _peak(candidates: np.ndarray, power: np.ndarray, seen: ArrayLike) -> np.ndarray:
    # Vertex of the parabola through log power at the strongest cell and its two neighbours.
    bins = power.shape[1]
    peak = np.where(candidates, power, -1.0).argmax(axis=1)
    log = np.log(np.maximum(power, 1e-30))
    left, middle, right = (
        np.take_along_axis(log, np.clip(peak + k, 0, bins - 1)[:, None], axis=1)[:, 0] for k in (-1, 0, 1)
    )
    curvature = left - 2 * middle + right
    shift = np.where(curvature < 0, (left - right) / (2 * np.minimum(curvature, -1e-12)), 0.0)
    return np.where(seen, peak + np.clip(shift, -0.5, 0.5), np.inf)
