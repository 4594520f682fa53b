"""The style `office`: a corridor along x with rooms on both sides, and furniture here and there along their walls.

Neighbouring rooms are joined in pairs by a doorway, so there are loops to walk: corridor, room, neighbour, corridor.
"""

from collections.abc import Iterator

import numpy as np
from shapely.geometry import LineString
from shapely.geometry import box as area

from radarsim.world.generators.furniture import Piece, make
from radarsim.world.generators.layout import JAMB, FloorPlan
from radarsim.world.generators.openings import DOOR, DOOR_HEIGHT, OPPOSITE, Opening, strip
from radarsim.world.generators.rooms import Room, Site, footprint
from radarsim.world.generators.skeleton import Block, Box
from radarsim.world.generators.walls import Face

#: Of a window in a room and of one at the corridor's ends, and least distance of two windows, m.
WINDOW, END_WINDOW, PIER = 1.6, 1.2, 0.5


class OfficePlan(FloorPlan):
    """Rooms of many widths; each has a door to the corridor, and every other one a doorway to the next."""

    def _split(self, block: Block) -> None:
        x0, y0, _, y1 = block.box
        length = self.skeleton.outline.bounds[2] - 2 * x0
        count = max(2, round(length / block.pitch))
        widths = self._rng.uniform(0.8, 1.2, count)
        edges = (x0 + np.concatenate([[0], np.cumsum(widths / widths.sum())]) * length).round(2)
        kinds = [kind for kind, number in self.style.kinds.items() for _ in range(int(number))]
        half, (row, shift) = self.style.inner / 2, ("north", 2) if self.rooms else ("south", 0)
        for i, k in enumerate(self._rng.permutation(count)):
            west, east = edges[i] + (half if i else 0), edges[i + 1] - (half if i < count - 1 else 0)
            self.rooms.append(Room(f"{row} {i + 1}", west, y0, east, y1, kinds[(k + shift) % len(kinds)]))

    @property
    def rows(self) -> tuple[list[Room], list[Room]]:
        """The rooms south and north of the corridor, from west to east."""
        hall = self.corridors[0]
        return [r for r in self.rooms if r.y1 < hall.y0], [r for r in self.rooms if r.y0 > hall.y1]

    def _doors(self) -> None:
        rng, thick, (leaf,) = self._rng, self.style.inner, self.style.doors.leaf
        for row, side in zip(self.rows, "ns", strict=True):
            for i, room in enumerate(row):
                # Rooms 1-2, 3-4, ... share a doorway. The first pair of a side keeps both doors open: a loop to walk.
                is_open = rng.random() < 1 - self.style.doors.closed or i < 2
                low = round(rng.uniform(room.x0 + JAMB, room.x1 - JAMB - DOOR), 2)
                hinge, swing = (rng.random(), rng.uniform(82, 112)) if is_open else (0.0, 0.0)
                door = Opening(
                    f"{room.name} door", room, side, low, low + DOOR, 0.0, DOOR_HEIGHT, thick, "door",
                    self.corridors[0], leaf, np.deg2rad(swing), -1 if hinge < 0.5 else 1,
                )  # fmt: skip
                self.openings.append(door)
            for left, right in zip(row[::2], row[1::2], strict=False):
                # At least 1.3 m from the corridor wall, clear of the opened door leaves.
                offset = rng.uniform(1.4, max(1.5, left.size[1] - DOOR - 0.7))
                low = round(left.y1 - offset - DOOR if side == "n" else left.y0 + offset, 2)
                name, gap = f"{left.name} way", right.x0 - left.x1
                self.openings.append(Opening(name, left, "e", low, low + DOOR, 0.0, DOOR_HEIGHT, gap, "way", right))

    def spaces(self) -> list[Box]:
        """Rooms end at whole centimetres, but the outer wall is where the length says."""
        far = self.corridors[0].x1
        return [(x0, y0, far if x1 > far - 0.01 else x1, y1) for x0, y0, x1, y1 in super().spaces()]

    def window(self, room: Room) -> tuple[int, float]:
        """Number and width (m) of a room's windows."""
        count = max(1, round(room.size[0] / self.style.module[0]))
        return count, min(WINDOW, room.size[0] / count - PIER)

    def _windows(self) -> None:
        places, hall, half = [], self.corridors[0], END_WINDOW / 2
        for row, side in zip(self.rows, "sn", strict=True):
            for room in row:
                count, width = self.window(room)
                for k in range(count):
                    low = round(room.x0 + (k + 0.5) * (room.size[0] / count) - width / 2, 2)
                    places.append((str(k + 1), room, side, low, low + width))
        places += [(end, hall, end[0], hall.center[1] - half, hall.center[1] + half) for end in ("west", "east")]
        w, thick = self.style.windows, self.style.outer
        for name, room, side, low, high in places:
            name = f"{room.name} window {name}"
            self.openings.append(Opening(name, room, side, low, high, w.sill, w.top, thick, "window"))

    def _keep_ways(self) -> None:
        for o in self.openings:
            if o.angle:
                o.room.taken.append(o.leaf_area(0.03, 0.08))
            for room, side in ((o.room, o.side), (o.other, OPPOSITE[o.side])):
                if o.passage and room and room.kind != "corridor":
                    depth, middle = (1.1 if o.kind == "door" else 0.9), (o.low + o.high) / 2
                    room.kept.append(area(*strip(room, side, o.low - 0.1, o.high + 0.1, -depth, 0.0)))
                    # The way to the middle of the room stays walkable, through whichever doors there are.
                    way = LineString([room.wall_place(side, middle, 0.0)[:2], room.center])
                    room.kept.append(way.buffer(0.5))

    def labels(self, found: list[Face]) -> Iterator[tuple[str, str]]:
        """Name and material of what each face of the walls belongs to; whatever is narrow counts as a reveal."""
        x0, y0, x1, y1 = self.skeleton.outline.bounds
        for face in found:
            axis = "xyz"[face.axis]
            if face.level in {"x": (x0, x1), "y": (y0, y1), "z": ()}[axis]:
                yield f"facade {axis} {face.level:+.2f}", self.style.facade
            elif min(np.subtract(face.high, face.low)) < self.style.outer + 0.01:
                yield "reveals", self.style.lining
            else:
                yield f"wall {axis} {face.sign * face.level:+.2f}", self.style.lining


