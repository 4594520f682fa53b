"""Recognition of spheres and cylinders in tessellated meshes by their normals and corners.

As plates, the facets of a pipe or a lamp would reflect one after the other; a round body has one steady echo.
Only whole bodies are recognised: closed spheres, and full cylinders with or without caps.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

#: Smallest number of sides of a prism that represents a cylinder.
FEWEST_SIDES = 8
#: Largest distance of a corner from the round surface, relative to its radius.
ROUND = 0.02
#: An icosahedron covers 0.76 of the sphere through its corners, the maximum for its number of triangles.
TOO_FEW = 20


@dataclass(frozen=True)
class RoundBody:
    """A sphere (axis zero, half zero) or a cylinder about an axis, `half` its half length, m."""

    center: Float[np.ndarray, "3"]
    axis: Float[np.ndarray, "3"]
    radius: float
    half: float


def recognise(mesh: trimesh.Trimesh) -> tuple[list[RoundBody], Bool[np.ndarray, "face"]]:
    """Return the round bodies of a mesh, and a mask of the faces that they replace."""
    bodies, taken = [], np.zeros(len(mesh.faces), bool)
    fewest = 2 * FEWEST_SIDES  # each side of a prism is two triangles
    for faces in trimesh.graph.connected_components(
        mesh.face_adjacency, nodes=np.arange(len(mesh.faces)), min_len=fewest
    ):
        body, sides = _sphere(mesh, faces) or _cylinder(mesh, faces) or (None, None)
        if body is not None:
            bodies.append(body)
            taken[sides] = True
    return bodies, taken


def _sphere(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]) -> tuple[RoundBody, Int[np.ndarray, "side"]] | None:
    if len(faces) <= TOO_FEW:
        return None
    corners = mesh.vertices[np.unique(mesh.faces[faces])]
    center, radius = _round(corners)
    outward = mesh.triangles_center[faces] - center
    facing = np.einsum("fd,fd->f", outward, mesh.face_normals[faces]) > 0.9 * np.linalg.norm(outward, axis=1)
    even = np.abs(np.linalg.norm(corners - center, axis=1) - radius).max() < ROUND * radius
    covers = mesh.area_faces[faces].sum() > 0.85 * 4 * np.pi * radius**2
    return (RoundBody(center, np.zeros(3), radius, 0.0), faces) if even and covers and facing.all() else None


def _cylinder(
    mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]
) -> tuple[RoundBody, Int[np.ndarray, "side"]] | None:
    normals, areas = mesh.face_normals[faces], mesh.area_faces[faces]
    for axis in np.linalg.eigh((normals * areas[:, None]).T @ normals)[1].T:
        tilt = np.abs(normals @ axis)
        sides = tilt < 0.01
        if not np.all(sides | (tilt > 0.999)) or sides.sum() < FEWEST_SIDES:
            continue
        corners = mesh.vertices[np.unique(mesh.faces[faces[sides]])]
        u = np.linalg.svd(axis[None])[2][1:]
        center, radius = _round(corners @ u.T)
        apart = corners @ u.T - center
        if np.abs(np.linalg.norm(apart, axis=1) - radius).max() > ROUND * radius:
            continue
        outward = mesh.triangles_center[faces[sides]] @ u.T - center
        facing = normals[sides] @ u.T
        angles = np.sort(np.arctan2(facing[:, 1], facing[:, 0]))
        gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
        convex = np.all(np.einsum("fd,fd->f", outward, facing) > 0)
        if not convex or gaps.max() > 2 * np.pi / FEWEST_SIDES * 1.01:
            continue
        z = corners @ axis
        middle = center @ u + axis * (z.max() + z.min()) / 2
        return RoundBody(middle, axis, radius, np.ptp(z) / 2), faces[sides]
    return None


def _round(points: Float[np.ndarray, "n d"]) -> tuple[Float[np.ndarray, "d"], float]:
    """Centre and radius of the circle or sphere through points: |p|^2 = 2 p . c + (r^2 - |c|^2), least squares."""
    middle = points.mean(axis=0)
    p = points - middle
    solved = np.linalg.lstsq(np.column_stack([2 * p, np.ones(len(p))]), np.sum(p * p, axis=1), 1e-9)[0]
    return middle + solved[:-1], float(np.sqrt(max(solved[-1] + solved[:-1] @ solved[:-1], 0.0)))
