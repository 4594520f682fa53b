"""How far two clouds of points are apart (Prabhakara et al., ICRA 2023, section VI)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from radarize.signal import polar


@dataclass(frozen=True)
class Apart:
    """Two clouds.

    Attributes:
        chamfer: m, half the sum of both mean distances to the nearest point of the other.
        hausdorff: m, the larger of both medians of these.
    """

    chamfer: float
    hausdorff: float

    @classmethod
    def of(cls, found: Float[np.ndarray, "found 2"], true: Float[np.ndarray, "true 2"]) -> "Apart":
        """Not-a-number where one has no points."""
        if not len(found) or not len(true):
            return cls(np.nan, np.nan)
        there, back = cKDTree(true).query(found)[0], cKDTree(found).query(true)[0]
        return cls((there.mean() + back.mean()) / 2, max(np.median(there), np.median(back)))

    @classmethod
    def of_pictures(cls, found: Bool[np.ndarray, "range one"], true: Bool[np.ndarray, "range other"]) -> "Apart":
        """Of polar pictures with any numbers of columns (`radarize.signal.polar`)."""
        return cls.of(polar.cartesian(found), polar.cartesian(true))
