"""What people and builders leave in rooms: kinds of things with their number, sizes and shapes.

Sizes of paper are those of ISO 216. Sockets and switches lie in the zones of DIN 18015-3: 0.3 m over the floor, and
1.05 m; a frame is 81 mm wide for each. A sprinkler guards 12 m^2 at most (EN 12845, ordinary hazard), a point-type
smoke detector some 60 m^2 (DIN VDE 0833-2). Other numbers are plain assumptions about offices: on a desk of 1.3 m^2 a
dozen things are wanted, on a wall one every 1.3 m. In furnished rooms there is room for a third to a half of them.

Every shape stands on its back: x along, y across, z off the surface, the face that touches it left out. None is of a
material that waves pass, and closed ones are of metal, so a thing is the same by itself and as part of a larger mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import trimesh
from jaxtyping import Float

from radarsim.world.shapes import box, cylinder, joined, placed

Size = Float[np.ndarray, "3"]
#: Sides of cylinders: as few as count as round (`physics.bodies`).
SIDES = 8


def block(size: Size) -> trimesh.Trimesh:
    """A box."""
    return box((0, 0, size[2] / 2), tuple(size), ("-z",))


def stick(size: Size) -> trimesh.Trimesh:
    """A cylinder that stands."""
    return cylinder((0, 0, size[2] / 2), min(size[:2]) / 2, size[2], SIDES, ("-z",))


def rod(size: Size) -> trimesh.Trimesh:
    """A cylinder that lies."""
    radius = min(size[1:]) / 2
    return placed(cylinder((0, 0, 0), radius, size[0], SIDES), (0, 0, radius), (0, np.pi / 2, 0))


def laptop(size: Size) -> trimesh.Trimesh:
    """A laptop, open by 110 deg."""
    along, across, high = size
    base = box((0, -across / 8, 0.01), (along, 0.75 * across, 0.02), ("-z",))
    lid = box((0, 0, (high - 0.025) / 2 + 0.002), (along, 0.008, high - 0.025))
    lid = placed(lid, (0, across / 4, 0.02), (-np.deg2rad(20), 0, 0))
    return joined(base, lid)


def screen(size: Size) -> trimesh.Trimesh:
    """A flat screen on a foot."""
    along, across, high = size
    foot = box((0, 0, 0.01), (0.24, across, 0.02), ("-z",))
    neck = box((0, 0, 0.06), (0.04, 0.03, 0.08), ("-z", "+z"))
    return joined(foot, neck, box((0, -0.03, 0.1 + (high - 0.1) / 2), (along, 0.03, high - 0.1)))


def lamp(size: Size) -> trimesh.Trimesh:
    """A desk lamp: foot, stem and shade."""
    high = size[2]
    foot = cylinder((0, 0, 0.01), 0.08, 0.02, SIDES, ("-z",))
    stem = cylinder((0, 0, high / 2 - 0.05), 0.01, high - 0.14, SIDES, ("-z", "+z"))
    return joined(foot, stem, cylinder((0, 0, high - 0.06), min(size[:2]) / 2, 0.12, SIDES))


@dataclass(frozen=True)
class Thing:
    """A kind of things.

    Attributes:
        on: tops, walls or ceilings.
        often: at level 1: to a square metre of tops and ceilings, to a metre of wall.
        least, most: along, across and off the surface, m; what is round is as thick as the box around it.
        shape: of such a size.
        material: of all of it.
        height: of its middle over the floor on a wall, lowest and highest, m.
        lamp: hangs only where no other lamp hangs.
    """

    on: Literal["top", "wall", "ceiling"]
    often: float
    least: tuple[float, float, float]
    most: tuple[float, float, float]
    shape: Callable[[Size], trimesh.Trimesh] = block
    material: str = "vinyl"
    height: tuple[float, float] = (0.0, 0.0)
    lamp: bool = False


@dataclass(frozen=True)
class Run:
    """What runs along a wall.

    Attributes:
        share: of walls that have it at level 1.
        across, off: of its section, m.
        height: of its middle over the floor, or, negative, below the ceiling, m.
        least: so long is the shortest, m.
        shape: of such a size.
        material: of all of it.
    """

    share: float
    across: float
    off: float
    height: float
    least: float
    shape: Callable[[Size], trimesh.Trimesh] = block
    material: str = "vinyl"


#: What is there first stays.
RUNS: dict[str, Run] = {
    "tray": Run(0.25, 0.06, 0.2, -0.2, 5.0, material="metal"),
    "pipe": Run(0.15, 0.04, 0.04, -0.1, 2.0, rod, "metal"),
    "duct": Run(0.12, 0.06, 0.04, 0.95, 1.0),
    "skirting": Run(0.8, 0.06, 0.015, 0.03, 0.3, material="wood"),
}
THINGS: dict[str, Thing] = {
    # ceilings
    "luminaire": Thing("ceiling", 0.12, (1.2, 0.15, 0.05), (1.5, 0.3, 0.08), material="metal", lamp=True),
    "sprinkler": Thing("ceiling", 1 / 12, (0.03, 0.03, 0.05), (0.03, 0.03, 0.07), stick, "metal"),
    "smoke detector": Thing("ceiling", 1 / 60, (0.1, 0.1, 0.04), (0.11, 0.11, 0.05), stick),
    "loudspeaker": Thing("ceiling", 1 / 40, (0.15, 0.15, 0.03), (0.25, 0.25, 0.05)),
    # walls
    "picture": Thing("wall", 0.22, (0.21, 0.297, 0.02), (0.594, 0.841, 0.03), block, "wood", (1.4, 1.7)),
    "socket": Thing("wall", 0.25, (0.081, 0.081, 0.01), (0.223, 0.081, 0.012), height=(0.3, 0.3)),
    "switch": Thing("wall", 0.1, (0.081, 0.081, 0.01), (0.081, 0.152, 0.012), height=(1.05, 1.05)),
    "box": Thing("wall", 0.12, (0.08, 0.1, 0.025), (0.25, 0.3, 0.05), height=(1.3, 1.9)),
    "riser duct": Thing("wall", 0.06, (0.03, 0.6, 0.02), (0.06, 1.2, 0.04), height=(1.0, 1.5)),
    # tops
    "screen": Thing("top", 0.25, (0.48, 0.2, 0.4), (0.61, 0.22, 0.5), screen, "metal"),
    "laptop": Thing("top", 0.3, (0.3, 0.28, 0.2), (0.36, 0.32, 0.24), laptop, "metal"),
    "desk lamp": Thing("top", 0.15, (0.14, 0.14, 0.35), (0.2, 0.2, 0.5), lamp, "metal"),
    "carton": Thing("top", 0.5, (0.15, 0.12, 0.08), (0.4, 0.3, 0.3), block, "wood"),
    "paper": Thing("top", 2.0, (0.21, 0.148, 0.02), (0.297, 0.21, 0.08), block, "wood"),
    "books": Thing("top", 1.5, (0.05, 0.15, 0.2), (0.3, 0.22, 0.3), block, "wood"),
    "cup": Thing("top", 1.5, (0.07, 0.07, 0.08), (0.09, 0.09, 0.12), stick, "marble"),
    "bottle": Thing("top", 0.6, (0.06, 0.06, 0.2), (0.08, 0.08, 0.3), stick),
    "tool": Thing("top", 2.0, (0.05, 0.03, 0.02), (0.2, 0.08, 0.06)),
    "cable": Thing("top", 0.8, (0.2, 0.008, 0.008), (0.6, 0.01, 0.01), rod, "metal"),
}
