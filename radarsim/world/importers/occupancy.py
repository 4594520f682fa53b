"""Occupancy grid from a ROS map or a lidar log."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class OccupancyGrid:
    """Grid of cells that are occupied, free, or neither (unknown).

    Attributes:
        occupied, free: (ix, iy).
        resolution: side of a cell, m.
        origin: x, y (m) and yaw (rad) of the outer corner of cell (0, 0) in the world.
    """

    occupied: Bool[np.ndarray, "x y"]
    free: Bool[np.ndarray, "x y"]
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def to_world(self, points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Transform points in metres along the grid's sides to the world."""
        x, y, yaw = self.origin
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        return np.asarray(points, float) @ turn.T + [x, y]

    def cells(self, points: Float[np.ndarray, "*n 2"]) -> tuple[Int[np.ndarray, "*n"], Int[np.ndarray, "*n"]]:
        """Indices of the cells nearest to points in metres along the grid's sides."""
        index = np.clip(np.floor(points / self.resolution).astype(int), 0, np.array(self.occupied.shape) - 1)
        return index[..., 0], index[..., 1]
