"""Rooms, and the site where pieces are placed in them without overlap and without blocking doors."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import shapely
import trimesh
from shapely.geometry import Polygon
from shapely.geometry import box as area

from radarsim.world import shapes
from radarsim.world.generators.furniture import Piece, make
from radarsim.world.materials import material
from radarsim.world.objects import SceneObject


@dataclass
class Room:
    """Room between the faces of its walls.

    Attributes:
        name: unique.
        x0, y0, x1, y1: extent, m.
        kind: office, meeting, ... or corridor.
        taken: floor area in use.
        kept: floor area to keep free: in front of doors, and paths between them.
    """

    name: str
    x0: float
    y0: float
    x1: float
    y1: float
    kind: str
    taken: list[Polygon] = field(default_factory=list)
    kept: list[Polygon] = field(default_factory=list)

    @property
    def center(self) -> tuple[float, float]:
        """Centre of the room, m."""
        return (self.x0 + self.x1) / 2, (self.y0 + self.y1) / 2

    @property
    def size(self) -> tuple[float, float]:
        """Along x and y, m."""
        return self.x1 - self.x0, self.y1 - self.y0

    @cached_property
    def floor(self) -> Polygon:
        """Floor area of the room."""
        return area(self.x0, self.y0, self.x1, self.y1)

    def is_free(self, spot: Polygon) -> bool:
        """Whether a piece of floor lies in the room and is not in use."""
        return self.floor.contains(spot) and not any(spot.intersects(other) for other in self.taken + self.kept)

    def wall(self, side: str) -> tuple[float, float]:
        """Ends of the wall at a `side` ("n", "s", "e", "w"), m."""
        return (self.x0, self.x1) if side in "ns" else (self.y0, self.y1)

    def wall_place(self, side: str, along: float, off: float) -> tuple[float, float, float]:
        """Position and yaw of a piece with its back to the wall at a `side`, at a distance `off` (m) from its face."""
        return {
            "s": (along, self.y0 + off, np.pi / 2),
            "n": (along, self.y1 - off, -np.pi / 2),
            "w": (self.x0 + off, along, 0.0),
            "e": (self.x1 - off, along, np.pi),
        }[side]


class Site:
    """Floor under construction.

    Attributes:
        rng: random generator.
        height: of the ceilings, m.
        density: number of pieces of furniture relative to the usual.
        objects: objects so far.
    """

    def __init__(self, rng: np.random.Generator, height: float, density: float = 1.0):
        self.rng, self.height, self.density = rng, height, density
        self.objects: list[SceneObject] = []
        self._count: dict[str, int] = {}

    def number(self, usual: float) -> int:
        """Number of pieces for a usual number, scaled by the density; a fraction is rounded at random."""
        return int(usual) if self.density == 1 else int(int(usual) * self.density + self.rng.random())

    def add(self, name: str, mesh: trimesh.Trimesh, what: str) -> None:
        """Add an object of a material. Panes are sheets, everything else is the surface of a body."""
        self.objects.append(SceneObject(name, mesh, material(what), solid=what != "glass"))

    def put(self, room: Room, piece: Piece, x: float, y: float, yaw: float) -> None:
        """Place a piece in a room and mark its floor area as taken."""
        number = self._count[room.name + piece.kind] = self._count.get(room.name + piece.kind, 0) + 1
        for what, part in piece.parts.items():
            self.add(f"{room.name} {piece.kind} {number} {what}", shapes.placed(part, (x, y, 0), (0, 0, yaw)), what)
        room.taken.append(footprint(piece, x, y, yaw))

    def put_if_free(self, room: Room, piece: Piece, x: float, y: float, yaw: float, margin: float = 0.01) -> bool:
        """Place a piece if the floor is free within a margin (m); return whether it was placed."""
        free = room.is_free(footprint(piece, x, y, yaw).buffer(margin))
        if free:
            self.put(room, piece, x, y, yaw)
        return free

    def seat(self, room: Room, x: float, y: float, yaw: float, away: float = 0.82) -> None:
        """Place a chair in front of a place, turned towards it to within half a radian."""
        turn = yaw + np.pi + self.rng.uniform(-0.5, 0.5)
        piece = make("chair")
        x, y = x + away * np.cos(yaw), y + away * np.sin(yaw)
        if room.is_free(footprint(piece, x, y, turn)):
            self.put(room, piece, x, y, turn)

    def lamps(self, room: Room, piece: Piece, spacing: float, yaw: float = np.pi / 2) -> None:
        """Add ceiling lamps on a regular grid; they take no floor."""
        nx, ny = (max(1, round(side / spacing)) for side in room.size)
        for i in range(nx):
            for j in range(ny):
                x = room.x0 + (i + 0.5) / nx * (room.x1 - room.x0)
                y = room.y0 + (j + 0.5) / ny * (room.y1 - room.y0)
                mesh = shapes.placed(piece.parts["metal"], (x, y, 0), (0, 0, yaw))
                self.add(f"{room.name} lamp {i * ny + j + 1}", mesh, "metal")


def footprint(piece: Piece, x: float, y: float, yaw: float) -> Polygon:
    """Floor area under a piece."""
    flat = area(-piece.depth / 2, -piece.width / 2, piece.depth / 2, piece.width / 2)
    c, s = np.cos(yaw), np.sin(yaw)
    return shapely.affinity.affine_transform(flat, [c, -s, s, c, x, y])
