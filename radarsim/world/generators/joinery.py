"""Fillings of wall openings: door leaves and their frames, windows, glass walls.

Its pieces (`furniture.yaml`) are in the opening's own frame: x along the wall from the opening's low end, y across, 0
in the middle of the wall and `inward` (+1 or -1) into the room, z up.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import trimesh

from radarsim.world.generators.furniture import make
from radarsim.world.generators.openings import DOOR_HEIGHT, Opening
from radarsim.world.generators.styles import Style
from radarsim.world.shapes import placed

BAR = 0.06  # width and half the depth of bars and frames, m
_GAP = 0.01

Part = tuple[str, trimesh.Trimesh, str]  # name, mesh, material


def fill(opening: Opening, style: Style) -> Iterator[Part]:
    """Yield the parts that fill an opening, in world coordinates."""
    x0, y0, _, x1, y1, _ = opening.span
    along_x = opening.side in "ns"
    origin = (x0, (y0 + y1) / 2, 0.0) if along_x else ((x0 + x1) / 2, y0, 0.0)
    # After a quarter turn, y points to -x.
    inward = {"n": -1, "s": 1, "e": 1, "w": -1}[opening.side]
    width, top = opening.high - opening.low, opening.top
    parts: list[Part] = []
    if opening.kind in ("door", "way") and width < 1.5:
        parts += _made(style.doors.frame, "frame", width=width, top=top, thickness=opening.thickness)
    if opening.kind == "door":
        parts += _leaf(opening, 0.0, width, inward, opening.thickness / 2)
    elif opening.kind == "window":
        w = style.windows
        bays = w.bays if w.width < 1 else max(1, round(width / 1.4))
        posts = np.linspace(BAR / 2, width - BAR / 2, bays + 1)
        rails = np.linspace(opening.bottom + BAR / 2, top - BAR / 2, w.transoms + 2)[1:-1]
        panes = [(posts[0], opening.bottom + BAR / 2, posts[-1], top - BAR / 2)]
        about = {"bottom": opening.bottom, "top": top, "posts": posts, "rails": rails, "panes": panes}
        parts += _made(w.frame, "window", **about, lower=range(bays), middle=range(bays))
    elif opening.kind == "glass wall":
        bay = opening.bay[0] - opening.low, opening.bay[1] - opening.low
        parts += _glass_wall(width, top, bay)
        parts += _leaf(opening, *bay, inward, BAR / 2)
    for name, mesh, what in parts:
        yield name, placed(mesh, origin, (0, 0, 0 if along_x else np.pi / 2)), what


def _made(material: str, kind: str, **given: Any) -> list[Part]:
    """Make a piece, with its parts renamed by their material in an opening."""
    parts = make(kind, None, material, **given).parts
    named = {"window": "frame"}.get(kind, kind)
    return [("pane" if what != material else named, mesh, what) for what, mesh in parts.items()]


def _leaf(opening: Opening, low: float, high: float, inward: int, face: float) -> list[Part]:
    """Door leaf on its hinge, `face` (m) from the middle of the wall, with a handle on either side."""
    about = {"width": high - low - 2 * _GAP, "thickness": 0.012 if opening.leaf == "glass" else 0.04}
    turn = -opening.hinge * inward * opening.angle
    x, yaw = (low + _GAP, turn) if opening.hinge < 0 else (high - _GAP, np.pi + turn)
    # A closed leaf lies within the opening; an open one clears the frame.
    out = 1 if opening.angle else -1
    place = (x, inward * (face + out * about["thickness"] / 2 + out * _GAP), 0), (0, 0, yaw)
    parts = _made(opening.leaf, "leaf", **about) + _made("metal", "handles", **about)
    return [(name, placed(mesh, *place), what) for name, mesh, what in parts]


def _glass_wall(width: float, top: float, door: tuple[float, float]) -> list[Part]:
    """Metal frame with a bay for a door, and panes beside and above it."""
    half = BAR / 2
    low, high = door[0] - half, door[1] + half
    even = np.linspace(half, width - half, max(2, round(width / 1.3)) + 1)
    posts = np.array(sorted([half, *even[(even <= low - 0.3) | (even >= high + 0.3)], low, high, width - half]))
    posts = np.clip(posts, half, width - half)
    posts = posts[np.diff(posts, prepend=-1.0) > BAR]
    in_door = (posts[:-1] >= low - 1e-6) & (posts[1:] <= high + 1e-6)
    panes = [(a, half, b, top - half) for a, b in ((half, low), (high, width - half)) if b - a > 0.1]
    panes.append((low, DOOR_HEIGHT + half, high, top - half))
    about = {"bottom": 0.0, "top": top, "posts": posts, "rails": [DOOR_HEIGHT + half], "panes": panes}
    return _made("metal", "window", **about, lower=np.flatnonzero(~in_door), middle=np.flatnonzero(in_door))
