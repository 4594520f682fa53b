"""What is put into openings of walls: door leaves and their frames, windows, glass walls.

What is not plain is made in the opening's own frame: x along the wall from the opening's low end, y across, 0 in the
middle of the wall and `inward` (+1 or -1) into the room, z up; `placed` puts it into the world.
"""

from collections.abc import Iterator

import numpy as np
import trimesh

from radarsim.world import shapes
from radarsim.world.generators.openings import DOOR, DOOR_HEIGHT, Opening
from radarsim.world.generators.styles import Style

LEAF = 0.04  # thickness of a door leaf, m
BAR = 0.06  # width and half the depth of bars and frames, m
_GAP = 0.01

Part = tuple[str, trimesh.Trimesh, str]  # name, mesh, material


def fill(opening: Opening, style: Style) -> Iterator[Part]:
    """What an opening is filled with, in the world."""
    if style.plain:
        if opening.kind != "way":
            yield from _plain_leaf(opening) if opening.leaf else _casement(opening, style.windows.frame)
        return
    x0, y0, _, x1, y1, _ = opening.span
    along_x = opening.side in "ns"
    origin = (x0, (y0 + y1) / 2, 0.0) if along_x else ((x0 + x1) / 2, y0, 0.0)
    # Turned by a quarter, y points to -x.
    inward = {"n": -1, "s": 1, "e": 1, "w": -1}[opening.side]
    width = opening.high - opening.low
    parts: list[Part] = []
    if opening.kind in ("door", "way") and width < 1.5:
        parts.append(("frame", _casing(width, opening.top, opening.thickness), style.doors.frame))
    if opening.kind == "door":
        parts += _leaf(opening, 0.0, width, inward, opening.thickness / 2)
    elif opening.kind == "window":
        w = style.windows
        bays = w.bays if w.width < 1 else max(1, round(width / 1.4))
        parts += _glazing(width, opening.bottom, opening.top, bays, w.transoms, w.frame)
    elif opening.kind == "glass wall":
        bay = opening.bay[0] - opening.low, opening.bay[1] - opening.low
        parts += _glazing(width, 0.0, opening.top, max(2, round(width / 1.3)), 0, "metal", bay)
        parts += _leaf(opening, *bay, inward, BAR / 2)
    for name, mesh, what in parts:
        yield name, shapes.placed(mesh, origin, (0, 0, 0 if along_x else np.pi / 2)), what


def _casing(width: float, top: float, thickness: float) -> trimesh.Trimesh:
    """Boards around an opening, flat on both faces of the wall: only their fronts are seen."""
    board, parts = 0.07, []
    for side in (-1, 1):
        y, facing = side * (thickness / 2 + 0.008), (0, side, 0)
        for x in (-board / 2, width + board / 2):
            parts.append(shapes.rectangle((x, y, (top + board) / 2), (board, top + board), facing))
        parts.append(shapes.rectangle((width / 2, y, top + board / 2), (width, board), facing))
    return shapes.joined(*parts)


def _leaf(opening: Opening, low: float, high: float, inward: int, face: float) -> list[Part]:
    """A door leaf on its hinge, `face` (m) from the middle of the wall, with a handle on either side."""
    width, thickness = high - low - 2 * _GAP, 0.012 if opening.leaf == "glass" else LEAF
    height = DOOR_HEIGHT - 0.02
    leaf = shapes.box((width / 2, 0, height / 2 + _GAP), (width, thickness, height - 2 * _GAP))
    handles = [shapes.box((width - 0.09, side * (thickness / 2 + 0.035), 1.05), (0.12, 0.02, 0.02)) for side in (-1, 1)]
    turn = -opening.hinge * inward * opening.angle
    if opening.hinge < 0:
        x, yaw = low + _GAP, turn
    else:
        x, yaw = high - _GAP, np.pi + turn
    # Shut, it lies within the opening; open, it clears the frame.
    y = inward * (face - thickness / 2 - _GAP if opening.angle == 0 else face + thickness / 2 + _GAP)
    place = ((x, y, 0), (0, 0, yaw))
    return [
        ("leaf", shapes.placed(leaf, *place), opening.leaf),
        ("handles", shapes.placed(shapes.joined(*handles), *place), "metal"),
    ]


