"""Map of a running session: new nodes are added, and the map is rendered again where poses have changed."""

import time
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from radarize.io.pose import between, transform
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid
from radarize.slam.node import Node


class MapRenderer:
    """Renders the occupancy grid of nodes at their poses.

    Args:
        config: evidence of rays; `map_resolution` is the cell size.
        pause: s to sleep after every node, so that a rendering thread releases the interpreter.
    """

    def __init__(self, config: GridConfig, pause: float = 0.0):
        self.config, self.pause = config, pause
        self._clear()

    def _clear(self) -> None:
        self._grid = OccupancyGrid.empty(self.config.map_resolution)
        self._nodes: list[Node] = []
        self._poses, self._reach = np.zeros((0, 3)), 0.0  # length of the longest ray, m

    def render(self, nodes: Sequence[Node], poses: Float[np.ndarray, "node 3"]) -> OccupancyGrid:
        """Return the map of all nodes. It is only extended if no end of a previous ray has moved by more than a
        cell."""
        count, cell = len(self._nodes), self.config.map_resolution
        unchanged = count <= len(nodes) and all(a is b for a, b in zip(self._nodes, nodes, strict=False))
        if unchanged:
            moved = np.abs(between(self._poses, poses[:count]))
            unchanged = bool((np.hypot(moved[:, 0], moved[:, 1]) + self._reach * moved[:, 2] < cell).all())
        if not unchanged:
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
