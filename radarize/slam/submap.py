"""Submap: the occupancy grid of consecutive nodes, in the frame of the first of them."""

import zlib
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from radarize.io.pose import transform
from radarize.slam.config import SlamConfig
from radarize.slam.grid import OccupancyGrid
from radarize.slam.node import Node


@dataclass(eq=False)
class Submap:
    """Occupancy grid of consecutive nodes. It is finished when it holds the configured number of nodes, and never
    changes after that.

    A finished grid is stored compressed, with about a tenth of a byte per cell, as most cells are unknown. It is
    decompressed on each access.

    Attributes:
        config: of the back end.
        anchor: number of the node whose frame is that of the submap.
        nodes: numbers of all nodes in it.
        center: mean of the occupied cells, m; set when it is finished.
    """

    config: SlamConfig
    anchor: int
    nodes: list[int] = field(default_factory=list)

    def __post_init__(self):
        self._grid = OccupancyGrid.empty(self.config.grid.resolution)
        self._packed = b""
        self.center = np.zeros(2)

    def insert(self, number: int, node: Node, pose: Float[np.ndarray, "3"]) -> None:
        """Insert a node at its pose in the frame of the submap."""
        origins, ends, hits = node.rays
        self._grid.insert(transform(pose, origins), transform(pose, ends), hits, self.config.grid, spread=True)
        self.nodes.append(number)
        if self.finished:
            self._finish()

    @property
    def finished(self) -> bool:
        """Whether it holds all its nodes."""
        return len(self.nodes) >= self.config.grid.nodes

    @property
    def grid(self) -> OccupancyGrid:
        """The occupancy grid; decompressed if the submap is finished."""
        if not self._packed:
            return self._grid
        cells = np.frombuffer(zlib.decompress(self._packed), np.uint8).reshape(self._shape)
        return OccupancyGrid(self.config.grid.resolution, self._grid.origin, cells)

    def _finish(self) -> None:
        grid = self._grid.crop(margin=2).quantised()
        occupied = np.argwhere(grid.probability > 127)
        if len(occupied):
            self.center = (occupied.mean(axis=0)[::-1] + 0.5) * grid.resolution + grid.origin
        self._packed, self._shape = zlib.compress(grid.probability.tobytes(), level=1), grid.probability.shape
        self._grid = OccupancyGrid(grid.resolution, grid.origin, np.zeros((1, 1), np.uint8))
