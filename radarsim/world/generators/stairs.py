"""Stairs of a building, in a frame as in `furniture.yaml`."""

import numpy as np
import trimesh
from shapely.geometry import Polygon

from radarsim.world.generators.furniture import Piece
from radarsim.world.shapes import cylinder, exact, joined, placed, polygon, rectangle, span

TREAD, RISE = 0.28, 0.165  # of a stair, m


def stairs(height: float, width: float, length: float) -> Piece:
    """Two flights with a landing between, seen from the foot: up along +y on the left half, back on the right.

    Args:
        height: of the ceiling, m.
        width: of both flights together, m.
        length: of the stairwell, m.
    """
    steps = round(height / 2 / RISE)
    rise, flight = height / 2 / steps, (steps - 1) * TREAD
    foot = length / 2 - 1.25 - flight  # the landing is 1.25 m deep
    treads, half = [], width / 2 - 0.05
    for k in range(steps - 1):
        z, y = (k + 1) * rise, foot + k * TREAD
        treads.append(rectangle((-half / 2 - 0.05, y, z - rise / 2), (half, rise), (0, -1, 0)))
        treads.append(rectangle((-half / 2 - 0.05, y + TREAD / 2, z), (half, TREAD), (0, 0, 1)))
        if k < steps - 2:  # the upper flight ends below the ceiling
            z, y = height / 2 + (k + 1) * rise, length / 2 - 1.25 - k * TREAD
            treads.append(rectangle((half / 2 + 0.05, y, z - rise / 2), (half, rise), (0, 1, 0)))
            treads.append(rectangle((half / 2 + 0.05, y - TREAD / 2, z), (half, TREAD), (0, 0, 1)))
    landing = span((-width / 2, length / 2 - 1.25, height / 2 - 0.2), (width / 2, length / 2, height / 2), ("+y",))
    riser = rectangle((-half / 2 - 0.05, length / 2 - 1.2505, height / 2 - rise / 2), (half, rise), (0, -1, 0))
    # The string between the flights hides what is under them, down to the floor on the lower side.
    edge = [[foot, 0.0], [length / 2 - 1.25, height / 2 - rise], [length / 2 - 1.25, 0.0]]
    side = [_upright(edge, x) for x in (-0.05, -half - 0.05)]
    slope = length / 2 - 1.25, height / 2 - 0.02, length / 2 - 1.25 - flight, height - rise - 0.02
    under = _sloped((0.05, half + 0.05), slope)
    rails = [
        placed(
            cylinder((0, 0, 0), 0.025, np.hypot(flight, height / 2), 8),
            (x, foot + flight / 2, up + height / 4),
            (-np.arctan2(flight, height / 2), 0, 0),
        )
        for x, up in ((-0.04, 0.9),)
    ]
    return Piece("stairs", width, length, {"concrete": joined(*treads, landing, riser, *side, under),
                                           "metal": joined(*rails)})  # fmt: skip


def _upright(corners: list[list[float]], x: float) -> trimesh.Trimesh:
    """An upright polygon in the plane of constant x, given as (y, z)."""
    return polygon(Polygon(corners), (x, 0, 0), (0, 1, 0), (0, 0, 1))


def _sloped(across: tuple[float, float], line: tuple[float, float, float, float]) -> trimesh.Trimesh:
    """The underside of a flight: between two x, from (y, z) to (y, z)."""
    (x0, x1), (y0, z0, y1, z1) = across, line
    z0, z1 = z0 - 0.15, z1 - 0.15
    return exact(np.array([[x0, y0, z0], [x1, y0, z0], [x1, y1, z1], [x0, y1, z1]]), [[0, 1, 2], [0, 2, 3]])
