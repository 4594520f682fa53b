"""Removal of scanner noise from planes: scanned walls become flat again.

A radar at 77 GHz sees a wall as a mirror; the same wall with 5 mm of scanner noise would scatter like gravel (the
residual is the scanner's, true roughness is the material's: `scene.planes`). That module finds planes with up to half a
millimetre of noise. Here they are found on a smoothed copy, and the corners of the scan near a plane are moved onto it.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy import sparse

from radarsim.world.planes import regions

#: Scans are recognised by their resolution: largest median edge, m, and smallest number of triangles.
FINE, MANY = 0.12, 2000
#: Smoothing length of the copy, m: larger than noise, smaller than furniture.
_LENGTH = 0.10
_STEPS = (8, 60)
#: Smallest area of planes that are flattened, m^2.
SMALLEST = 0.25
#: Corners within four times the noise of a plane are moved onto it, but by no more than this, m.
FARTHEST = 0.04


@dataclass(frozen=True)
class Flattened:
    """A mesh with its planes flat, how many there are, their share of the area, and the noise taken away (RMS, m)."""

    mesh: trimesh.Trimesh
    planes: int
    share: float
    noise: float


def flatten(mesh: trimesh.Trimesh) -> Flattened | None:
    """Flatten the planes of a mesh; None if it is no scan, or has no noisy planes."""
    edge = float(np.median(mesh.edges_unique_length))
    if len(mesh.faces) < MANY or edge > FINE:
        return None
    vertices = np.asarray(mesh.vertices)
    links = trimesh.smoothing.laplacian_calculation(mesh)
    steps = int(np.clip(2 * (_LENGTH / edge) ** 2, *_STEPS))
    copy = trimesh.Trimesh(vertices, mesh.faces, process=False)
    trimesh.smoothing.filter_laplacian(copy, 0.5, steps, False, False, links)  # half way to the neighbours' mean
    found = [faces for faces in regions(copy) if mesh.area_faces[faces].sum() >= SMALLEST]
    if not found:
        return None
    inner = [np.unique(mesh.faces[faces]) for faces in found]
    planes = [_fit(vertices[corners]) for corners in inner]
    residual = np.concatenate(
        [(vertices[c] - at) @ normal for c, (at, normal) in zip(inner, planes, strict=True)]
    )  # fmt: skip
    # Robust: a region's rim may bend away from its plane.
    noise = float(1.4826 * np.median(np.abs(residual)))
    if noise < 1e-4:
        return None
    reach = min(4 * noise, FARTHEST)
    # Smoothing rounds the rims off, so a plane extends beyond its region as long as the scan stays near it.
    members = [
        _spread(corners, np.abs((vertices - at) @ normal) < reach, links, 2 + int(np.sqrt(4 * steps)))
        for corners, (at, normal) in zip(inner, planes, strict=True)
    ]
    flat = vertices.copy()
    for _ in range(8):  # corners on two or three planes end where these meet
        for corners, (at, normal) in zip(members, planes, strict=True):
            flat[corners] -= ((flat[corners] - at) @ normal)[:, None] * normal
    moved = np.linalg.norm(flat - vertices, axis=1) < 3 * FARTHEST  # where two planes meet at a sharp angle
    share = sum(mesh.area_faces[faces].sum() for faces in found) / mesh.area
    result = trimesh.Trimesh(np.where(moved[:, None], flat, vertices), mesh.faces, process=False)
    return Flattened(result, len(found), float(share), noise)


def _fit(points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """A point on the plane through points, and its unit normal."""
    at = points.mean(axis=0)
    return at, np.linalg.eigh((points - at).T @ (points - at))[1][:, 0]


def _spread(corners: np.ndarray, near: np.ndarray, links: sparse.coo_matrix, steps: int) -> np.ndarray:
    """Corners near a plane that are connected to some of its own by at most `steps` edges."""
    reached = np.zeros(len(near), bool)
    reached[corners] = near[corners]
    edge, links = np.flatnonzero(reached), links.tocsr()
    for _ in range(steps):
        following = np.unique(links[edge].indices)
        edge = following[near[following] & ~reached[following]]
        if not len(edge):
            break
        reached[edge] = True
    return np.flatnonzero(reached)
