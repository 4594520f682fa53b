"""How lived-in a place is."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Life:
    """What tells a place from its drawing, as shares of what is usual; none: the drawing itself.

    Attributes:
        clutter: what is on walls, desks and shelves and under ceilings: down to 2 cm as geometry
            (`radarsim.world.generators.things`), below that as points (`radarsim.propagation.clutter`).
        unevenness: how far walls, floors and ceilings are from their planes (`radarsim.propagation.unevenness`), and
            buildings from square (`radarsim.world.squareness`).
    """

    clutter: float = 0.0
    unevenness: float = 0.0


#: The drawing itself.
DRAWN = Life()
