"""What stands in the rooms of the plain office: pieces here and there along the walls, as they find room."""

import numpy as np
from shapely.geometry import box as area

from radarsim.world.generators.furniture import Piece, make
from radarsim.world.generators.layout import FloorPlan
from radarsim.world.generators.rooms import Room, Site, footprint

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
                site.seat(room, *room.taken[-1].centroid.coords[0], yaw, ignore_kept=True)
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