_ALONG_WALLS = {
    "corridor": ("cabinet", "extinguisher", "cabinet", "bin"),
    "office": ("cabinet", "shelf", "bin", "whiteboard", "cabinet"),
    "meeting": ("whiteboard", "cabinet", "whiteboard"),
    "storage": (*("cabinet",) * 3, *("shelf",) * 3, "printer", "bin"),
    "lounge": ("sofa", "sofa", "table", "shelf", "printer"),
}


def arrange(site: Site, room: Room, plan: FloorPlan) -> None:
    """Put furniture into a room; ways and doors stay free."""
    if room.kind == "office":
        for _ in range(3):
            yaw = site.against_wall(room, make("desk", site.rng), gap=0.2)
            if yaw is not None:
                x, y = room.taken[-1].centroid.coords[0]
                site.seat(room, x, y, yaw, ignore_kept=True)
    elif room.kind == "meeting":
        _meeting(site, room)
    for kind in _ALONG_WALLS[room.kind]:
        if room.kind == "corridor":
            _along_corridor(site, room, make(kind, site.rng), plan)
        else:
            site.against_wall(room, make(kind, site.rng))


def _along_corridor(site: Site, room: Room, piece: Piece, plan: FloorPlan) -> None:
    """Only where it leaves doors free."""
    doors = [area(x0, y0, x1, y1) for x0, y0, _, x1, y1, _ in (o.span for o in plan.openings if o.passage)]
    for _ in range(40):
        side = "n" if site.rng.random() < 0.5 else "s"
        place = room.wall_place(side, site.rng.uniform(room.x0 + 0.8, room.x1 - 0.8), 0.02 + piece.depth / 2)
        spot = footprint(piece, *place).buffer(0.3)
        if not any(spot.intersects(other) for other in doors + room.taken):
            site.put(room, piece, *place)
            return


def _meeting(site: Site, room: Room) -> None:
    """A table where the ways through the room leave space, with chairs along its sides."""
    rng, piece = site.rng, make("table", site.rng)
    for _ in range(60 if min(room.size) > 2.4 else 0):
        x, y = rng.uniform(room.x0 + 1.2, room.x1 - 1.2), rng.uniform(room.y0 + 1.2, room.y1 - 1.2)
        yaw = rng.choice([0.0, np.pi / 2])
        if room.is_free(footprint(piece, x, y, yaw)):
            break
    else:
        site.against_wall(room, piece)
        return
    site.put(room, piece, x, y, yaw)
    for facing in (yaw - np.pi, yaw):
        for along in (-0.45, 0.45):
            along += rng.uniform(-0.08, 0.08)
            site.seat(room, x - along * np.sin(yaw), y + along * np.cos(yaw), facing, sway=0.3)
