"""Rooms told from solids: a closed surface that holds all else and has space to stand in is seen from its inside.

Files say little of it: a modelled room is as often a box with its faces outwards as one with its faces inwards. Only
outwards it would be a block of concrete, and a walk in it would see nothing.
"""

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float, Int

from radarsim.world.importers.part import Part

#: A room is so high, m, and so wide on average, twice its volume over its surface, m: a closed mesh of walls alone
#: holds all else, too, but is as wide as the walls are thick.
_HIGH, _WIDE = 1.8, 0.6
#: What lies further outside than this, m, is reason to be outside.
_BEYOND = 0.3


@dataclass(frozen=True, eq=False)
class _Shell:
    """A closed surface: its faces of a part, its lowest and highest corner (m), its volume (m^3, negative inwards)."""

    part: int
    faces: Int[np.ndarray, "face"]
    bounds: Float[np.ndarray, "2 3"]
    volume: float


def turned_to_rooms(parts: list[Part]) -> tuple[list[Part], list[str]]:
    """Parts with the faces of rooms inwards, floors up; and the names of those that were turned.

    Args:
        parts: clean, z up, m.
    """
    bounds = np.array([part.mesh.bounds for part in parts])
    whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
    shells = [shell for number, part in enumerate(parts) for shell in _shells(number, part.mesh)]
    rooms = [s for s in shells if s.volume < 0]  # among them the cavities of walls with an outside
    turned = [] if rooms else [s for s in shells if np.all(np.abs(s.bounds - whole) < _BEYOND)]
    parts = list(parts)
    for shell in (*rooms, *turned):
        mesh = parts[shell.part].mesh
        faces = np.array(mesh.faces)
        if shell.volume > 0:
            faces[shell.faces] = faces[shell.faces, ::-1]
        mesh = trimesh.Trimesh(mesh.vertices, faces, process=False)
        parts[shell.part] = replace(parts[shell.part], mesh=mesh, room=True)
    return parts, [parts[shell.part].name for shell in turned]


def _shells(number: int, mesh: trimesh.Trimesh) -> list[_Shell]:
    """The closed surfaces of a mesh with space to stand in."""
    found = []
    for faces in trimesh.graph.connected_components(mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=4):
        corners = mesh.triangles[faces]
        bounds = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
        edges = np.sort(mesh.edges.reshape(-1, 3, 2)[faces].reshape(-1, 2), axis=1)
        if np.ptp(bounds[:, 2]) < _HIGH or np.any(np.unique(edges, axis=0, return_counts=True)[1] != 2):
            continue
        a, b, c = (corners - bounds.mean(axis=0)).transpose(1, 0, 2)
        volume = float(np.einsum("fd,fd->", a, np.cross(b, c)) / 6)
        if 2 * abs(volume) > _WIDE * mesh.area_faces[faces].sum():
            found.append(_Shell(number, faces, bounds, volume))
    return found
