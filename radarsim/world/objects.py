"""Objects of a scene: meshes of one material."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from jaxtyping import Bool, Float

from radarsim.world.materials import Material

#: m: smallest height of a room's mesh; distance from its bottom and top of faces that are floor and ceiling; and cosine
#: by which these must face up or down, in a scan, too.
_ROOM, _LEVEL, _FLAT = 1.8, 0.15, 0.95


@dataclass(frozen=True)
class SceneObject:
    """Object of one material.

    Attributes:
        name: unique in its scene.
        mesh: float64 triangles in world coordinates, normals outward (either side reflects).
        material: of all its triangles.
        solid: whether it is part of the surface of a body, though perhaps an open mesh: seen from its outside only.
    """

    name: str
    mesh: trimesh.Trimesh
    material: Material
    solid: bool = False

    @cached_property
    def two_sided(self) -> bool:
        """Whether it is a sheet, which reflects on both sides."""
        return not (self.solid or self.mesh.is_watertight)

    @cached_property
    def is_floor_or_ceiling(self) -> bool:
        """Whether it has horizontal faces only."""
        return bool(np.all(np.abs(self.mesh.face_normals[:, 2]) > 0.999))

    def floors_and_ceilings(
        self, place: Float[np.ndarray, "face 3"], normal: Float[np.ndarray, "face 3"]
    ) -> Bool[np.ndarray, "face"]:
        """Mask of its faces, with centres (m) and normals, that are floor or ceiling: all, if it has no others; for a
        room in one mesh, those at its bottom that face up and those at its top that face down."""
        (low, high), up = self.mesh.bounds[:, 2], normal[:, 2]
        seen_from_within = self.two_sided or (self.mesh.is_watertight and self.mesh.volume < 0)
        if self.is_floor_or_ceiling or high - low < _ROOM or not seen_from_within:
            return np.full(len(place), self.is_floor_or_ceiling)
        bottom, top = place[:, 2] < low + _LEVEL, place[:, 2] > high - _LEVEL
        return (bottom & (up > _FLAT)) | (top & (up < -_FLAT))
