"""Skeleton shared by the floors of a building: outline, corridors, stairs, and the ground for rows of rooms.

Two long corridors run along x and are joined by two or three cross corridors, so that there are rings to walk. Rows of
rooms lie along the two facades, at the ends, and in the core between the corridors:

      +-----------------------------------+        ==  corridors; a long one may run on through an end row
      |  row   :   row  :  row  :   row   |            to the facade and end there at a window
      |     =======================       |
      | end ||  core : stairs ||  ====== |        One of the outer rows may be shorter than the building: then the
      |     ||  core : core   ||  end    |            outline has a step, and the corridor windows there.
      |     =======================       |
      |  row   :   row  :  row  :   row   |        Stubs: dead ends that reach from a corridor into the core.
      +-----------------------------------+
"""

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry import Polygon

from radarsim.world.generators.styles import Style

Box = tuple[float, float, float, float]  # x0 y0 x1 y1, m

#: Smallest and largest length of the long corridors between the far sides of the cross corridors, m.
LONG = 21.0, 36.0
#: Length of a ring above which it gets a cross corridor in its middle, m.
LONGEST_RING = 78.0
#: Smallest depth of rows of rooms in the core, m.
CORE_ROW = 3.9
STAIRS, TOILET, STUB = (5.6, 3.0, 1.9)  # sizes along the core, m


@dataclass(frozen=True)
class Block:
    """Ground between corridors or facades.

    Attributes:
        box: between the walls' faces, m.
        axis: along which its rooms stand side by side, 0 or 1.
        use: ``rooms``, ``core``, ``stairs`` or ``toilet``.
        pitch: distance of the axes on which its walls and windows stand, m.
        room: usual width of its rooms, m.
    """

    box: Box
    axis: int
    use: str
    pitch: float
    room: float = 4.3


@dataclass
class Skeleton:
    """Outline, corridors and blocks; see the sketch at the top of this file.

    Attributes:
        corridors: by name, m; they touch where they meet.
        blocks: ground for rooms, in reading order.
        solid: remaining ground: shafts at the ends of stubs.
        rings: lengths of the rings of corridors, along their middles, m.
        outline: of the building, outer faces.
    """

    corridors: dict[str, Box] = field(default_factory=dict)
    blocks: list[Block] = field(default_factory=list)
    solid: list[Box] = field(default_factory=list)
    rings: list[float] = field(default_factory=list)
    outline: Polygon = field(default_factory=Polygon)

    def ground(self, wall: float) -> list[Box]:
        """Boxes whose union is the whole floor including outer walls of a thickness (m)."""
        boxes = [*self.corridors.values(), *(b.box for b in self.blocks), *self.solid]
        return [(x0 - wall, y0 - wall, x1 + wall, y1 + wall) for x0, y0, x1, y1 in boxes]