def _glazing(
    width: float,
    bottom: float,
    top: float,
    bays: int,
    transoms: int,
    frame: str,
    door: tuple[float, float] | None = None,
) -> list[Part]:
    """A frame of bars with one pane that runs on behind them, which is one mirror; a bay may be left for a door."""
    half = BAR / 2
    mullions = np.linspace(half, width - half, bays + 1)
    levels = np.linspace(bottom + half, top - half, transoms + 2)
    holes = []
    if door:
        clear = (door[0] - half, door[1] + half)
        kept = [*(m for m in mullions if not clear[0] - 0.3 < m < clear[1] + 0.3), *clear]
        mullions = np.clip(sorted([half, *kept, width - half]), half, width - half)
        mullions = mullions[np.diff(mullions, prepend=-1.0) > BAR]
        holes = [clear]
        levels = np.array([bottom + half, DOOR_HEIGHT + half, top - half])
    # Faces that touch the wall are left out.
    bars = []
    for k, m in enumerate(mullions):
        hidden = ("-z", "+z") + ("-x",) * (k == 0) + ("+x",) * (k == len(mullions) - 1)
        bars.append(shapes.box((m, 0, (bottom + top) / 2), (BAR, BAR, top - bottom), hidden))
    for k, level in enumerate(levels):
        for a, b in zip(mullions[:-1], mullions[1:], strict=True):
            in_door = any(a >= h[0] - 1e-6 and b <= h[1] + 1e-6 for h in holes)
            if holes and (k == 0 and in_door or k == 1 and not in_door):
                continue
            hidden = ("-x", "+x") + ("-z",) * (k == 0) + ("+z",) * (k == len(levels) - 1)
            bars.append(shapes.box(((a + b) / 2, 0, level), (b - a - BAR, BAR, BAR), hidden))
    pieces = [(half, bottom + half, width - half, top - half)]
    if door:
        low, high = holes[0]
        pieces = [(a, bottom + half, b, top - half) for a, b in ((half, low), (high, width - half)) if b - a > 0.1]
        pieces.append((low, DOOR_HEIGHT + half, high, top - half))
    panes = [
        shapes.rectangle(((a + b) / 2, 0, (c + d) / 2), (b - a, d - c), (0, 1, 0)) for a, c, b, d in pieces
    ]  # fmt: skip
    return [("frame", shapes.joined(*bars), frame), ("pane", shapes.joined(*panes), "glass")]


def _plain_leaf(o: Opening) -> list[Part]:
    """In the world: a leaf that fills the wall's opening, or stands open with a handle right through it."""
    width, height, (x0, y0, *_) = DOOR, DOOR_HEIGHT, o.span
    if not o.angle:
        middle = (x0 + width / 2, y0 + o.thickness / 2, height / 2)
        return [("", shapes.box(middle, (width, LEAF, height), ("-x", "+x", "-z", "+z")), o.leaf)]
    leaf = shapes.box((width / 2 - 0.02, 0, height / 2), (width - 0.06, LEAF, height - 0.03))
    handle = shapes.box((width - 0.12, 0, 1.05), (0.12, LEAF + 0.10, 0.02))
    turn = o.angle if o.side == "s" else -o.angle
    hinge, yaw = (o.low + 0.03, turn) if o.hinge < 0 else (o.high - 0.03, np.pi - turn)
    place = (*o.room.wall_place(o.side, hinge, 0.03)[:2], 0), (0, 0, yaw)
    return [("leaf", shapes.placed(leaf, *place), o.leaf), ("handle", shapes.placed(handle, *place), "metal")]


def _casement(o: Opening, frame: str) -> list[Part]:
    """In the world: a frame of flat bars with a mullion, one pane on each side of it."""
    (x0, y0, *_), low, high = o.span, o.bottom + BAR, o.top - BAR
    axes, level = ([0, 1, 2], y0) if o.side in "ns" else ([1, 0, 2], x0)
    level += o.thickness / 2

    def bar(a: float, b: float, bottom: float, top: float, without: str) -> trimesh.Trimesh:
        begin, end = np.array([(a, level - 0.035, bottom), (b, level + 0.035, top)])[:, axes]
        return shapes.span(begin, end, tuple(without.replace("x", "xy"[axes[0]]).split()))

    left, right, middle = o.low + BAR, o.high - BAR, (o.low + o.high) / 2
    bars = [
        bar(o.low, o.high, o.bottom, low, "-x +x -z"),
        bar(o.low, o.high, high, o.top, "-x +x +z"),
        bar(o.low, left, low, high, "-x -z +z"),
        bar(right, o.high, low, high, "+x -z +z"),
        bar(middle - BAR / 2, middle + BAR / 2, low, high, "-z +z"),
    ]
    panes = []
    for a, b in ((left, middle - BAR / 2), (middle + BAR / 2, right)):
        center = np.array([(a + b) / 2, level, (low + high) / 2])[axes]
        panes.append(shapes.rectangle(center, (b - a, high - low), np.eye(3)[axes[1]]))
    return [("frame", shapes.joined(*bars), frame), ("panes", shapes.joined(*panes), "glass")]
