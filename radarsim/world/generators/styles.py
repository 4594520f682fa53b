"""The styles of buildings: what they are made of, how large and how dense everything is.

Four after the paper's, A: modern glass and metal; B: old wood and drywall; C: brick and metal; D: between B and C; and
the plain `office`. A style is data: the same code builds all of them. Lengths in m; a pair of numbers is a range that a
building draws from; shares and chances lie in 0...1; weights are relative.
"""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Windows:
    """Windows of a facade, repeated every module.

    Attributes:
        sill, top: height of the lower and upper edge, m.
        width: share of a module; 1: ribbons from wall to wall.
        bays: panes side by side in one module.
        transoms: bars across.
        frame: material.
    """

    sill: float
    top: float
    width: float
    bays: int
    transoms: int
    frame: str


@dataclass(frozen=True)
class Doors:
    """Doors of rooms.

    Attributes:
        leaf: weights of materials.
        frame: material.
        closed, ajar: shares; the others stand open.
    """

    leaf: dict[str, float]
    frame: str
    closed: float
    ajar: float


@dataclass(frozen=True, kw_only=True)
class Style:
    """One style.

    Attributes:
        height: floor to ceiling, m.
        outer, inner: wall thickness, m.
        corridor: clear width, m.
        row: depth of the rooms, m.
        module: distance of the facade's axes, m; rooms are a whole number of modules wide.
        facade, lining, partition, passage: material of outer walls outside and inside, of walls between rooms, of
            corridor walls.
        ceiling: material.
        floors: material by kind of room; "" for all others.
        windows, doors: see there.
        glazed: share of rooms with a glass wall to the corridor.
        suites: chance that neighbouring rooms are joined by a door.
        column: material and width of columns at the facade's axes (0: none), m.
        lamp: depth and width of ceiling lamps, and their distance, m.
        radiators: chance under a window.
        risers: chance of upright pipes in a room's corner.
        mains: pipes under the ceiling along corridors.
        storage: material of cabinets and of shelves.
        fittings: pieces along corridors with their number per 10 m.
        kinds: weights of the kinds of rooms at a facade; `core`: of those inside.
        plain: doors without casings, two panes to a window, all lamps along x.
    """

    height: float
    outer: float
    inner: float
    corridor: tuple[float, float] = (0.0, 0.0)
    row: tuple[float, float] = (0.0, 0.0)
    module: tuple[float, float]
    facade: str
    lining: str
    partition: str
    passage: str
    ceiling: str
    floors: dict[str, str]
    windows: Windows
    doors: Doors
    glazed: float = 0.0
    suites: float = 0.0
    column: tuple[str, float] = ("", 0.0)
    lamp: tuple[float, float, float]
    radiators: float = 0.0
    risers: float = 0.0
    mains: int = 0
    storage: tuple[str, str] = ("metal", "wood")
    fittings: dict[str, float] = field(default_factory=dict)
    kinds: dict[str, float]
    core: dict[str, float] = field(default_factory=dict)
    plain: bool = False

    def floor(self, kind: str) -> str:
        """Floor material of a kind of room."""
        return self.floors.get(kind, self.floors[""])


