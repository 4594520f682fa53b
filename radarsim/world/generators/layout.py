"""Floor plan: the skeleton's ground divided into rooms, and the doors, windows and glass walls between them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry import LineString
from shapely.geometry import box as area

from radarsim.world.generators.openings import DOOR, DOOR_HEIGHT, OPPOSITE, Opening, strip
from radarsim.world.generators.rooms import Room
from radarsim.world.generators.skeleton import Block, Box, Skeleton
from radarsim.world.generators.styles import Style
from radarsim.world.generators.walls import Face

#: Smallest and largest width of a room, m.
NARROWEST, WIDEST = 2.8, 8.4
#: Distance from a corner to a door, m.
JAMB = 0.35
#: Floor kept free in front of a door, m.
APPROACH = 1.25


@dataclass(frozen=True)
class Border:
    """Part of a room's wall with one neighbour behind it.

    Attributes:
        room: room of the wall.
        side: "n", "s", "e" or "w".
        low, high: along the wall, m.
        other: room behind the wall; None: outside.
    """

    room: Room
    side: str
    low: float
    high: float
    other: Room | None

    @property
    def length(self) -> float:
        """Length along the wall, m."""
        return self.high - self.low


class FloorPlan:
    """One floor of a building.

    Args:
        skeleton: skeleton of the building.
        style: style of the building.
        rng: random generator of this floor.

    Attributes:
        rooms: all of them, corridors (kind ``corridor``) last.
        openings: doors, windows, glass walls.
        columns: columns half inside the facade, m.
    """

    def __init__(self, skeleton: Skeleton, style: Style, rng: np.random.Generator):
        self.skeleton, self.style, self._rng = skeleton, style, rng
        self.corridors = [Room(name, *box, "corridor") for name, box in skeleton.corridors.items()]
        self.rooms: list[Room] = []
        for block in skeleton.blocks:
            self._split(block)
        self.rooms += self.corridors
        self.openings: list[Opening] = []
        self.borders = {room.name: _borders(room, self.rooms, 2 * style.inner) for room in self.rooms}
        self._doors()
        self._windows()
        self._keep_ways()
        self.columns = self._columns()

    # Rooms

    def _split(self, block: Block) -> None:
        """Divide a block into rooms side by side, each a whole number of modules wide, with a few repeated widths."""
        rng, style = self._rng, self.style
        x0, y0, x1, y1 = block.box
        start, end = (x0, x1) if block.axis == 0 else (y0, y1)
        if block.use in ("stairs", "toilet"):
            self._room(block, start, end, block.use)
            return
        modules = max(1, round((end - start) / block.pitch))
        pitch = (end - start) / modules
        least = max(1, int(np.ceil(NARROWEST / pitch)))
        usual = max(least, round(block.room / pitch))
        most = max(usual, int(WIDEST / pitch))
        widths: list[int] = []
        choices = [usual, max(least, usual - 1), min(most, 2 * usual), usual + 1]
        while sum(widths) < modules:
            widths += [int(rng.choice(choices, p=[0.55, 0.2, 0.15, 0.1]))] * int(rng.integers(1, 4))
        while sum(widths) > modules:
            excess = sum(widths) - modules
            last = widths.pop()
            if last - excess >= least:
                widths.append(last - excess)
            elif last < excess:
                continue
            elif widths:  # the rest is too narrow: add it to the previous room, or share both
                both = widths.pop() + last - excess
                widths += [both] if both <= most else [both - both // 2, both // 2]
            else:
                widths.append(last - excess)
        edges = start + pitch * np.cumsum([0, *widths])
        cuts = [(float(a), float(b)) for a, b in zip(edges[:-1], edges[1:], strict=True)]
        cuts = self._joined_at_corners(block, cuts, start + pitch * np.arange(modules + 1))
        for a, b in cuts:
            half = style.inner / 2
            self._room(block, a + (half if a > start + 0.01 else 0), b - (half if b < end - 0.01 else 0), "")

    def _joined_at_corners(
        self, block: Block, cuts: list[tuple[float, float]], axes: Float[np.ndarray, "axis"]
    ) -> list[tuple[float, float]]:
        """Extend a room in a corner of the building into its neighbour, if it would touch no corridor."""
        for last in (False, True):
            cuts = cuts[::-1] if last else cuts
            while len(cuts) > 1 and not self._reaches_corridor(block, *cuts[0]):
                low, high = min(cuts[0][0], cuts[1][0]), max(cuts[0][1], cuts[1][1])
                ends = (
                    [((low, e), (e, high)) for e in axes] if not last else [((e, high), (low, e)) for e in axes[::-1]]
                )
                enough = [(a, b) for a, b in ends if b[1] - b[0] >= NARROWEST + self.style.inner
                          and a[1] > a[0] and self._reaches_corridor(block, *a)]  # fmt: skip
                wide = high - low > WIDEST and enough
                cuts[:2] = [*map(lambda c: (float(c[0]), float(c[1])), enough[0])] if wide else [(low, high)]
            cuts = cuts[::-1] if last else cuts
        return cuts

    def _box(self, block: Block, a: float, b: float) -> Box:
        x0, y0, x1, y1 = block.box
        x0, y0, x1, y1 = (round(v, 2) for v in ((a, y0, b, y1) if block.axis == 0 else (x0, a, x1, b)))
        return x0, y0, x1, y1

    def _reaches_corridor(self, block: Block, a: float, b: float) -> bool:
        room = Room("", *self._box(block, a, b), "")
        needed = DOOR + 2 * JAMB + 0.2
        return any(border.length > needed for border in _borders(room, self.corridors, 2 * self.style.inner)
                   if border.other)  # fmt: skip

    def _room(self, block: Block, a: float, b: float, kind: str) -> None:
        box = self._box(block, a, b)
        width, depth = (box[2] - box[0], box[3] - box[1])[:: 1 if block.axis == 0 else -1]
        if not kind:
            weights = dict(self.style.core if block.use == "core" else self.style.kinds)
            if width < 6.0:
                weights.pop("lecture", None)
            else:  # wide rooms are for many
                weights["lecture"] = 6.0 * weights.get("lecture", 0.3)
            if width < 4.0:
                weights.pop("meeting", None)
            share = np.array(list(weights.values()))
            kind = str(self._rng.choice(list(weights), p=share / share.sum()))
        self.rooms.append(Room(f"{kind} {len(self.rooms) + 1}", *box, kind))

    # Openings

    def _doors(self) -> None:
        rng = self._rng
        entered = [room for room in self.rooms if room.kind != "corridor"]
        ways = {room.name: [b for b in self.borders[room.name] if b.other in self.corridors
                            and b.length > DOOR + 2 * JAMB] for room in entered}  # fmt: skip
        suites = self._suites(entered)
        joined = {room.name for pair in suites for room in (pair.room, pair.other) if room}
        for number, room in enumerate(entered):
            if room.kind == "stairs":
                ways[room.name] = [b for b in ways[room.name] if b.side in "ns"]
            fronts = sorted(ways[room.name], key=lambda b: (-round(b.length, 2), b.side))
            if not fronts:
                continue
            if len(fronts) > 1 and fronts[1].length > 0.8 * fronts[0].length:
                k = int(rng.integers(2))
                fronts[0], fronts[k] = fronts[k], fronts[0]
            self._front(fronts[0], number, must_open=room.name in joined)
            # Rooms between two corridors are passages, or have a closed second door.
            across = [b for b in fronts[1:] if b.side == OPPOSITE[fronts[0].side]]
            if across and room.kind not in ("stairs", "toilet", "storage") and rng.random() < 0.5:
                self._front(across[0], number, must_open=rng.random() < 0.6)
        for border in suites:
            self._suite_door(border)

    def _suites(self, rooms: list[Room]) -> list[Border]:
        """Pairs of neighbouring rooms with a door between them; at least two."""
        shut = ("toilet", "stairs", "corridor")
        pairs = [b for room in rooms for b in self.borders[room.name]
                 if b.side in "en" and b.other and room.kind not in shut and b.other.kind not in shut
                 and b.length > 3.2]  # fmt: skip
        chosen = [b for b in pairs if self._rng.random() < self.style.suites]
        return chosen if len(chosen) >= 2 else pairs[:: max(1, len(pairs) // 2)]

    def _front(self, border: Border, number: int, must_open: bool) -> None:
        """Open the wall between a room and a corridor: entirely, by a glass wall, or by a door near one end."""
        rng, style, room = self._rng, self.style, border.room
        if room.kind == "lounge" and border.length > 2.6:
            self._open(border, border.low + 0.5, border.high - 0.5, "way", top=min(2.6, style.height - 0.3))
            return
        at_low = number % 2 == 0
        low = border.low + JAMB if at_low else border.high - JAMB - DOOR
        leaf, angle = self._leaf(must_open or room.kind == "stairs")
        if room.kind in ("stairs", "toilet", "storage") and leaf == "glass":
            leaf = "metal"
        # Hinged at the end next to the corner, open as far as the corner allows.
        free = low - border.low if at_low else border.high - low - DOOR
        angle = min(angle, np.pi / 2 + np.arcsin(np.clip((free - 0.2) / DOOR, -0.1, 0.35)))
        swing: dict[str, Any] = {"leaf": leaf, "angle": float(angle), "hinge": -1 if at_low else 1}
        if room.kind in ("office", "meeting", "lecture", "lab") and rng.random() < style.glazed and border.length > 2.4:
            ends = border.low + 0.12, border.high - 0.12
            self._open(border, *ends, "glass wall", bay=(low, low + DOOR), top=style.height - 0.5, **swing)
        else:
            if leaf == "glass":
                swing["leaf"] = "wood"
            self._open(border, low, low + DOOR, "door", top=DOOR_HEIGHT, **swing)

    def _leaf(self, must_open: bool) -> tuple[str, float]:
        doors = self.style.doors
        weights = np.array(list(doors.leaf.values()))
        leaf = str(self._rng.choice(list(doors.leaf), p=weights / weights.sum()))
        share, wide, gap = self._rng.random(), self._rng.uniform(85, 108), self._rng.uniform(25, 55)
        if must_open or share > doors.closed + doors.ajar:
            return leaf, np.deg2rad(wide)
        return leaf, 0.0 if share < doors.closed else np.deg2rad(gap)

    def _suite_door(self, border: Border) -> None:
        """Add a doorway in the half of the wall away from the corridor, clear of the door leaves there."""
        doors = [o for o in self.openings if o.room in (border.room, border.other) and o.kind != "window"]
        # Away from the corridor: away from the wall with doors.
        low_side, high_side = ("w", "e") if border.side in "ns" else ("s", "n")
        low, high = border.low + 0.6, border.high - 0.6 - DOOR
        if any(o.side == low_side for o in doors):
            low = min(max(low, border.low + 1.6), high)
        if any(o.side == high_side for o in doors):
            high = max(min(high, border.high - 1.6 - DOOR), low)
        at = round(float(self._rng.uniform(low, high)), 2)
        self._open(border, at, at + DOOR, "way", top=DOOR_HEIGHT)

    def _open(
        self, border: Border, low: float, high: float, kind: str, top: float, bottom: float = 0.0, **more: Any
    ) -> None:
        room, other = border.room, border.other
        thickness = self.style.outer if other is None else _gap(room, other, border.side)
        low, high = round(low, 3), round(high, 3)
        name = f"{room.name} {kind} {len(self.openings) + 1}"
        self.openings.append(Opening(name, room, border.side, low, high, bottom, top, thickness, kind, other, **more))

    def _windows(self) -> None:
        """Add windows on the axes of the facade, in rooms and at the ends of corridors."""
        w, pitch = self.style.windows, self.skeleton.blocks[0].pitch
        for room in self.rooms:
            if room.kind == "stairs":
                continue
            for border in self.borders[room.name]:
                if border.other is not None or border.length < 1.2 or self._faces_ground(border):
                    continue
                count = max(1, round(border.length / pitch))
                step = border.length / count
                if w.width >= 1:
                    self._open(border, border.low + 0.1, border.high - 0.1, "window", w.top, w.sill)
                    continue
                for k in range(count):
                    middle, half = border.low + (k + 0.5) * step, w.width * step / 2
                    self._open(border, middle - half, middle + half, "window", w.top, w.sill)

    def _faces_ground(self, border: Border) -> bool:
        """Whether another part of the building is outside of a wall: a shaft, or a wing close by."""
        thick = self.style.outer
        return self.skeleton.outline.intersects(
            area(*strip(border.room, border.side, border.low + 0.1, border.high - 0.1, thick + 0.02, thick + 1.0))
        )

    def _keep_ways(self) -> None:
        """Mark the floor under door leaves as taken, and that in front of and between doors as kept free."""
        spots: dict[str, list[tuple[float, float]]] = {}
        for o in self.openings:
            if o.passage is None:
                continue
            if o.angle:
                o.room.taken.append(o.leaf_area())
            for room, side in ((o.room, o.side), (o.other, OPPOSITE[o.side])):
                if room is None:
                    continue
                low, high = o.passage
                margin = 0.1 if high - low < 1.5 else 0.0
                depth = min(APPROACH, min(room.size) - 0.05)
                room.kept.append(area(*strip(room, side, low - margin, high + margin, -depth, 0.0)))
                spots.setdefault(room.name, []).append(room.wall_place(side, (low + high) / 2, 0.6)[:2])
        for room in self.rooms:
            at = spots.get(room.name, [])
            if room.kind in ("corridor", "stairs"):
                continue
            # Only shorter paths are kept; longer ones follow them.
            for k in range(1, len(at)):
                nearest = at[np.hypot(*(np.array(at[:k]) - at[k]).T).argmin()]
                room.kept.append(LineString([nearest, at[k]]).buffer(0.55))

    # Walls

    def _columns(self) -> list[Box]:
        """Columns where walls between rooms meet the facade, and in the corners of large rooms."""
        what, width = self.style.column
        found: list[Box] = []
        large = [r for r in self.rooms if r.kind not in ("corridor", "stairs", "toilet") and min(r.size) >= 3.5]
        for border in (b for room in large for b in self.borders[room.name] if what):
            if border.other is None and border.length >= 3.5:
                low = border.room.wall(border.side)[0]
                box = strip(border.room, border.side, low, low + width, -0.6 * width, 0.0)
                x0, y0, x1, y1 = (round(v, 3) for v in box)
                found.append((x0, y0, x1, y1))
                border.room.taken.append(area(*found[-1]).buffer(0.02))
        return found

    def labels(self, found: list[Face]) -> Iterator[tuple[str, str]]:
        """Yield name and material of the object that each face of the walls belongs to."""
        style = self.style
        # Within the wall's thickness, away from its faces.
        reveals = [
            area(x0 - dx, y0 - dy, x1 + dx, y1 + dy)
            for o in self.openings
            for x0, y0, _, x1, y1, _ in [o.span]
            for dx, dy in [(1e-3, -5e-3) if o.side in "ns" else (-5e-3, 1e-3)]
        ]
        points = shapely.points(np.array([face.corners.mean(axis=0)[:2] for face in found]))
        near = shapely.distance(points, self.skeleton.outline.exterior)
        in_reveal, in_corridor, at_column = (
            shapely.covers(shapely.union_all(parts), points)
            for parts in (reveals, [c.floor.buffer(0.01) for c in self.corridors], [area(*c) for c in self.columns])
        )
        for k, face in enumerate(found):
            plane = f"{'xyz'[face.axis]} {face.sign * face.level:+.3f}"
            if near[k] < 1e-3 and not in_reveal[k]:
                yield f"facade {plane}", style.facade
            elif at_column[k]:
                yield f"column {plane}", style.column[0]
            elif face.axis == 2 or in_reveal[k]:
                what = style.lining if near[k] < style.outer else style.doors.frame
                yield f"reveals {what}", what
            elif near[k] < style.outer + 0.01:
                yield f"outer wall {plane}", style.lining
            elif in_corridor[k]:
                yield f"corridor wall {plane}", style.passage
            else:
                yield f"wall {plane}", style.partition


def _gap(room: Room, other: Room, side: str) -> float:
    """Thickness of the wall between two rooms, m."""
    return {"n": other.y0 - room.y1, "s": room.y0 - other.y1, "e": other.x0 - room.x1, "w": room.x0 - other.x1}[side]


def _borders(room: Room, rooms: list[Room], thickest: float) -> list[Border]:
    """Neighbours behind the four walls of a room: rooms across walls up to a thickness (m), otherwise the outside.

    Where another room begins, the outside ends a wall's thickness earlier.
    """
    found = []
    for side in "nsew":
        low, high = room.wall(side)
        free = LineString([(low, 0), (high, 0)])
        for other in rooms:
            if other is room or not -0.005 < _gap(room, other, side) < thickest + 1.0:
                continue
            a, b = other.wall(side)
            a_in, b_in = max(a, low), min(b, high)
            gap = _gap(room, other, side)
            if b_in - a_in > 0.01 and 0.01 < gap < thickest:
                found.append(Border(room, side, a_in, b_in, other))
            free = free.difference(LineString([(a - thickest, 0), (b + thickest, 0)]))
        for part in shapely.get_parts(free):
            if part.length > 0.5:
                a, _, b, _ = part.bounds
                found.append(Border(room, side, a, b, None))
    return found
