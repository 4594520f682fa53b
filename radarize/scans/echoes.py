"""Selection of one echo per bearing: the first or the strongest.

Behind the first surface on a bearing, every echo has been reflected at least once more. Selecting the first occupied
cell is therefore the echo suppression (paper, section 4.3).
"""

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike


def first(
    occupied: Bool[np.ndarray, "frame range azimuth"], power: Float[np.ndarray, "frame range azimuth"]
) -> Float[np.ndarray, "frame azimuth"]:
    """Return the fractional range bin of the first echo on every bearing, inf where there is none.

    An echo is a run of occupied cells; its bin is that of the strongest of them.
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
    """Return the fractional range bin of the strongest echo on every bearing, inf where there is none: no echo
    suppression."""
    return _peak(occupied, power, occupied.any(axis=1))


def bins_to_ranges(
    bins: Float[np.ndarray, "frame azimuth"], ranges: Float[np.ndarray, "range"]
) -> Float[np.ndarray, "frame azimuth"]:
    """Return the ranges (m) of fractional bins, inf where there is none; `ranges` are those of whole bins, evenly
    spaced."""
    return np.where(np.isfinite(bins), ranges[0] + bins * (ranges[1] - ranges[0]), np.inf)


def _peak(candidates: np.ndarray, power: np.ndarray, seen: ArrayLike) -> np.ndarray:
    # Interpolate: vertex of the parabola through the log power of the strongest cell and its two neighbours.
    bins = power.shape[1]
    peak = np.where(candidates, power, -1.0).argmax(axis=1)
    log = np.log(np.maximum(power, 1e-30))
    left, middle, right = (
        np.take_along_axis(log, np.clip(peak + k, 0, bins - 1)[:, None], axis=1)[:, 0] for k in (-1, 0, 1)
    )
    curvature = left - 2 * middle + right
    shift = np.where(curvature < 0, (left - right) / (2 * np.minimum(curvature, -1e-12)), 0.0)
    return np.where(seen, peak + np.clip(shift, -0.5, 0.5), np.inf)
