"""Distances between two point clouds (Prabhakara et al., ICRA 2023, section VI)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from radarize.signal import polar


@dataclass(frozen=True)
class PointCloudDistance:
    """Chamfer and modified Hausdorff distance between an estimated and a true point cloud, m.

    Attributes:
        chamfer: half the sum of the two mean distances to the nearest point of the other cloud, m.
        hausdorff: the larger of the two median distances to the nearest point of the other cloud, m.
    """

    chamfer: float
    hausdorff: float

    @classmethod
    def of(cls, found: Float[np.ndarray, "found 2"], true: Float[np.ndarray, "true 2"]) -> "PointCloudDistance":
        """Return both distances between two clouds of points (m); NaN if either cloud is empty."""
        if not len(found) or not len(true):
            return cls(np.nan, np.nan)
        there, back = cKDTree(true).query(found)[0], cKDTree(found).query(true)[0]
        return cls((there.mean() + back.mean()) / 2, max(np.median(there), np.median(back)))

    @classmethod
    def of_pictures(
        cls, found: Bool[np.ndarray, "range one"], true: Bool[np.ndarray, "range other"]
    ) -> "PointCloudDistance":
        """Return both distances between the points of two polar pictures (`radarize.signal.polar`), which may have
        different numbers of columns."""
        return cls.of(polar.cartesian(found), polar.cartesian(true))
