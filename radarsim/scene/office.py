"""The plain office: a furnished floor from a few numbers and a seed.

A corridor runs along x with rooms on both sides. Neighbouring rooms are joined in pairs by a doorway, so there are
loops to walk: corridor, room, neighbour, corridor. World origin at the floor's south-west corner, floor at z = 0.
"""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from shapely.geometry import LineString
from shapely.geometry import box as area

from radarsim.scene import furniture, shapes, walls
from radarsim.scene.furniture import Piece
from radarsim.scene.objects import SceneObject
from radarsim.scene.rooms import Room, Site, footprint, sorted_box

OUTER, INNER = 0.30, 0.12  # wall thickness, m
DOOR_WIDTH, DOOR_HEIGHT, LEAF = 1.0, 2.1, 0.04
SILL, WINDOW_TOP, FRAME = 0.9, 2.2, 0.06


class Office(BaseModel):
    """Office floor; `build` gives its objects. Same parameters, same objects to the last bit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    kind: Literal["office"] = "office"
    seed: int = 0
    length: Annotated[float, Field(ge=8, le=200)] = 18.0  # along x, outside to outside, m
    depth: Annotated[float, Field(ge=8, le=40)] = 12.0  # along y
    height: Annotated[float, Field(ge=2.4, le=6)] = 2.7  # floor to ceiling
    corridor: Annotated[float, Field(ge=1.4, le=6)] = 2.0  # width
    room: Annotated[float, Field(ge=2.8, le=12)] = 4.2  # mean width of a room
    furnished: bool = True

    def build(self) -> list[SceneObject]:
        """All objects of the floor: walls, floors, ceilings, doors, windows, fittings, furniture."""
        return _Builder(self).objects


class _Builder(Site):
    def __init__(self, office: Office):
        super().__init__(np.random.default_rng(office.seed), office.height)
        self.office = office
        self.solids: list[walls.Span] = []
        self.openings: list[walls.Span] = []
        self._shell()
        self._rooms()
        self._doors()
        self._windows()
        self._surfaces()
        for room in [*self.rooms, self.hall]:
            self.lamps(room, furniture.lamp(office.height), 2.2)
            if office.furnished:
                self._furnish(room)

    # Walls and openings

    def _solid(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self.solids.append((x0, y0, 0.0, x1, y1, self.office.height))

    def _open(self, x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> None:
        self.openings.append((x0, y0, z0, x1, y1, z1))

    def _shell(self) -> None:
        length, depth = self.office.length, self.office.depth
        for x in (0.0, length - OUTER):
            self._solid(x, 0, x + OUTER, depth)
        for y in (0.0, depth - OUTER):
            self._solid(0, y, length, y + OUTER)

    def _rooms(self) -> None:
        o, rng = self.office, self.rng
        low = o.depth / 2 - o.corridor / 2
        self.hall = Room("corridor", OUTER, low, o.length - OUTER, low + o.corridor, "corridor")
        self.rooms: list[Room] = []
        self.sides: list[list[Room]] = []
        kinds = ["office", "office", "meeting", "storage", "lounge"]
        for side, (y0, y1) in enumerate(((OUTER, low - INNER), (low + o.corridor + INNER, o.depth - OUTER))):
            wall = y1 if side == 0 else y0 - INNER
            self._solid(OUTER, wall, o.length - OUTER, wall + INNER)
            count = max(2, round((o.length - 2 * OUTER) / o.room))
            widths = rng.uniform(0.8, 1.2, count)
            edges = OUTER + np.concatenate([[0], np.cumsum(widths / widths.sum())]) * (o.length - 2 * OUTER)
            edges = edges.round(2)
            order = [kinds[(i + side * 2) % len(kinds)] for i in rng.permutation(count)]
            row = []
            for i in range(count):
                x0 = edges[i] + (INNER / 2 if i else 0)
                x1 = edges[i + 1] - (INNER / 2 if i < count - 1 else 0)
                row.append(Room(f"{'south' if side == 0 else 'north'} {i + 1}", x0, y0, x1, y1, order[i]))
                if i:
                    self._solid(edges[i] - INNER / 2, y0, edges[i] + INNER / 2, y1)
            self.sides.append(row)
            self.rooms += row

    def _doors(self) -> None:
        for side, row in enumerate(self.sides):
            for i, room in enumerate(row):
                # Rooms 1-2, 3-4, ... share a doorway. The first pair of a side keeps both doors open: a loop to walk.
                self._corridor_door(room, side, is_open=self.rng.random() < 0.75 or i < 2)
            for left, right in zip(row[::2], row[1::2], strict=False):
                self._doorway(left, right, side)

    def _corridor_door(self, room: Room, side: int, is_open: bool) -> None:
        rng = self.rng
        x0 = round(rng.uniform(room.x0 + 0.35, room.x1 - 0.35 - DOOR_WIDTH), 2)
        wall = room.y1 if side == 0 else room.y0 - INNER
        self._open(x0, wall, x0 + DOOR_WIDTH, wall + INNER, 0, DOOR_HEIGHT)
        inward = -1 if side == 0 else 1
        face = room.y1 if side == 0 else room.y0
        room.kept.append(area(*sorted_box(x0 - 0.1, face, x0 + DOOR_WIDTH + 0.1, face + inward * 1.1)))
        # The way to the middle of the room stays walkable, through whichever doors there are.
        room.kept.append(LineString([(x0 + DOOR_WIDTH / 2, face), room.center]).buffer(0.5))
        name = f"{room.name} door"
        if not is_open:
            leaf = shapes.box(
                (x0 + DOOR_WIDTH / 2, wall + INNER / 2, DOOR_HEIGHT / 2),
                (DOOR_WIDTH, LEAF, DOOR_HEIGHT),
                without=("-x", "+x", "-z", "+z"),
            )
            self.add(name, leaf, "wood")
            return
        hinge_left = rng.random() < 0.5
        swing = np.deg2rad(rng.uniform(82, 112))
        leaf = shapes.box((DOOR_WIDTH / 2 - 0.02, 0, DOOR_HEIGHT / 2), (DOOR_WIDTH - 0.06, LEAF, DOOR_HEIGHT - 0.03))
        yaw = inward * swing if hinge_left else np.pi - inward * swing
        x = x0 + 0.03 if hinge_left else x0 + DOOR_WIDTH - 0.03
        handle = shapes.box((DOOR_WIDTH - 0.12, 0, 1.05), (0.12, LEAF + 0.10, 0.02))
        for what, part in (("wood", leaf), ("metal", handle)):
            self.add(f"{name} {'leaf' if what == 'wood' else 'handle'}",
                     shapes.placed(part, (x, face + inward * 0.03, 0), (0, 0, yaw)), what)  # fmt: skip
        tip = (x + DOOR_WIDTH * np.cos(yaw), face + inward * 0.03 + DOOR_WIDTH * np.sin(yaw))
        room.taken.append(LineString([(x, face), tip]).buffer(0.08))

    def _doorway(self, left: Room, right: Room, side: int) -> None:
        # At least 1.3 m from the corridor wall, clear of the opened door leaves.
        depth = left.y1 - left.y0
        offset = self.rng.uniform(1.4, max(1.5, depth - DOOR_WIDTH - 0.7))
        y0 = round(left.y1 - offset - DOOR_WIDTH if side == 0 else left.y0 + offset, 2)
        self._open(left.x1, y0, right.x0, y0 + DOOR_WIDTH, 0, DOOR_HEIGHT)
        middle = y0 + DOOR_WIDTH / 2
        for room, face, inward in ((left, left.x1, -1), (right, right.x0, 1)):
            room.kept.append(area(*sorted_box(face, y0 - 0.1, face + inward * 0.9, y0 + DOOR_WIDTH + 0.1)))
            room.kept.append(LineString([(face, middle), room.center]).buffer(0.5))

    def _windows(self) -> None:
        o = self.office
        for side, row in enumerate(self.sides):
            wall = 0.0 if side == 0 else o.depth - OUTER
            for room in row:
                count = max(1, round((room.x1 - room.x0) / 2.4))
                pitch = (room.x1 - room.x0) / count
                for k in range(count):
                    width = min(1.6, pitch - 0.5)
                    x0 = round(room.x0 + (k + 0.5) * pitch - width / 2, 2)
                    self._window(f"{room.name} window {k + 1}", x0, x0 + width, wall, along_x=True)
                    y = room.y0 + 0.10 if side == 0 else room.y1 - 0.10
                    piece = furniture.radiator(self.rng, width=min(1.2, width))
                    self.put(room, piece, x0 + width / 2, y, np.pi / 2 if side == 0 else -np.pi / 2)
        for end, wall in (("west", 0.0), ("east", o.length - OUTER)):
            middle = (self.hall.y0 + self.hall.y1) / 2
            self._window(f"corridor window {end}", middle - 0.6, middle + 0.6, wall, along_x=False)

    def _window(self, name: str, a0: float, a1: float, wall: float, along_x: bool) -> None:
        """Opening in an outer wall, metal frame with a mullion, one pane each side of it."""

        def lay(a: float, b: float, z: float, c: float, d: float, top: float) -> walls.Span:
            return (a, b, z, c, d, top) if along_x else (b, a, z, d, c, top)

        def bar(a, z, c, top, without=()):
            s = lay(a, wall + OUTER / 2 - 0.035, z, c, wall + OUTER / 2 + 0.035, top)
            turned = tuple(w if along_x or w[1] == "z" else w[0] + "y" for w in without)
            return shapes.span(s[:3], s[3:], turned)

        self.openings.append(lay(a0, wall, SILL, a1, wall + OUTER, WINDOW_TOP))
        middle, low, high = (a0 + a1) / 2, SILL + FRAME, WINDOW_TOP - FRAME
        frame = [
            bar(a0, SILL, a1, low, ("-x", "+x", "-z")),
            bar(a0, high, a1, WINDOW_TOP, ("-x", "+x", "+z")),
            bar(a0, low, a0 + FRAME, high, ("-x", "-z", "+z")),
            bar(a1 - FRAME, low, a1, high, ("+x", "-z", "+z")),
            bar(middle - FRAME / 2, low, middle + FRAME / 2, high, ("-z", "+z")),
        ]
        self.add(f"{name} frame", shapes.joined(*frame), "metal")
        panes = []
        for c0, c1 in ((a0 + FRAME, middle - FRAME / 2), (middle + FRAME / 2, a1 - FRAME)):
            center = ((c0 + c1) / 2, wall + OUTER / 2) if along_x else (wall + OUTER / 2, (c0 + c1) / 2)
            facing = (0, 1, 0) if along_x else (1, 0, 0)
            panes.append(shapes.rectangle((*center, (low + high) / 2), (c1 - c0, high - low), facing))
        self.add(f"{name} panes", shapes.joined(*panes), "glass")

    def _surfaces(self) -> None:
        """Wall faces by plane, floors and ceilings by room."""
        o = self.office
        planes: dict[tuple, list[walls.Face]] = {}
        outer = {(0, 0.0), (0, o.length), (1, 0.0), (1, o.depth)}
        for face in walls.faces(self.solids, self.openings):
            plane = (face.axis, round(face.level, 6))
            narrow = min(face.high[0] - face.low[0], face.high[1] - face.low[1]) < OUTER + 0.01
            if plane in outer:
                key = ("facade", face.axis, face.level, "concrete")
            elif narrow:
                key = ("reveals", 0, 0.0, "plasterboard")
            else:
                key = ("wall", face.axis, face.sign * face.level, "plasterboard")
            planes.setdefault(key, []).append(face)
        for (kind, axis, level, what), parts in planes.items():
            name = kind if kind == "reveals" else f"{kind} {'xyz'[axis]} {level:+.2f}"
            self.add(name, walls.surface(parts), what)
        for room in [*self.rooms, self.hall]:
            size = (room.x1 - room.x0, room.y1 - room.y0)
            carpet = room.kind in ("office", "meeting", "lounge")
            what = "carpet" if carpet else "vinyl"
            self.add(f"{room.name} floor", shapes.rectangle((*room.center, 0.0), size, (0, 0, 1)), what)
            ceiling = shapes.rectangle((*room.center, o.height), size, (0, 0, -1))
            self.add(f"{room.name} ceiling", ceiling, "ceiling board")
        sills = [
            shapes.rectangle(((x0 + x1) / 2, (y0 + y1) / 2, 0.0), (x1 - x0, y1 - y0), (0, 0, 1))
            for x0, y0, z0, x1, y1, _ in self.openings
            if z0 == 0
        ]
        self.add("thresholds", shapes.joined(*sills), "vinyl")

    # Things in rooms

    def _furnish(self, room: Room) -> None:
        rng = self.rng
        if room.kind == "corridor":
            # Only what leaves the way free.
            for make in (furniture.cabinet, furniture.extinguisher, furniture.cabinet, furniture.bin):
                self._along_corridor(make(rng))
            return
        if room.kind == "office":
            for _ in range(3):
                self._workplace(room)
            plan = [furniture.cabinet, furniture.shelf, furniture.bin, furniture.whiteboard, furniture.cabinet]
        elif room.kind == "meeting":
            self._meeting(room)
            plan = [furniture.whiteboard, furniture.cabinet, furniture.whiteboard]
        elif room.kind == "storage":
            plan = [furniture.cabinet] * 3 + [furniture.shelf] * 3 + [furniture.printer, furniture.bin]
        else:
            plan = [furniture.sofa, furniture.sofa, furniture.table, furniture.shelf, furniture.printer]
        for make in plan:
            self.against_wall(room, make(rng))

    def _along_corridor(self, piece: Piece) -> None:
        for _ in range(40):
            north = self.rng.random() < 0.5
            x = self.rng.uniform(self.hall.x0 + 0.8, self.hall.x1 - 0.8)
            back = 0.02 + piece.depth / 2
            y, yaw = (self.hall.y1 - back, -np.pi / 2) if north else (self.hall.y0 + back, np.pi / 2)
            spot = footprint(piece, x, y, yaw).buffer(0.3)
            doors = [area(s[0], s[1], s[3], s[4]) for s in self.openings if s[2] == 0]
            if not any(spot.intersects(other) for other in doors + self.hall.taken):
                self.put(self.hall, piece, x, y, yaw)
                return

    def _workplace(self, room: Room) -> None:
        yaw = self.against_wall(room, furniture.desk(self.rng), "nsew", gap=0.2)
        if yaw is None:
            return
        self.seat(room, *room.taken[-1].centroid.coords[0], yaw, ignore_kept=True)

    def _meeting(self, room: Room) -> None:
        """A table where the ways through the room leave space, with chairs along its sides."""
        piece = furniture.table(self.rng)
        for _ in range(60):
            x = self.rng.uniform(room.x0 + 1.2, room.x1 - 1.2)
            y = self.rng.uniform(room.y0 + 1.2, room.y1 - 1.2)
            yaw = self.rng.choice([0.0, np.pi / 2])
            if room.is_free(footprint(piece, x, y, yaw)):
                break
        else:
            self.against_wall(room, piece)
            return
        self.put(room, piece, x, y, yaw)
        for side in (-1, 1):
            for along in (-0.45, 0.45):
                seat = np.array([side * 0.82, along + self.rng.uniform(-0.08, 0.08)])
                c, s = np.cos(yaw), np.sin(yaw)
                cx, cy = x + c * seat[0] - s * seat[1], y + s * seat[0] + c * seat[1]
                turn = yaw + (np.pi if side > 0 else 0.0) + self.rng.uniform(-0.3, 0.3)
                chair = furniture.chair(self.rng)
                if room.is_free(footprint(chair, cx, cy, turn)):
                    self.put(room, chair, cx, cy, turn)
