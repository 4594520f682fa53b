"""Furniture and fittings, each as meshes by material in its own frame.

Frame: origin on the floor in the middle of the footprint, back towards -x (the wall), front +x, z up. Faces that would
touch the floor or another part are left out.
"""

from dataclasses import dataclass

import numpy as np
import trimesh

from radarsim.world.shapes import box, cylinder, joined, placed, span

_GAP = 0.002  # between parts that would otherwise share a plane


@dataclass(frozen=True)
class Piece:
    """One piece of furniture.

    Attributes:
        kind: e.g. ``desk``.
        depth, width: footprint along x and y, m.
        parts: meshes by material name.
    """

    kind: str
    depth: float
    width: float
    parts: dict[str, trimesh.Trimesh]


def desk(rng: np.random.Generator) -> Piece:
    """Chipboard top on metal legs, with monitor, computer and drawers."""
    width, depth, height = rng.choice([1.4, 1.6, 1.8]), 0.8, 0.74
    top = box((0, 0, height - 0.0125), (depth, width, 0.025))
    corners = [(sx * (depth / 2 - 0.06), sy * (width / 2 - 0.06)) for sx in (-1, 1) for sy in (-1, 1)]
    legs = [span((x - 0.025, y - 0.025, 0), (x + 0.025, y + 0.025, height - 0.025), ("-z", "+z")) for x, y in corners]
    side = rng.choice([-1, 1])
    drawers = box((-0.05, side * (width / 2 - 0.34), 0.30), (0.55, 0.42, 0.56))
    tower = box((-0.1, -side * (width / 2 - 0.26), 0.22), (0.42, 0.18, 0.40))
    screen_y = rng.uniform(-0.15, 0.15)
    stand = span((-0.22, screen_y - 0.03, height), (-0.18, screen_y + 0.03, height + 0.12), ("-z",))
    screen = box((-0.16, screen_y, height + 0.28), (0.03, 0.56, 0.34))
    return Piece(
        "desk", depth, width, {"chipboard": top, "metal": joined(*legs, drawers, tower, stand), "acrylic": screen}
    )


def chair(rng: np.random.Generator) -> Piece:
    """Office chair: cloth seat and back on a metal column and foot."""
    back = placed(box((0, 0, 0.27), (0.06, 0.42, 0.50)), (-0.20, 0, 0.50), (0, np.deg2rad(-8), 0))
    seat = box((0, 0, 0.46), (0.46, 0.46, 0.07))
    column = cylinder((0, 0, 0.245), 0.03, 0.36, 8, without=("-z", "+z"))
    foot = cylinder((0, 0, 0.045), 0.28, 0.04, 10)
    return Piece("chair", 0.56, 0.56, {"fabric": joined(seat, back), "metal": joined(column, foot)})


def cabinet(rng: np.random.Generator, material: str = "metal") -> Piece:
    """Closed cupboard or filing cabinet with two steel handles."""
    width, depth, height = rng.choice([0.8, 1.0, 1.2]), rng.choice([0.42, 0.5]), rng.choice([1.1, 1.6, 1.95])
    body = span((-depth / 2, -width / 2, 0), (depth / 2, width / 2, height), ("-z",))
    handles = [box((depth / 2 + 0.012, y, 0.6 * height), (0.02, 0.015, 0.16)) for y in (-0.05, 0.05)]
    parts = {"metal": joined(body, *handles)} if material == "metal" else {material: body, "metal": joined(*handles)}
    return Piece("cabinet", depth, width, parts)


def shelf(rng: np.random.Generator, material: str = "wood") -> Piece:
    """Open bookcase, partly filled."""
    width, depth, board = rng.choice([0.8, 1.0]), 0.34, 0.02
    levels = np.linspace(0.06, 1.78, 6)
    x0, x1, inner = -depth / 2, depth / 2, width / 2 - board
    sides = [span((x0, y, 0), (x1, y + board, 1.8), ("-z",)) for y in (-width / 2, inner)]
    back = span((x0 + 0.004, -inner, 0), (x0 + 0.012, inner, 1.8), ("-z", "-y", "+y"))
    boards = [span((x0 + 0.012, -inner, z), (x1 - _GAP, inner, z + board), ("-x", "-y", "+y")) for z in levels]
    books = []
    for z in levels[:-1]:
        fill = rng.uniform(0.2, 0.95) * 2 * inner
        books.append(
            span(
                (x0 + 0.03, -inner + _GAP, z + board),
                (x0 + rng.uniform(0.20, 0.28), -inner + fill, z + board + rng.uniform(0.20, 0.28)),
                ("-z",),
            )
        )
    return Piece("shelf", depth, width, {material: joined(*sides, back, *boards), "chipboard": joined(*books)})


