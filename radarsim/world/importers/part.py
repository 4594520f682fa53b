"""A piece of an imported scene that gets one material."""

from dataclasses import dataclass

import trimesh


@dataclass
class Part:
    """Triangles that have one material.

    Attributes:
        name: what the source calls it.
        mesh: in the source's own coordinates until `importers` places it.
        material: a name of `radarsim.world.materials` or the mapping of a custom one, as scene files have it; None:
            the source does not say.
        solid: part of the surface of a body: seen from its outside only.
        room: a closed surface around all else, seen from its inside.
        labels: other names that material patterns may match: those of its material, group or category.
    """

    name: str
    mesh: trimesh.Trimesh
    material: str | dict | None = None
    solid: bool = False
    room: bool = False
    labels: tuple[str, ...] = ()


def unreported(*_: object) -> None:
    """Progress that nobody wants to see."""
