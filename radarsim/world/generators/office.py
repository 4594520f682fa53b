"""The plain office: a furnished floor from a few numbers and a seed.

    building: {kind: office, seed: 7, length: 18}

A corridor runs along x with rooms on both sides. Neighbouring rooms are joined in pairs by a doorway, so there are
loops to walk: corridor, room, neighbour, corridor. World origin at the floor's south-west corner, floor at z = 0.
"""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import box as area

from radarsim.world.generators.arrangement import arrange
from radarsim.world.generators.buildings import equip, fit, surfaces
from radarsim.world.generators.furniture import make
from radarsim.world.generators.officeplan import OfficePlan
from radarsim.world.generators.rooms import Site
from radarsim.world.generators.skeleton import Block, Skeleton
from radarsim.world.generators.styles import STYLES, Style
from radarsim.world.objects import SceneObject


class Office(BaseModel):
    """Office floor; `build` gives its objects. Same parameters, same objects to the last bit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["office"] = "office"
    seed: Annotated[int, Field(ge=0)] = 0
    length: Annotated[float, Field(ge=8, le=200)] = 18.0  # along x, outside to outside, m
    depth: Annotated[float, Field(ge=8, le=40)] = 12.0  # along y
    height: Annotated[float, Field(ge=2.4, le=6)] = 2.7  # floor to ceiling
    corridor: Annotated[float, Field(ge=1.4, le=6)] = 2.0  # width
    room: Annotated[float, Field(ge=2.8, le=12)] = 4.2  # mean width of a room
    furnished: bool = True

    @property
    def style(self) -> Style:
        """Materials, sizes and densities."""
        return replace(STYLES["office"], height=self.height)

    def skeleton(self) -> Skeleton:
        """A corridor between two blocks of rooms, the southern one first."""
        thick, wall = self.style.outer, self.style.inner
        low, far = self.depth / 2 - self.corridor / 2, self.length - thick
        high = low + self.corridor
        sides = (thick, low - wall), (high + wall, self.depth - thick)
        blocks = [Block((thick, y0, far, y1), 0, "rooms", self.room) for y0, y1 in sides]
        outline = area(0.0, 0.0, self.length, self.depth)
        return Skeleton({"corridor": (thick, low, far, high)}, blocks, outline=outline)

    def build(self) -> list[SceneObject]:
        """All objects of the floor: doors, windows, walls, floors, ceilings, fittings, furniture."""
        rng = np.random.default_rng(self.seed)
        plan, site = OfficePlan(self.skeleton(), self.style, rng), Site(rng, self.height)
        for opening in plan.openings:
            fit(site, plan, opening)
            if opening.kind == "window" and opening.room.kind != "corridor":
                width = plan.window(opening.room)[1]
                piece = make("radiator", w=min(1.2, width))
                site.put(opening.room, piece, *opening.room.wall_place(opening.side, opening.low + width / 2, 0.1))
        surfaces(site, plan)
        equip(site, plan, arrange if self.furnished else None)
        return site.objects
