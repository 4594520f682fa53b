"""Procedural buildings: floors of a given style, seed and floor number, or an office of a given size.

    building: {kind: A, seed: 3, floor: 2}
    building: {kind: office, seed: 7, length: 18}

The seed determines what the floors of a building share (`skeleton`): outline, corridors, stairs. The floor number
varies rooms, doors (`layout`) and furniture (`furnishing`). World origin at the south-west corner, floor at z = 0.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from shapely.geometry import box as area

from radarsim.world import shapes
from radarsim.world.fields import Strict
from radarsim.world.generators import walls
from radarsim.world.generators.furnishing import furnish
from radarsim.world.generators.furniture import make
from radarsim.world.generators.joinery import fill
from radarsim.world.generators.layout import FloorPlan
from radarsim.world.generators.rooms import Site
from radarsim.world.generators.skeleton import Block, Skeleton, skeleton
from radarsim.world.generators.styles import STYLES, Style
from radarsim.world.objects import SceneObject


class Floor(Strict, ABC):
    """One floor of a building. Same parameters, same objects to the last bit.

    Attributes:
        kind: style of the building.
        seed: seed of what all floors share: outline, corridors, stairs.
        floor: number of the floor, which varies rooms, doors and furniture.
        furnished: whether rooms have furniture.
    """

    kind: str
    seed: Annotated[int, Field(ge=0)] = 0
    floor: Annotated[int, Field(ge=0)] = 0
    furnished: bool = True

    @property
    def style(self) -> Style:
        """Materials, sizes and densities."""
        return STYLES[self.kind]

    @abstractmethod
    def skeleton(self) -> Skeleton:
        """Outline, corridors and stairs shared by all floors."""

    def plan(self) -> FloorPlan:
        """The floor's rooms and openings."""
        return FloorPlan(self.skeleton(), self.style, self._rng(self.floor, 1))

    def build(self, furniture: float = 1.0) -> list[SceneObject]:
        """Build all objects of the floor: walls, floors, ceilings, doors, windows, fittings, furniture.

        Args:
            furniture: number of pieces of furniture, relative to the usual.
        """
        plan, site = self.plan(), Site(self._rng(self.floor, 2), self.style.height, furniture)
        surfaces(site, plan)
        for opening in plan.openings:
            for name, mesh, what in fill(opening, plan.style):
                site.add(f"{opening.name} {name}", mesh, what)
        depth, width, spacing = plan.style.lamp
        lamp = make("lamp", height=plan.style.height, d=depth, w=width)
        for room in plan.rooms:
            site.lamps(room, lamp, spacing, np.pi / 2 if room.size[0] > room.size[1] else 0.0)
            if self.furnished:
                furnish(site, room, plan)
        return site.objects

    def _rng(self, *purpose: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *self.kind.encode(), *purpose])


class Building(Floor):
    """A floor of style A, B, C or D."""

    kind: Literal["A", "B", "C", "D"]

    def skeleton(self) -> Skeleton:
        """Rings of corridors with rooms on both sides."""
        return skeleton(self.style, self._rng())


class Office(Floor):
    """A floor of style `office`: a corridor along x between two rows of rooms, of given sizes.

    Attributes:
        length: extent along x, outside to outside, m.
        depth: extent along y, outside to outside, m.
        height: floor to ceiling, m.
        corridor: width of the corridor, m.
        room: usual width of a room, m.
    """

    kind: Literal["office"] = "office"
    length: Annotated[float, Field(ge=8, le=200)] = 18.0
    depth: Annotated[float, Field(ge=8, le=40)] = 12.0
    height: Annotated[float, Field(ge=2.4, le=6)] = 2.7
    corridor: Annotated[float, Field(ge=1.4, le=6)] = 2.0
    room: Annotated[float, Field(ge=2.8, le=12)] = 4.2

    @property
    def style(self) -> Style:
        """Materials, sizes and densities."""
        return replace(STYLES["office"], height=self.height)

    def skeleton(self) -> Skeleton:
        """The two rows of rooms, the southern one first."""
        thick, wall = self.style.outer, self.style.inner
        low, high, far = (self.depth - self.corridor) / 2, (self.depth + self.corridor) / 2, self.length - thick
        sides = (thick, low - wall), (high + wall, self.depth - thick)
        blocks = [Block((thick, y0, far, y1), 0, "rooms", self.room / 3, self.room) for y0, y1 in sides]
        outline = area(0.0, 0.0, self.length, self.depth)
        return Skeleton({"corridor": (thick, low, far, high)}, blocks, outline=outline)


def surfaces(site: Site, plan: FloorPlan) -> None:
    """Add walls, which are the ground without rooms and openings, with faces by label, and floors and ceilings by
    room."""
    style, height = plan.style, plan.style.height
    boxes = plan.skeleton.ground(style.outer), [room.floor.bounds for room in plan.rooms], plan.columns
    solids, rooms, pillars = ([(x0, y0, 0.0, x1, y1, height) for x0, y0, x1, y1 in part] for part in boxes)
    spans = [o.span for o in plan.openings]
    found = walls.faces(solids, [*rooms, *spans], pillars)
    planes: dict[tuple[str, str], list[walls.Face]] = {}
    for face, label in zip(found, plan.labels(found), strict=True):
        planes.setdefault(label, []).append(face)
    for (name, what), parts in planes.items():
        site.add(name, walls.surface(parts), what)
    for room in plan.rooms:
        for name, z, facing, what in (
            ("floor", 0.0, 1, style.floor(room.kind)),
            ("ceiling", height, -1, style.ceiling),
        ):
            site.add(f"{room.name} {name}", shapes.rectangle((*room.center, z), room.size, (0, 0, facing)), what)
    sills = [
        shapes.rectangle(((x0 + x1) / 2, (y0 + y1) / 2, 0.0), (x1 - x0, y1 - y0), (0, 0, 1))
        for x0, y0, z0, x1, y1, _ in spans
        if z0 == 0
    ]
    site.add("thresholds", shapes.joined(*sills), style.floor(""))
