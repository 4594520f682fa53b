"""Errors of scans against the true planar scan on each bearing, and path types of wrong returns.

On bearings without a true surface in range, any return is too short.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int, UInt8

from radarize.evaluation.mapping import TOLERANCE
from radarize.evaluation.metrics import over

#: Distance of a return behind a surface above which mapping clears free space through it, m: size of the cells of a map
#: plus thickness of a wall.
THROUGH = 0.20


def true_ranges(
    azimuths: Float[np.ndarray, "beam"],
    true: Float[np.ndarray, "scan bearing"],
    true_azimuths: Float[np.ndarray, "bearing"],
) -> Float[np.ndarray, "scan beam"]:
    """Return the true ranges on the bearings nearest to the measured ones, m; inf without a surface in range."""
    return true[:, np.abs(true_azimuths[None] - azimuths[:, None]).argmin(axis=1)]


def scan_errors(measured: Float[np.ndarray, "scan beam"], true: Float[np.ndarray, "scan beam"]) -> dict[str, float]:
    """Compare measured with true scans on the same bearings.

    Args:
        measured: ranges, m; not finite, or 0, without a return.
        true: ranges, m; inf without a surface in range.

    Returns:
        ``within_10cm``: share of returns within 10 cm of the true range. ``beside``: share of returns within 10 cm of
        the true range on the same bearing or one beside it, where a wall at a glancing angle is 25 cm nearer or
        farther. ``returned``: share of bearings with a surface in range that have a return. ``median``: median
        absolute error, m. ``beyond``, ``short``: shares of returns that are more than 10 cm too long and too short.
        ``through``: share of bearings with a surface in range whose return is more than 20 cm behind the surface on
        this bearing and those beside it, so that mapping clears free space through it. NaN without bearings.
    """
    hit, reach = _returned(measured), np.isfinite(true)
    length = np.where(hit, measured, 0.0)
    far, distance = _beside(length, true)
    difference = np.where(reach, length - np.where(reach, true, 0), -np.inf)[hit]
    return {
        "within_10cm": over(np.abs(difference) <= TOLERANCE),
        "beside": over(distance[hit] <= TOLERANCE),
        "returned": over(hit[reach]),
        "median": over(np.abs(difference), np.median),
        "beyond": over(difference > TOLERANCE),
        "short": over(difference < -TOLERANCE),
        "through": over((hit & (length > far + THROUGH))[reach]),
    }


def wrong_by_path_type(
    measured: Float[np.ndarray, "scan beam"],
    true: Float[np.ndarray, "scan beam"],
    azimuths: Float[np.ndarray, "beam"],
    types: UInt8[np.ndarray, "scan range bearing"],
    type_ranges: Float[np.ndarray, "range"],
    type_azimuths: Float[np.ndarray, "bearing"],
    names: Sequence[str],
) -> dict[str, float]:
    """Return the shares of wrong returns, with an error over 10 cm, by the path type of the strongest echo of their
    cell.

    A return at the correct range counts as correct, even if a ghost is the strongest echo of its cell.

    Args:
        measured, true: ranges as in `scan_errors`, m.
        azimuths: bearings of the measured ranges, rad.
        types: path types as recorded by `radarsim simulate --sensors ghosts`: index into `names` of the strongest echo
            of every cell; other values for noise.
        type_ranges, type_azimuths: axes of `types`, m and rad.
        names: names of the path types.

    Returns:
        Share of all returns by name, and ``noise``; they sum to the share of wrong returns. NaN without returns.
    """
    hit, reach = _returned(measured), np.isfinite(true)
    wrong = hit & ~(reach & (np.abs(np.where(hit, measured, 0.0) - np.where(reach, true, 0.0)) <= TOLERANCE))
    scan, beam = np.nonzero(wrong)
    row = _nearest(type_ranges, measured[scan, beam])
    column = _nearest(type_azimuths, azimuths)[beam]
    found = types[scan, row, column]
    counts = np.bincount(np.minimum(found, len(names)), minlength=len(names) + 1)
    returned = float(hit.sum()) or np.nan
    return {name: float(count / returned) for name, count in zip([*names, "noise"], counts, strict=True)}


def _returned(measured: np.ndarray) -> np.ndarray:
    return np.isfinite(measured) & (measured > 0)


def _beside(length: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest true range on a bearing and those beside it, and the least distance to any of the three."""
    padded = np.pad(true, ((0, 0), (1, 1)), mode="edge")
    three = np.stack([padded[:, :-2], true, padded[:, 2:]])
    return three.max(axis=0), np.abs(three - length).min(axis=0)


def _nearest(axis: np.ndarray, values: np.ndarray) -> Int[np.ndarray, "value"]:
    """Return indices of the nearest entries of a uniform ascending axis."""
    return np.clip(np.rint((values - axis[0]) / (axis[1] - axis[0])).astype(int), 0, len(axis) - 1)
