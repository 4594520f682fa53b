"""The map of a session that goes on: what is new is added, and all is drawn anew where poses have moved."""

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from radarize.io.pose import between, transform
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid
from radarize.slam.node import Node


class MapRenderer:
    """Occupancy grid of nodes at their poses.

    Args:
        config: of rays; its `map_resolution` is the size of a cell.
        pause: s to sleep after every node, so that a thread that draws leaves the interpreter to others.
    """

    def __init__(self, config: GridConfig, pause: float = 0.0):
        self.config, self.pause = config, pause
        self._clear()

    def _clear(self) -> None:
        self._grid, self._nodes = OccupancyGrid.empty(self.config.map_resolution), []
        self._poses, self._reach = np.zeros((0, 3)), 0.0  # m, of the longest ray

    def render(self, nodes: Sequence[Node], poses: Float[np.ndarray, "node 3"]) -> OccupancyGrid:
        """Map of all nodes; those drawn before stay as they are if no end of a ray has moved by more than a cell."""
        count, cell = len(self._nodes), self.config.map_resolution
        known = count <= len(nodes) and all(a is b for a, b in zip(self._nodes, nodes, strict=False))
        if known:
            moved = np.abs(between(self._poses, poses[:count]))
            known = bool((np.hypot(moved[:, 0], moved[:, 1]) + self._reach * moved[:, 2] < cell).all())
        if not known:
            self._clear()
        for node, pose in zip(nodes[len(self._nodes) :], poses[len(self._nodes) :], strict=True):
            origins, ends, hits = node.rays
            self._reach = max(self._reach, float(np.hypot(*ends.T).max(initial=0.0)))
            self._grid.insert(transform(pose, origins), transform(pose, ends), hits, self.config)
            if self.pause:
                time.sleep(self.pause)
        self._poses = np.concatenate([self._poses, poses[len(self._nodes) :]])
        self._nodes = list(nodes)
        return self._grid.crop(margin=4)
