"""Scans against the true planar scan, bearing by bearing, and what the wrong ones come from.

Where the truth has no surface in reach, whatever is measured is too short.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int, UInt8

from radarize.evaluation.mapping import TOLERANCE
from radarize.evaluation.metrics import over

#: m: free space is carved through a surface if the bearing ends farther behind it than this, a map's cells and a
#: wall's thickness.
THROUGH = 0.20


def true_ranges(
    azimuths: Float[np.ndarray, "beam"],
    true: Float[np.ndarray, "scan bearing"],
    true_azimuths: Float[np.ndarray, "bearing"],
) -> Float[np.ndarray, "scan beam"]:
    """True ranges on the bearings nearest to the measured ones, m; inf where there is no surface in reach."""
    return true[:, np.abs(true_azimuths[None] - azimuths[:, None]).argmin(axis=1)]


def scan_errors(measured: Float[np.ndarray, "scan beam"], true: Float[np.ndarray, "scan beam"]) -> dict[str, float]:
    """Measured against true scans on the same bearings.

    Args:
        measured: ranges, m; not finite, or 0, where nothing was returned.
        true: ranges, m; inf where there is no surface in reach.

    Returns:
        ``within_10cm``: share of returned bearings within 10 cm of the true range there. ``beside``: within 10 cm of
        it there or one bearing to either side, where a wall at a glancing angle lies 25 cm nearer or farther.
        ``returned``: share of bearings with something true in reach that return anything. ``median``: of the absolute
        errors, m. ``beyond``, ``short``: shares of returned bearings more than 10 cm too far and too near.
        ``through``: share of bearings with something true in reach that carve free space through it: that end more
        than 20 cm behind it and behind what is one bearing to either side. NaN where there is nothing to count.
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


def wrong_by_cause(
    measured: Float[np.ndarray, "scan beam"],
    true: Float[np.ndarray, "scan beam"],
    azimuths: Float[np.ndarray, "beam"],
    cause: UInt8[np.ndarray, "scan range bearing"],
    cause_ranges: Float[np.ndarray, "range"],
    cause_azimuths: Float[np.ndarray, "bearing"],
    names: Sequence[str],
) -> dict[str, float]:
    """What returns that are more than 10 cm off the true range come from, by the strongest cause of their cell.

    A return at the right range is right whatever lies in its cell: a ghost upon a wall draws the wall.

    Args:
        measured, true, azimuths: as for `scan_errors`, rad.
        cause: provenance as `radarsim simulate --sensors ghosts` records it: index into `names` of the strongest cause
            of every cell, others for noise.
        cause_ranges, cause_azimuths: its axes, m and rad.
        names: of the causes.

    Returns:
        Share of all returned bearings by name, and ``noise``; they add up to the wrong ones. NaN without returns.
    """
    hit, reach = _returned(measured), np.isfinite(true)
    wrong = hit & ~(reach & (np.abs(np.where(hit, measured, 0.0) - np.where(reach, true, 0.0)) <= TOLERANCE))
    scan, beam = np.nonzero(wrong)
    row = _nearest(cause_ranges, measured[scan, beam])
    column = _nearest(cause_azimuths, azimuths)[beam]
    found = cause[scan, row, column]
    counts = np.bincount(np.minimum(found, len(names)), minlength=len(names) + 1)
    returned = float(hit.sum()) or np.nan
    return {name: float(count / returned) for name, count in zip([*names, "noise"], counts, strict=True)}


def _returned(measured: np.ndarray) -> np.ndarray:
    return np.isfinite(measured) & (measured > 0)


def _beside(length: np.ndarray, true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest true range here and one bearing to either side, and the least distance to any of the three."""
    padded = np.pad(true, ((0, 0), (1, 1)), mode="edge")
    three = np.stack([padded[:, :-2], true, padded[:, 2:]])
    return three.max(axis=0), np.abs(three - length).min(axis=0)


def _nearest(axis: np.ndarray, values: np.ndarray) -> Int[np.ndarray, "value"]:
    """Indices of the axis' entries nearest to values; the axis ascends evenly."""
    return np.clip(np.rint((values - axis[0]) / (axis[1] - axis[0])).astype(int), 0, len(axis) - 1)
