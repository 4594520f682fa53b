"""What is built into a building: stairs, pipes, lifts, sanitary ware, kitchens, lockers. Frames as in `furniture`."""

import numpy as np
from shapely.geometry import Polygon

from radarsim.world.generators.furniture import Piece
from radarsim.world.shapes import box, cylinder, exact, joined, placed, polygon, rectangle, span

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


def _upright(corners: list[list[float]], x: float):
    """An upright polygon in the plane of constant x, given as (y, z)."""
    return polygon(Polygon(corners), (x, 0, 0), (0, 1, 0), (0, 0, 1))


def _sloped(across: tuple[float, float], line: tuple[float, float, float, float]):
    """The underside of a flight: between two x, from (y, z) to (y, z)."""
    (x0, x1), (y0, z0, y1, z1) = across, line
    z0, z1 = z0 - 0.15, z1 - 0.15
    return exact(np.array([[x0, y0, z0], [x1, y0, z0], [x1, y1, z1], [x0, y1, z1]]), [[0, 1, 2], [0, 2, 3]])


def main_pipe(length: float, radius: float, height: float) -> Piece:
    """A pipe along y under the ceiling, on two hangers."""
    pipe = placed(cylinder((0, 0, 0), radius, length, 10), (0, 0, height), (np.pi / 2, 0, 0))
    return Piece("pipe", 2 * radius, length, {"metal": pipe})


def riser(height: float, radius: float = 0.05) -> Piece:
    """An upright pipe from floor to ceiling."""
    return Piece("riser", 0.14, 0.14, {"metal": cylinder((0, 0, height / 2), radius, height, 10, ("-z", "+z"))})


def lift(rng: np.random.Generator) -> Piece:
    """Steel doors of a lift, flush with the wall but for their frame."""
    doors = [rectangle((0.0, s * 0.275, 1.05), (0.54, 2.1), (1, 0, 0)) for s in (-1, 1)]
    frame = [span((-0.02, y - 0.05, 0), (0.03, y + 0.05, 2.2), ("-z", "-x")) for y in (-0.61, 0.61)]
    head = span((-0.02, -0.56, 2.12), (0.03, 0.56, 2.2), ("-x", "-y", "+y"))
    return Piece("lift", 0.06, 1.34, {"metal": joined(*doors, *frame, head)})


def cubicle(rng: np.random.Generator) -> Piece:
    """Toilet cubicle: bowl and cistern, a partition on one side, a front with its door ajar."""
    bowl = cylinder((-0.25, 0, 0.2), 0.19, 0.4, 12, ("-z",))
    cistern = span((-0.7, -0.2, 0.4), (-0.55, 0.2, 0.85))
    panel = span((-0.7, 0.456, 0.15), (0.675, 0.474, 2.0))
    front = [span((0.68, a, 0.15), (0.70, b, 2.0)) for a, b in ((-0.475, -0.32), (0.32, 0.455))]
    door = placed(box((0, 0.3, 1.08), (0.02, 0.6, 1.85)), (0.67, -0.32, 0), (0, 0, rng.uniform(0.1, 1.0)))
    return Piece("cubicle", 1.4, 0.95, {"marble": joined(bowl, cistern), "chipboard": joined(panel, *front, door)})


def basin(rng: np.random.Generator) -> Piece:
    """Wash basin with a mirror above and a pipe below."""
    bowl = span((-0.24, -0.3, 0.68), (0.24, 0.3, 0.86), ("-x",))
    mirror = rectangle((-0.22, 0, 1.5), (0.5, 0.8), (1, 0, 0))
    pipe = cylinder((-0.12, 0, 0.34), 0.03, 0.68, 8, ("-z", "+z"))
    return Piece("basin", 0.48, 0.65, {"marble": bowl, "metal": joined(mirror, pipe)})


def counter(rng: np.random.Generator) -> Piece:
    """Kitchen unit with wall cupboard."""
    body = span((-0.3, -0.3, 0.08), (0.28, 0.3, 0.86), ("+z",))
    upper = span((-0.3, -0.3, 1.4), (0.05, 0.3, 2.0), ("-x",))
    top = span((-0.3, -0.3, 0.86), (0.3, 0.3, 0.9))
    return Piece("counter", 0.6, 0.6, {"chipboard": joined(body, upper), "marble": top})


