"""Part of an imported scene with one material."""

from dataclasses import dataclass

import trimesh


@dataclass
class Part:
    """Triangles of one material.

    Attributes:
        name: name in the source.
        mesh: in the source's coordinates until `importers` transforms it.
        material: a name of `radarsim.world.materials` or the mapping of a custom one, as scene files have it; None:
            the source has no material.
        solid: part of the surface of a body: seen from its outside only.
        room: a closed surface around everything else, seen from its inside.
        labels: other names for material patterns: those of its material, group or category.
    """

    name: str
    mesh: trimesh.Trimesh
    material: str | dict | None = None
    solid: bool = False
    room: bool = False
    labels: tuple[str, ...] = ()


def unreported(*_: object) -> None:
    """Ignore progress."""
