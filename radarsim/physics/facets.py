"""Flat rectangles of the scene: mirrors for ghosts, and plates that flash where they face the radar."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from radarize.radar.config import RadarConfig
from radarsim.scene.scene import Scene

#: Facets below this area (m^2) do not flash: their scatterers stand for them.
SMALLEST_PLATE = 0.01
#: Facets below this area (m^2) are no mirrors: at 77 GHz and 2 m the first Fresnel zone is about 0.03 m^2 wide.
SMALLEST_MIRROR = 0.25
#: A rectangle is a group of triangles that fills this share of its bounding rectangle.
SMALLEST_FILL = 0.97
#: Entries of the reflection tables, over the cosine of the angle of incidence.
TABLE = 65


@dataclass(frozen=True)
class Facets:
    """Flat rectangles.

    Attributes:
        center, normal, u, v: m and unit vectors; u, v lie along the sides.
        half: half side lengths along u and v, m.
        two_sided: sheets without a volume show both sides.
        mirror: large enough to be a mirror.
        horizontal: part of a floor or ceiling.
        reflection: complex reflection coefficient by (facet, polarisation TE / TM, cosine of incidence), roughness
            included, as it appears in the beat signal (conjugate of the field's).
    """

    center: Float[np.ndarray, "facet 3"]
    normal: Float[np.ndarray, "facet 3"]
    u: Float[np.ndarray, "facet 3"]
    v: Float[np.ndarray, "facet 3"]
    half: Float[np.ndarray, "facet 2"]
    two_sided: np.ndarray
    mirror: np.ndarray
    horizontal: np.ndarray
    reflection: Complex[np.ndarray, "facet 2 cosine"]

    def __len__(self) -> int:
        return len(self.center)

    @classmethod
    def of(cls, scene: Scene, config: RadarConfig) -> "Facets":
        """The rectangles of a scene: coplanar neighbouring triangles, as a whole or pair by pair."""
        rows = []
        tables: dict[str, np.ndarray] = {}
        for item in scene.objects:
            mesh = item.mesh
            name = item.material.name
            if name not in tables:
                tables[name] = _reflection_table(item.material, config)
            for faces in mesh.facets:
                normal = mesh.face_normals[faces[0]]
                for center, u, v, half in _rectangles(mesh, faces, normal):
                    area = 4 * half.prod()
                    if area < SMALLEST_PLATE:
                        continue
                    mirror = area >= SMALLEST_MIRROR
                    rows.append(
                        (center, normal, u, v, half, item.two_sided, mirror, item.is_floor_or_ceiling, tables[name])
                    )
        if not rows:
            empty = np.zeros((0, 3))
            none = np.zeros(0, bool)
            return cls(empty, empty, empty, empty, np.zeros((0, 2)), none, none, none, np.zeros((0, 2, TABLE), complex))
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))


def _reflection_table(material, config: RadarConfig) -> Complex[np.ndarray, "2 cosine"]:
    """Fresnel coefficients with the Rayleigh roughness factor exp(-8 (pi sigma_h cos / lambda)^2), ITU-R P.2040."""
    cosine = np.linspace(0, 1, TABLE)
    rough = np.exp(-8 * (np.pi * material.roughness * cosine / config.wavelength) ** 2)
    return np.conj(np.stack(material.fresnel(cosine, config.center_frequency))) * rough


def _rectangles(mesh, faces, normal):
    """Rectangles that a group of coplanar triangles consists of: the group itself, or pairs of its triangles."""
    whole = _rectangle(mesh.triangles[faces].reshape(-1, 3), normal)
    if mesh.area_faces[faces].sum() >= SMALLEST_FILL * 4 * whole[3].prod():
        return [whole]
    members, taken, found = set(faces.tolist()), set(), []
    for pair in mesh.face_adjacency.tolist():
        if not members.issuperset(pair) or taken.intersection(pair):
            continue
        rectangle = _rectangle(mesh.triangles[pair].reshape(-1, 3), normal)
        if mesh.area_faces[pair].sum() >= SMALLEST_FILL * 4 * rectangle[3].prod():
            found.append(rectangle)
            taken.update(pair)
    return found


def _rectangle(points: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "3"]):
    """Smallest rectangle around coplanar points: center, two side directions, half sides."""
    edges = points - np.roll(points, -1, axis=0)
    lengths = np.linalg.norm(edges, axis=1)
    best = None
    # The smallest bounding rectangle has a side along an edge of the hull, hence along some edge of a convex facet.
    for edge in edges[lengths > 1e-6]:
        u = edge / np.linalg.norm(edge)
        v = np.cross(normal, u)
        a, b = points @ u, points @ v
        half = np.array([np.ptp(a), np.ptp(b)]) / 2
        if best is None or half.prod() < best[3].prod() * (1 - 1e-9):
            center = u * (a.max() + a.min()) / 2 + v * (b.max() + b.min()) / 2 + normal * (points[0] @ normal)
            best = (center, u, v, half)
    return best
