"""Clutter and roughness settings of a scene."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SurfaceSettings:
    """Deviations of surfaces from their drawing, relative to the usual.

    Attributes:
        clutter: objects on walls, desks and shelves and under ceilings: down to 2 cm as geometry
            (`radarsim.world.generators.small_objects`), smaller ones as points (`radarsim.propagation.clutter`).
        unevenness: deviation of walls, floors and ceilings from planes (`radarsim.propagation.unevenness`), and of
            buildings from square (`radarsim.world.squareness`).
    """

    clutter: float = 0.0
    unevenness: float = 0.0


#: Bare, flat and square.
IDEAL = SurfaceSettings()
#: Typical of rooms that are furnished and in use.
IN_USE = SurfaceSettings(1.0, 1.0)