def skeleton(style: Style, rng: np.random.Generator) -> Skeleton:
    """Draw the skeleton of a building of a style."""
    thick, wall = style.outer, style.inner
    width = round(rng.uniform(*style.corridor), 2)
    pitch = rng.uniform(*style.module)
    south, north = rng.uniform(*style.row, 2).round(2)
    rows = 1 if rng.random() < 0.45 else 2
    core = rng.uniform(CORE_ROW, 6.0, rows).round(2)
    depth_of_core = float(core.sum() + (rows - 1) * wall)

    # Across: faces of the row, the corridor, the core, the corridor and the row.
    y0 = thick
    south_0, south_1 = y0 + south + wall, y0 + south + wall + width
    north_0 = south_1 + depth_of_core + 2 * wall
    north_1 = north_0 + width
    y1 = north_1 + wall + north
    # Along: at either end a row of rooms, or the cross corridor lies at the facade.
    ends = [round(rng.uniform(*style.row), 2) if rng.random() < 0.65 else 0.0 for _ in range(2)]
    x0 = thick
    west = x0 + (ends[0] + wall if ends[0] else 0.0)
    east = west + round(rng.uniform(*LONG), 2)
    x1 = east + (ends[1] + wall if ends[1] else 0.0)
    runs_on = {(side, end): bool(ends[end]) and rng.random() < 0.55 for side in "sn" for end in (0, 1)}

    plan = Skeleton()
    for side, low, high in (("s", south_0, south_1), ("n", north_0, north_1)):
        a, b = (x0 if runs_on[side, 0] else west), (x1 if runs_on[side, 1] else east)
        plan.corridors[f"{'south' if side == 's' else 'north'} corridor"] = _cm(a, low, b, high)
    crossings = [west, east - width]
    if 2 * (east - west - width + north_0 - south_0) > LONGEST_RING or (east - west > 28 and rng.random() < 0.5):
        middle = west + (east - west) * rng.uniform(0.42, 0.58)
        crossings.insert(1, round(middle - width / 2, 2))
    for a, b in zip(crossings[:-1], crossings[1:], strict=True):
        plan.rings.append(2 * (b - a + north_0 - south_0))
    for name, a in zip(("west", "middle", "east") if len(crossings) == 3 else ("west", "east"), crossings, strict=True):
        plan.corridors[f"{name} corridor"] = _cm(a, south_1, a + width, north_0)

    # An outer row may end early, at the last room of the end row or further in.
    short = rng.choice(["", "s", "n"], p=[0.4, 0.3, 0.3])
    end = int(rng.integers(2))
    step = [x0, x1]
    if short:
        inner = rng.uniform(0.25, 0.45) * (east - west) if rng.random() < 0.6 or not ends[end] else 0.0
        step[end] = west + inner if end == 0 else east - inner
    for side, (low, high) in (("s", (y0, y0 + south)), ("n", (north_1 + wall, y1))):
        a, b = step if side == short else (x0, x1)
        plan.blocks.append(Block(_cm(a, low, b, high), 0, "rooms", pitch))
    for k, (a, b) in enumerate(((x0, west - wall), (east + wall, x1))):
        if ends[k]:
            low = south_1 + wall if runs_on["s", k] else south_0
            high = north_0 - wall if runs_on["n", k] else north_1
            plan.blocks.append(Block(_cm(a, low, b, high), 1, "rooms", pitch))

    # The core, in sections between cross corridors and rows.
    stretches = [(a + width + wall, b - wall) for a, b in zip(crossings[:-1], crossings[1:], strict=True)]
    levels = south_1 + wall + np.concatenate([[0], np.cumsum(core + wall)])
    stairs_left, toilets_left, stubs_left = (2 if east - west > 27 else 1), 2, 1 + (rng.random() < 0.5)
    for k, (a, b) in enumerate(stretches):
        for row in range(rows):
            low, high = levels[row], levels[row + 1] - wall
            if stairs_left and (k, row) in ((0, 0), (len(stretches) - 1, rows - 1)) and b - a > STAIRS + 4:
                stairs_left -= 1
                at_west = k == 0 and row == 0
                edge = (a, a + STAIRS) if at_west else (b - STAIRS, b)
                plan.blocks.append(Block(_cm(edge[0], low, edge[1], high), 0, "stairs", pitch))
                a_row, b_row = (a + STAIRS + wall, b) if at_west else (a, b - STAIRS - wall)
            else:
                a_row, b_row = a, b
            while toilets_left and b_row - a_row > TOILET + 4.5:
                plan.blocks.append(Block(_cm(a_row, low, a_row + TOILET, high), 0, "toilet", pitch))
                a_row, toilets_left = a_row + TOILET + wall, toilets_left - 1
            if stubs_left and b_row - a_row > 9:
                stubs_left -= 1
                at = rng.uniform(a_row + 3.3, b_row - STUB - 3.3)
                _stub(plan, at, low, high, southward=row == 0 and (rows == 2 or rng.random() < 0.5), wall=wall)
                plan.blocks.append(Block(_cm(a_row, low, at - wall, high), 0, "core", pitch))
                a_row = at + STUB + wall
            plan.blocks.append(Block(_cm(a_row, low, b_row, high), 0, "core", pitch))
    plan.outline = shapely.union_all([shapely.box(*box) for box in plan.ground(thick)], grid_size=1e-4)
    return plan


def _stub(plan: Skeleton, at: float, low: float, high: float, southward: bool, wall: float) -> None:
    """Add a dead end from a corridor into the core; a shaft behind it extends to the next wall."""
    shaft = 0.9
    if southward:
        plan.corridors[f"stub {at:.0f}"] = _cm(at, low - wall, at + STUB, high - shaft)
        plan.solid.append(_cm(at, high - shaft, at + STUB, high))
    else:
        plan.corridors[f"stub {at:.0f}"] = _cm(at, low + shaft, at + STUB, high + wall)
        plan.solid.append(_cm(at, low, at + STUB, low + shaft))


def _cm(*box: float) -> Box:
    """Rounded to centimetres, as plans are."""
    x0, y0, x1, y1 = (round(float(v), 2) for v in box)
    return x0, y0, x1, y1