def table(rng: np.random.Generator, depth: float = 0.9, width: float | None = None) -> Piece:
    """Table with metal legs."""
    width, height = width or rng.choice([1.6, 2.0]), 0.74
    top = box((0, 0, height - 0.015), (depth, width, 0.03))
    corners = [(sx * (depth / 2 - 0.1), sy * (width / 2 - 0.1)) for sx in (-1, 1) for sy in (-1, 1)]
    legs = [cylinder((x, y, height / 2 - 0.015), 0.025, height - 0.03, 8, ("-z", "+z")) for x, y in corners]
    return Piece("table", depth, width, {"wood": top, "metal": joined(*legs)})


def sofa(rng: np.random.Generator) -> Piece:
    """Upholstered bench with back and arms."""
    width, depth = rng.choice([1.5, 1.9]), 0.85
    base = span((-depth / 2 + 0.2, -width / 2 + 0.15, 0.05), (depth / 2, width / 2 - 0.15, 0.42), ("-x", "-y", "+y"))
    back = span((-depth / 2, -width / 2 + 0.15, 0.05), (-depth / 2 + 0.2, width / 2 - 0.15, 0.82), ("-y", "+y"))
    arms = [span((-depth / 2, s, 0.05), (depth / 2 - 0.02, s + 0.15, 0.6)) for s in (-width / 2, width / 2 - 0.15)]
    return Piece("sofa", depth, width, {"fabric": joined(base, back, *arms)})


def radiator(rng: np.random.Generator, width: float = 1.2) -> Piece:
    """Sheet-steel radiator with upright ribs on its front."""
    body = span((-0.05, -width / 2, 0.12), (0.03, width / 2, 0.72))
    ribs = [
        box((0.04, y, 0.42), (0.02, 0.03, 0.54), ("-x",)) for y in np.arange(-width / 2 + 0.05, width / 2 - 0.04, 0.1)
    ]
    return Piece("radiator", 0.12, width, {"metal": joined(body, *ribs)})


def whiteboard(rng: np.random.Generator) -> Piece:
    """Enamelled steel sheet on the wall with a pen tray."""
    width = rng.choice([1.2, 1.8])
    sheet = box((0, 0, 1.45), (0.02, width, 1.0))
    tray = box((0.05, 0, 0.96), (0.08, width * 0.6, 0.015), ("-x",))
    return Piece("whiteboard", 0.05, width, {"metal": joined(sheet, tray)})


def bin(rng: np.random.Generator) -> Piece:
    """Steel waste-paper bin."""
    return Piece("bin", 0.3, 0.3, {"metal": cylinder((0, 0, 0.18), 0.13, 0.36, 12, ("-z",))})


def extinguisher(rng: np.random.Generator) -> Piece:
    """Fire extinguisher hung on the wall."""
    return Piece("extinguisher", 0.18, 0.18, {"metal": cylinder((0, 0, 0.95), 0.075, 0.5, 12)})


def printer(rng: np.random.Generator) -> Piece:
    """Office printer on a wooden stand."""
    stand = span((-0.3, -0.3, 0), (0.3, 0.3, 0.5), ("-z",))
    body = span((-0.26, -0.26, 0.5), (0.26, 0.26, 1.0), ("-z",))
    return Piece("printer", 0.62, 0.62, {"wood": stand, "acrylic": body})


def lamp(height: float, depth: float = 0.3, width: float = 1.2) -> Piece:
    """Surface-mounted metal ceiling lamp below a ceiling at `height`."""
    housing = span((-depth / 2, -width / 2, height - 0.07), (depth / 2, width / 2, height), ("+z",))
    return Piece("lamp", depth, width, {"metal": housing})
