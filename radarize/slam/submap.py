"""A submap: the grid of a few consecutive nodes, in the frame of the first of them."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Float

from radarize.pose import transform
from radarize.slam.config import SlamConfig
from radarize.slam.grid import OccupancyGrid
from radarize.slam.node import Node


@dataclass(eq=False)
class Submap:
    """Nodes are added until it holds as many as configured; then it is finished and never changes.

    A finished grid takes a byte a cell. What a search needs besides is made when it searches, and dropped again.

    Attributes:
        config: of the back end.
        anchor: number of the node whose frame this is.
        nodes: numbers of all nodes in it.
    """

    config: SlamConfig
    anchor: int
    nodes: list[int] = field(default_factory=list)

    def __post_init__(self):
        self.grid = OccupancyGrid.empty(self.config.grid.resolution)

    def insert(self, number: int, node: Node, pose: Float[np.ndarray, "3"]) -> None:
        """Add a node at its pose in this submap's frame."""
        origins, ends = transform(pose, node.origins), transform(pose, node.ends)
        self.grid.insert(origins, ends, node.hits, self.config.grid, spread=True)
        self.nodes.append(number)
        if self.finished:
            self.grid = self.grid.crop(margin=2).quantised()

    @property
    def finished(self) -> bool:
        """Whether it holds all its nodes."""
        return len(self.nodes) >= self.config.grid.nodes

    @cached_property
    def center(self) -> Float[np.ndarray, "2"]:
        """Middle of the occupied cells, m."""
        occupied = np.argwhere(self.grid.probability * self.grid.unit > 0.5)
        if not len(occupied):
            return np.zeros(2)
        return (occupied.mean(axis=0)[::-1] + 0.5) * self.grid.resolution + self.grid.origin