STYLES: dict[str, Style] = {
    "A": Style(
        height=3.0, outer=0.30, inner=0.12, corridor=(2.2, 2.6), row=(4.8, 6.0), module=(1.35, 1.5),
        facade="metal", lining="plasterboard", partition="plasterboard", passage="plasterboard",
        ceiling="ceiling board", floors={"": "vinyl", "office": "carpet", "meeting": "carpet", "lounge": "carpet",
                                         "lecture": "carpet", "corridor": "marble"},
        windows=Windows(sill=0.15, top=2.75, width=1.0, bays=1, transoms=1, frame="metal"),
        doors=Doors(leaf={"glass": 0.5, "wood": 0.3, "metal": 0.2}, frame="metal", closed=0.25, ajar=0.1),
        glazed=0.65, suites=0.35, column=("concrete", 0.4), lamp=(0.1, 2.0, 2.6), radiators=0.0, risers=0.0, mains=0,
        storage=("metal", "metal"),
        fittings={"lift": 0.8, "bench": 0.5, "plant": 0.7, "extinguisher": 0.4, "cabinet": 0.2, "vending": 0.15},
        kinds={"office": 5, "meeting": 3, "lounge": 2, "lecture": 1, "kitchen": 0.7},
        core={"meeting": 3, "lounge": 2, "storage": 1, "kitchen": 1.5},
    ),
    "B": Style(
        height=3.2, outer=0.36, inner=0.14, corridor=(1.8, 2.2), row=(4.4, 5.6), module=(1.6, 2.0),
        facade="concrete", lining="plasterboard", partition="plasterboard", passage="plasterboard",
        ceiling="plasterboard", floors={"": "floorboard", "toilet": "marble", "kitchen": "vinyl", "office": "carpet"},
        windows=Windows(sill=0.85, top=2.5, width=0.62, bays=2, transoms=1, frame="wood"),
        doors=Doors(leaf={"wood": 1.0}, frame="wood", closed=0.3, ajar=0.2),
        glazed=0.0, suites=0.45, column=("", 0.0), lamp=(0.18, 1.2, 2.8), radiators=0.8, risers=0.4, mains=0,
        storage=("wood", "wood"),
        fittings={"noticeboard": 1.0, "cabinet": 0.8, "bench": 0.5, "extinguisher": 0.4, "shelf": 0.5, "bin": 0.4},
        kinds={"office": 6, "meeting": 2, "lecture": 1.5, "library": 1.5, "lounge": 0.6},
        core={"storage": 3, "library": 1.5, "kitchen": 1, "office": 2},
    ),
    "C": Style(
        height=3.3, outer=0.40, inner=0.15, corridor=(2.0, 2.6), row=(4.8, 6.4), module=(1.5, 1.8),
        facade="brick", lining="brick", partition="plasterboard", passage="brick",
        ceiling="concrete", floors={"": "vinyl", "office": "carpet", "corridor": "concrete", "lab": "concrete"},
        windows=Windows(sill=1.0, top=2.7, width=0.78, bays=3, transoms=2, frame="metal"),
        doors=Doors(leaf={"metal": 0.8, "wood": 0.2}, frame="metal", closed=0.3, ajar=0.1),
        glazed=0.08, suites=0.4, column=("concrete", 0.45), lamp=(0.3, 1.2, 3.0), radiators=0.6, risers=0.5, mains=2,
        storage=("metal", "metal"),
        fittings={"lockers": 1.6, "cabinet": 0.6, "extinguisher": 0.5, "noticeboard": 0.5, "bin": 0.5, "vending": 0.15},
        kinds={"lab": 5, "office": 3, "lecture": 1.5, "storage": 1, "meeting": 1},
        core={"storage": 2, "lab": 3, "kitchen": 1, "office": 1},
    ),
    "D": Style(
        height=3.0, outer=0.36, inner=0.14, corridor=(1.9, 2.4), row=(4.6, 6.0), module=(1.5, 1.9),
        facade="brick", lining="plasterboard", partition="plasterboard", passage="plasterboard",
        ceiling="ceiling board", floors={"": "vinyl", "office": "carpet", "meeting": "carpet", "lounge": "floorboard"},
        windows=Windows(sill=0.9, top=2.4, width=0.7, bays=2, transoms=0, frame="metal"),
        doors=Doors(leaf={"wood": 0.6, "metal": 0.4}, frame="metal", closed=0.3, ajar=0.15),
        glazed=0.15, suites=0.4, column=("brick", 0.4), lamp=(0.2, 1.2, 2.6), radiators=0.8, risers=0.4, mains=1,
        storage=("metal", "wood"),
        fittings={"lockers": 0.6, "noticeboard": 0.8, "bench": 0.4, "extinguisher": 0.4, "cabinet": 0.5, "bin": 0.4,
                  "vending": 0.15},
        kinds={"office": 5, "lab": 2, "meeting": 2, "lecture": 1.5, "lounge": 1},
        core={"storage": 2, "meeting": 1.5, "kitchen": 1, "office": 1, "library": 1},
    ),
    "office": Style(  # its corridor and rows are as its parameters say
        height=2.7, outer=0.30, inner=0.12, module=(2.4, 2.4),
        facade="concrete", lining="plasterboard", partition="plasterboard", passage="plasterboard",
        ceiling="ceiling board", floors={"": "vinyl", "office": "carpet", "meeting": "carpet", "lounge": "carpet"},
        windows=Windows(sill=0.9, top=2.2, width=0.7, bays=2, transoms=0, frame="metal"),
        doors=Doors(leaf={"wood": 1.0}, frame="plasterboard", closed=0.25, ajar=0.0),
        lamp=(0.3, 1.2, 2.2), kinds={"office": 2, "meeting": 1, "storage": 1, "lounge": 1}, plain=True,
    ),
}  # fmt: skip
