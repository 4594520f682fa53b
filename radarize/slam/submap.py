"""A submap: the grid of a few consecutive nodes, in the frame of the first of them."""

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
    """Nodes are added until it holds as many as configured; then it is finished and never changes.

    A finished grid is kept packed, about a tenth of a byte a cell, for most cells know nothing. What a search needs is
    made when it searches, and dropped again.

    Attributes:
        config: of the back end.
        anchor: number of the node whose frame this is.
        nodes: numbers of all nodes in it.
        center: middle of the occupied cells, m; known when finished.
    """

    config: SlamConfig
    anchor: int
    nodes: list[int] = field(default_factory=list)

    def __post_init__(self):
        self._grid = OccupancyGrid.empty(self.config.grid.resolution)
        self._packed = b""
        self.center = np.zeros(2)

    def insert(self, number: int, node: Node, pose: Float[np.ndarray, "3"]) -> None:
        """Add a node at its pose in this submap's frame."""
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
        """The grid, of a finished submap unpacked anew."""
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
