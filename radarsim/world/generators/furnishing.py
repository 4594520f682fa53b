"""Furnishing of rooms by kind: rows of pieces along the walls and tables in the middle."""

import numpy as np
from shapely.geometry import box as area

from radarize.io.yamlfile import read_beside
from radarsim.world import shapes
from radarsim.world.generators.furniture import Piece, evaluate, make, value
from radarsim.world.generators.layout import FloorPlan
from radarsim.world.generators.openings import OPPOSITE
from radarsim.world.generators.rooms import Room, Site, footprint

_ROOMS = read_beside(__file__)
#: Clear width left beside furniture in a corridor, m.
CLEAR = 1.25


def furnish(site: Site, room: Room, plan: FloorPlan) -> None:
    """Put furniture and fittings into a room; paths between doors stay free."""
    if room.kind == "corridor":
        _corridor(site, room, plan)
        return
    layout = _Layout(site, room, plan)
    if room.kind == "stairs":
        layout.stairs()
        return
    layout.at_windows()
    if room.kind == "lecture":
        _lecture(layout)
    else:
        layout.arrange(_ROOMS[room.kind])


class _Layout:
    """Room with its sides named as seen from the door: front (the door's wall), back, left, right."""

    def __init__(self, site: Site, room: Room, plan: FloorPlan):
        self.site, self.room, self.plan, self.style = site, room, plan, plan.style
        self.rng = site.rng
        self.openings = [o for o in plan.openings if o.room is room]
        behind = [o for o in plan.openings if o.other is room]
        doors = [o.side for o in self.openings if o.kind in ("door", "glass wall")]
        entrances = [o.side for o in self.openings if o.kind == "way"]
        self.front = (doors or entrances or [OPPOSITE[o.side] for o in behind] or ["s"])[0]
        self.back = OPPOSITE[self.front]
        self.left, self.right = ("e", "w") if self.front in "ns" else ("n", "s")
        if self.rng.random() < 0.5:
            self.left, self.right = self.right, self.left
        self.windows = [o for o in self.openings if o.kind == "window"]
        self._materials = dict(zip(("cabinet", "shelf"), self.style.storage, strict=True))

    def at_windows(self) -> None:
        """Radiators below windows, pipes in a corner."""
        for o in self.windows:
            if o.bottom > 0.75 and self.rng.random() < self.style.radiators:
                piece = make("radiator", w=round(min(1.2, 0.9 * (o.high - o.low)), 2))
                self.site.put_if_free(self.room, piece, *self.room.wall_place(o.side, (o.low + o.high) / 2, 0.1))
        if self.rng.random() < self.style.risers:
            piece, corner = make("riser", height=self.site.height), 0.02 + 0.07
            x = self.room.x0 + corner if "w" in (self.left, self.back) else self.room.x1 - corner
            y = self.room.y0 + corner if "s" in (self.left, self.back) else self.room.y1 - corner
            self.site.put_if_free(self.room, piece, x, y, 0.0)

    def made(self, kind: str, material: str = "", **given: float) -> Piece:
        """Make a piece of a material, by default the style's."""
        return make(kind, self.rng, material or self._materials.get(kind, ""), **given)

    def line(
        self,
        side: str,
        kind: str,
        count: int,
        start: float | dict = 0.1,
        gap: float = 0.03,
        off: float = 0.03,
        material: str = "",
    ) -> list[tuple[float, float, float]]:
        """Put a row of pieces along a wall, from the window's end (or the low end); return their places."""
        room = self.room
        low, high = room.wall(side)
        downward = self.back in "ne" and side in (self.left, self.right)
        lit = any(o.side == side for o in self.windows)
        places: list[tuple[float, float, float]] = []
        at, piece = value(start, {}, self.rng), self.made(kind, material)
        while len(places) < count and at + piece.width < high - low - 0.03:
            middle = at + piece.width / 2
            place = room.wall_place(side, high - middle if downward else low + middle, off + piece.depth / 2)
            tall = max(m.bounds[1, 2] for m in piece.parts.values()) > 1.25
            if not (lit and tall) and self.site.put_if_free(room, piece, *place, margin=-0.003):
                places.append(place)
                at += piece.width + gap
                piece = self.made(kind, material)
            else:
                at += 0.15
        return places

    def arrange(self, steps: list[dict]) -> None:
        """Put furniture according to `furnishing.yaml`."""
        short, long = sorted(self.room.size)
        for step in steps:
            about = dict(step)
            side, kind, before = about.pop("at"), about.pop("put"), about.pop("before", None)
            kind = kind if isinstance(kind, str) else kind[int(self.rng.random() >= 0.5)]
            usual = evaluate(about.pop("count", 1), {"area": short * long, "short": short, "long": long})
            count = self.site.number(usual)
            if side == "middle":  # filled by the usual number
                self.tables(min(count, int(usual)), kind, **about)
                continue
            for x, y, yaw in self.line(getattr(self, side), kind, count, **about):
                if before == "chair":
                    self.site.seat(self.room, x, y, yaw)
                elif before:
                    piece = make(before["put"], self.rng, w=before["w"], d=before["d"])
                    x, y = x + before["away"] * np.cos(yaw), y + before["away"] * np.sin(yaw)
                    self.site.put_if_free(self.room, piece, x, y, yaw)

    def tables(self, rows: int, kind: str, seats: tuple[int, ...] = (), gap: float = 0.01, **given: float) -> None:
        """Put tables in the middle, end to end along the longer side, with chairs along `seats` (sides of the
        tables)."""
        room = self.room
        if not rows:
            return
        along_x = room.size[0] >= room.size[1]
        yaw = np.pi / 2 if along_x else 0.0
        pieces = [self.made(kind, "", **given) for _ in range(rows)]
        total = sum(p.width for p in pieces) + gap * (rows - 1)
        # As far from the door as the room allows, or in the middle.
        for shift in (0.0, 0.4, 0.8, 1.2, -0.4, -0.8):
            cx, cy = room.center
            away = {"n": (0, -1), "s": (0, 1), "e": (-1, 0), "w": (1, 0)}[self.front]
            cx, cy = cx + shift * away[0], cy + shift * away[1]
            whole = Piece("", pieces[0].depth, total, {})
            if room.is_free(footprint(whole, cx, cy, yaw).buffer(0.05)):
                break
        else:
            return
        at = -total / 2
        direction = np.array([-np.sin(yaw), np.cos(yaw)])
        for piece in pieces:
            x, y = np.array([cx, cy]) + (at + piece.width / 2) * direction
            self.site.put(room, piece, float(x), float(y), yaw)
            for side in seats:
                for along in (-0.27, 0.27):
                    sx, sy = np.array([x, y]) + along * piece.width * direction
                    self.site.seat(room, sx, sy, yaw + (0 if side > 0 else np.pi), away=piece.depth / 2 + 0.37)
            at += piece.width + gap

    def stairs(self) -> None:
        """Put stairs along the wall opposite to the door, starting at the door's end."""
        room = self.room
        door = next(o for o in self.openings if o.kind == "door")
        at_low = (door.low + door.high) / 2 < (room.x0 + room.x1) / 2
        length, width = room.size[0] - 0.9, 2.5
        x = room.x1 - length / 2 if at_low else room.x0 + length / 2
        y = room.y1 - width / 2 if door.side == "s" else room.y0 + width / 2
        piece = make("stairs", height=self.site.height, width=width, length=length)
        self.site.put(room, piece, x, y, -np.pi / 2 if at_low else np.pi / 2)


