"""Detection of rooms among closed surfaces: one that encloses everything else and has space to stand in.

Files do not mark them: the faces of a modelled room point outwards as often as inwards. With outward faces it would be
a solid block, and a radar in it would see nothing.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import trimesh
from jaxtyping import Int

from radarsim.world.importers.part import Part

#: Smallest height of a room, m, and smallest mean width, twice its volume over its surface, m: a closed mesh of walls
#: alone encloses everything, too, but is only as wide as the walls are thick.
_HIGH, _WIDE = 1.8, 0.6
#: Tolerance of the enclosure, m.
_BEYOND = 0.3


def turned_to_rooms(parts: list[Part]) -> tuple[list[Part], list[str]]:
    """Turn the faces of rooms inwards, with floors up; return the parts and the names of those that were turned.

    Args:
        parts: clean, z up, m.
    """
    bounds = np.array([part.mesh.bounds for part in parts])
    whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
    shells = [(number, *shell) for number, part in enumerate(parts) for shell in _shells(part.mesh)]
    rooms = [shell for shell in shells if shell[2].volume < 0]  # among them the cavities of walls with an outside
    turned = [] if rooms else [s for s in shells if np.all(np.abs(s[2].bounds - whole) < _BEYOND)]
    parts = list(parts)
    for number, faces, _ in rooms + turned:
        mesh = parts[number].mesh.copy()
        if turned:
            mesh.faces[faces] = mesh.faces[faces, ::-1]
        parts[number] = replace(
            parts[number], mesh=trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), room=True
        )
    return parts, [parts[number].name for number, *_ in turned]


def _shells(mesh: trimesh.Trimesh) -> Iterator[tuple[Int[np.ndarray, "face"], trimesh.Trimesh]]:
    """Closed surfaces of a mesh with space to stand in: their faces, and each as a mesh."""
    for faces in trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=4):
        shell = trimesh.Trimesh(mesh.vertices, mesh.faces[faces], process=False)
        if np.ptp(shell.bounds[:, 2]) >= _HIGH and shell.is_watertight and 2 * abs(shell.volume) > _WIDE * shell.area:
            yield faces, shell
