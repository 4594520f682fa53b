"""Procedural buildings of four styles: any floor from a style, a seed and a floor's number.

    building: {kind: A, seed: 3, floor: 2}

The seed gives what the floors of a building share (`skeleton`): outline, corridors, stairs. The floor's number varies
rooms, doors (`floorplan`) and what stands in them (`furnishing`). World origin at the south-west corner of the
building's rooms, floor at z = 0. What stands on a plan is made by the same functions for the `office`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Annotated, Literal

import numpy as np
import shapely
from pydantic import BaseModel, ConfigDict, Field

from radarsim.scene import furniture, joinery, shapes, walls
from radarsim.scene.floorplan import FloorPlan
from radarsim.scene.furnishing import furnish
from radarsim.scene.objects import SceneObject
from radarsim.scene.openings import Opening, strip
from radarsim.scene.rooms import Room, Site
from radarsim.scene.skeleton import Box, Skeleton, skeleton
from radarsim.scene.styles import STYLES, Style

#: Name and material of what each face of the walls belongs to.
Labels = Callable[[list[walls.Face]], Iterable[tuple[str, str]]]


class Building(BaseModel):
    """One floor of a building; `build` gives its objects. Same parameters, same objects to the last bit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["A", "B", "C", "D"]
    seed: Annotated[int, Field(ge=0)] = 0
    floor: Annotated[int, Field(ge=0)] = 0
    furnished: bool = True

    @property
    def style(self) -> Style:
        """Materials, sizes and densities."""
        return STYLES[self.kind]

    def skeleton(self) -> Skeleton:
        """What all floors share."""
        return skeleton(self.style, np.random.default_rng([self.seed, ord(self.kind)]))

    def plan(self) -> FloorPlan:
        """The floor's rooms and openings."""
        return FloorPlan(self.skeleton(), self.style, self._rng(1))

    def build(self) -> list[SceneObject]:
        """All objects of the floor: walls, floors, ceilings, doors, windows, fittings, furniture."""
        plan, site = self.plan(), Site(self._rng(2), self.style.height)
        columns = _columns(plan)
        surfaces(site, plan, partial(_labels, plan, columns), columns)
        for opening in plan.openings:
            fit(site, plan, opening)
        equip(site, plan, furnish if self.furnished else None)
        return site.objects

    def _rng(self, purpose: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, ord(self.kind), self.floor, purpose])


def surfaces(site: Site, plan: FloorPlan, labels: Labels, pillars: Sequence[Box] = ()) -> None:
    """Walls: the ground less the rooms and openings, their faces by label. Floors and ceilings by room."""
    style, height = plan.style, plan.style.height
    boxes = plan.skeleton.ground(style.outer), plan.spaces(), pillars
    solids, rooms, pillars = ([(x0, y0, 0.0, x1, y1, height) for x0, y0, x1, y1 in part] for part in boxes)
    spans = [o.span for o in plan.openings]
    found = walls.faces(solids, [*rooms, *spans], pillars)
    planes: dict[tuple[str, str], list[walls.Face]] = {}
    for face, label in zip(found, labels(found), strict=True):
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


def fit(site: Site, plan: FloorPlan, opening: Opening) -> None:
    """Put into an opening what it is filled with."""
    for name, mesh, what in joinery.fill(opening, plan.style):
        site.add(f"{opening.name} {name}".rstrip(), mesh, what)


def equip(site: Site, plan: FloorPlan, furnish: Callable[[Site, Room, FloorPlan], None] | None) -> None:
    """Lamps in all rooms, and furniture where there is some."""
    style = plan.style
    lamp = furniture.lamp(style.height, *style.lamp[:2])
    for room in plan.rooms:
        along_x = style.plain or room.size[0] > room.size[1]
        site.lamps(room, lamp, style.lamp[2], np.pi / 2 if along_x else 0.0)
        if furnish:
            furnish(site, room, plan)


def _labels(plan: FloorPlan, columns: list[Box], found: list[walls.Face]) -> Iterator[tuple[str, str]]:
    """Name and material of what each face of the walls belongs to."""
    style, sheath = plan.style, plan.skeleton.outline.exterior
    # Within the wall's thickness, short of its faces.
    depths = [(1e-3, -5e-3) if o.side in "ns" else (-5e-3, 1e-3) for o in plan.openings]
    spans = [o.span for o in plan.openings]
    reveals = shapely.union_all(
        [shapely.box(s[0] - dx, s[1] - dy, s[3] + dx, s[4] + dy) for s, (dx, dy) in zip(spans, depths, strict=True)]
    )
    middles = np.array([face.corners.mean(axis=0) for face in found])
    points = shapely.points(middles[:, :2])
    near = shapely.distance(points, sheath)
    in_reveal = shapely.covers(reveals, points)
    in_corridor = shapely.covers(shapely.union_all([room.floor.buffer(0.01) for room in plan.corridors]), points)
    at_column = shapely.covers(shapely.union_all([shapely.box(*column) for column in columns]), points)
    for k, face in enumerate(found):
        if near[k] < 1e-3 and not in_reveal[k]:
            name, what = "facade", style.facade
        elif at_column[k]:
            name, what = "column", style.column[0]
        elif face.axis == 2 or in_reveal[k]:
            what = style.lining if near[k] < style.outer else style.doors.frame
            yield f"reveals {what}", what
            continue
        elif near[k] < style.outer + 0.01:
            name, what = "outer wall", style.lining
        elif in_corridor[k]:
            name, what = "corridor wall", style.passage
        else:
            name, what = "wall", style.partition
        yield f"{name} {'xyz'[face.axis]} {face.sign * face.level:+.3f}", what


def _columns(plan: FloorPlan) -> list[Box]:
    """Columns half sunk into the facade where walls between rooms meet it, and in the corners of large rooms."""
    what, width = plan.style.column
    if not what:
        return []
    found = []
    for room in plan.rooms:
        if room.kind in ("corridor", "stairs", "toilet") or min(room.size) < 3.5:
            continue
        for border in plan.borders[room.name]:
            if border.other is not None or border.length < 3.5:
                continue
            low = room.wall(border.side)[0]
            column = strip(room, border.side, low, low + width, -0.6 * width, 0.0)
            found.append(tuple(round(v, 3) for v in column))
            room.taken.append(shapely.box(*found[-1]).buffer(0.02))
    return found