def fridge(rng: np.random.Generator) -> Piece:
    """Refrigerator."""
    body = span((-0.3, -0.3, 0.03), (0.28, 0.3, 1.8))
    return Piece("fridge", 0.6, 0.62, {"metal": joined(body, box((0.3, -0.22, 1.0), (0.03, 0.03, 0.4)))})


def vending(rng: np.random.Generator) -> Piece:
    """Vending machine: a steel body with a front of glass."""
    body = span((-0.38, -0.45, 0.05), (0.36, 0.45, 1.83))
    front = span((0.362, -0.4, 0.55), (0.37, 0.18, 1.7), ("-x",))
    return Piece("vending", 0.78, 0.92, {"metal": body, "acrylic": front})


def lockers(rng: np.random.Generator) -> Piece:
    """A bank of steel lockers with gaps between their doors."""
    count = int(rng.integers(3, 6))
    width = 0.3 * count
    body = span((-0.24, -width / 2, 0), (0.23, width / 2, 1.8), ("-z",))
    doors = [
        span((0.231, -width / 2 + 0.3 * k + 0.01, 0.1), (0.245, -width / 2 + 0.3 * k + 0.29, 1.77), ("-x",))
        for k in range(count)
    ]
    return Piece("lockers", 0.5, width, {"metal": joined(body, *doors)})


def noticeboard(rng: np.random.Generator) -> Piece:
    """A cork board with paper on it."""
    width = rng.choice([1.2, 1.8, 2.4])
    return Piece("noticeboard", 0.04, width, {"chipboard": box((0, 0, 1.5), (0.02, width, 1.0))})


def bench(rng: np.random.Generator) -> Piece:
    """Wooden bench on steel feet."""
    seat = box((0, 0, 0.43), (0.38, 1.5, 0.04))
    feet = [span((-0.17, y - 0.02, 0), (0.17, y + 0.02, 0.41), ("-z", "+z")) for y in (-0.6, 0.6)]
    return Piece("bench", 0.42, 1.5, {"wood": seat, "metal": joined(*feet)})


def plant(rng: np.random.Generator) -> Piece:
    """A plant in a stone pot; its leaves are small tilted sheets."""
    pot = cylinder((0, 0, 0.2), 0.18, 0.4, 10, ("-z",))
    leaves = []
    for k in range(14):
        angle, up = 2.4 * k + rng.uniform(-0.3, 0.3), rng.uniform(0.5, 1.25)
        place = (0.14 * np.cos(angle), 0.14 * np.sin(angle), up)
        leaves.append(placed(rectangle((0.05, 0, 0), (0.1, 0.16), (0.5, 0, 0.85)), place, (0, 0, angle)))
    return Piece("plant", 0.5, 0.5, {"marble": pot, "fabric": joined(*leaves)})


def lectern(rng: np.random.Generator) -> Piece:
    """Speaker's desk."""
    return Piece("lectern", 0.5, 0.7, {"wood": span((-0.22, -0.32, 0), (0.22, 0.32, 1.1), ("-z",))})


def lab_bench(rng: np.random.Generator) -> Piece:
    """Laboratory bench: steel cupboards under a worktop, instruments on it."""
    width = rng.choice([1.5, 1.8])
    body = span((-0.36, -width / 2 + 0.02, 0), (0.32, width / 2 - 0.02, 0.86), ("-z", "+z"))
    top = span((-0.375, -width / 2, 0.86), (0.375, width / 2, 0.89))
    tools = []
    for y in (-width / 4, width / 4):
        w, d, h = rng.uniform(0.25, 0.5), rng.uniform(0.25, 0.45), rng.uniform(0.15, 0.45)
        tools.append(span((-0.3, y - w / 2, 0.892), (-0.3 + d, y + w / 2, 0.892 + h), ("-z",)))
    return Piece("lab bench", 0.75, width, {"chipboard": top, "metal": joined(body, *tools)})