def _lecture(x: _Layout) -> None:
    """Rows of tables that face one end of the room."""
    room, site = x.room, x.site
    along_x = room.size[0] >= room.size[1]
    length, across = room.size if along_x else room.size[::-1]
    stage = ("we" if along_x else "sn")[int(x.rng.integers(2))]
    x.line(stage, "whiteboard", site.number(2), start=0.6, gap=0.1)
    middle = room.center[1] if along_x else room.center[0]
    if site.number(1):
        site.put_if_free(room, make("lectern"), *room.wall_place(stage, middle + 0.9, 1.1))
    width, rows = 1.6, 0
    columns = max(1, int((across - 0.4) / (width + 0.8)))
    for row in range(int((length - 3.4) / 1.25) + 1):
        for k in range(columns):
            along = middle + (k - (columns - 1) / 2) * (across - 0.2) / columns
            px, py, yaw = room.wall_place(stage, along, 2.2 + 1.25 * row)
            if site.number(1) and site.put_if_free(room, make("table", d=0.5, w=width), px, py, yaw):
                rows += 1
                for side in (-0.4, 0.4):
                    sx, sy = px - side * np.sin(yaw), py + side * np.cos(yaw)
                    site.seat(room, float(sx), float(sy), yaw, away=0.62)
    if not rows:  # the paths between its doors leave no room for rows
        x.arrange(_ROOMS["lecture"])
    x.line(x.front, "bin", site.number(1))


def _corridor(site: Site, room: Room, plan: FloorPlan) -> None:
    """Fittings along the walls, one side at a time, away from doors, windows and other corridors; pipes above."""
    rng, style = site.rng, plan.style
    along_x = room.size[0] >= room.size[1]
    length, width = max(room.size), min(room.size)
    avoid = [
        area(s[0], s[1], s[3], s[4]).buffer(0.15) for s in (o.span for o in plan.openings if room in (o.room, o.other))
    ]
    avoid += [c.floor.buffer(0.3) for c in plan.corridors if c is not room]
    for what, density in style.fittings.items():
        share = 1.0 if what == "lift" else site.density
        for _ in range(int(share * density * length / 10 + rng.random())):
            piece = make(what, rng)
            if what == "cabinet":
                piece = make(what, rng, style.storage[0])
            if width - piece.depth < CLEAR and piece.depth > 0.2:
                continue
            for _ in range(12):
                side = str(rng.choice(["s", "n"] if along_x else ["w", "e"]))
                low, high = room.wall(side)
                along = rng.uniform(low + piece.width / 2, high - piece.width / 2)
                # A lift's doors lie in the wall; all other pieces stand in front of it.
                off = 0.022 if what == "lift" else 0.02 + piece.depth / 2
                place = room.wall_place(side, along, off)
                spot = footprint(piece, *place)
                if any(spot.buffer(0.02).intersects(a) for a in avoid) or not room.floor.buffer(0.05).contains(spot):
                    continue
                site.put(room, piece, *place)
                # Only one side of a corridor is used.
                a, b = along - piece.width / 2 - 0.3, along + piece.width / 2 + 0.3
                avoid.append(area(a, room.y0, b, room.y1) if along_x else area(room.x0, a, room.x1, b))
                break
    for k in range(style.mains if length > 8 else 0):
        radius = (0.055, 0.04)[k % 2]
        piece = make("pipe", w=round(length - 0.1, 2), radius=radius, height=site.height - 0.2 - 0.1 * k)
        side = "n" if along_x else "e"
        middle = room.center[0] if along_x else room.center[1]
        x, y, yaw = room.wall_place(side, middle, 0.15 + 0.16 * k)
        for what, mesh in piece.parts.items():
            site.add(f"{room.name} pipe {k + 1}", shapes.placed(mesh, (x, y, 0), (0, 0, yaw)), what)
