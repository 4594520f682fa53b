"""Styles of buildings (`styles.yaml`): materials, sizes and densities; four after the paper's, and `office`.

Lengths in m; a pair of numbers is a range from which a building draws; shares and probabilities are in 0...1; weights
are relative.
"""

from dataclasses import dataclass, field

from radarize.io.yamlfile import read_beside


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
    """Style of a building.

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
        windows, doors: see `Windows` and `Doors`.
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

    def floor(self, kind: str) -> str:
        """Floor material of a kind of room."""
        return self.floors.get(kind, self.floors[""])


def _style(about: dict) -> Style:
    return Style(**about | {"windows": Windows(**about["windows"]), "doors": Doors(**about["doors"])})


STYLES = {name: _style(about) for name, about in read_beside(__file__).items()}
