"""Openings in the walls of a floor: doors, passages, windows, glass walls."""

from dataclasses import dataclass

import numpy as np
from shapely.geometry import LineString, Polygon

from radarsim.world.generators.rooms import Room
from radarsim.world.generators.skeleton import Box
from radarsim.world.generators.walls import Span

DOOR, DOOR_HEIGHT = 1.0, 2.1  # m

OPPOSITE = {"n": "s", "s": "n", "e": "w", "w": "e"}


@dataclass(frozen=True)
class Opening:
    """Opening in a wall.

    Attributes:
        name: unique.
        room: room into which a leaf opens.
        side: of the room.
        low, high: along the wall, m.
        bottom, top: heights, m.
        thickness: of the wall, m.
        kind: ``door``, ``way`` (no leaf), ``window`` or ``glass wall``.
        other: room behind; None: outside.
        leaf: material of the door; "": none.
        angle: of the leaf, rad; 0: shut.
        hinge: at the low (-1) or high (+1) end.
        bay: of a glass wall: low and high end of its door.
    """

    name: str
    room: Room
    side: str
    low: float
    high: float
    bottom: float
    top: float
    thickness: float
    kind: str
    other: Room | None = None
    leaf: str = ""
    angle: float = 0.0
    hinge: int = -1
    bay: tuple[float, float] = (0.0, 0.0)

    @property
    def span(self) -> Span:
        """Box of the opening."""
        x0, y0, x1, y1 = strip(self.room, self.side, self.low, self.high, 0.0, self.thickness)
        return x0, y0, self.bottom, x1, y1, self.top

    @property
    def passage(self) -> tuple[float, float] | None:
        """Passable interval along the wall, if no leaf closes it."""
        if self.kind == "window":
            return None
        return self.bay if self.kind == "glass wall" else (self.low, self.high)

    def leaf_area(self) -> Polygon:
        """Floor area under an open leaf, with a margin."""
        low, high = self.passage or (self.low, self.high)
        hinge = low if self.hinge < 0 else high
        tip = hinge - self.hinge * np.cos(self.angle) * (high - low), np.sin(self.angle) * (high - low)
        ends = [self.room.wall_place(self.side, *end)[:2] for end in ((hinge, 0.0), tip)]
        return LineString(ends).buffer(0.1)


def strip(room: Room, side: str, low: float, high: float, near: float, far: float) -> Box:
    """Box along a wall of a room, from `near` to `far` (m) outward of its face."""
    face, out = {"n": (room.y1, 1), "s": (room.y0, -1), "e": (room.x1, 1), "w": (room.x0, -1)}[side]
    a, b = sorted((face + out * near, face + out * far))
    return (low, a, high, b) if side in "ns" else (a, low, b, high)
