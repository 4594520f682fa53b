"""Cleaning of imported meshes for ray tracing: merged corners, no degenerate triangles, limited size."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import trimesh

from radarize.io.errors import InputError
from radarsim.world.importers.part import Part, unreported
from radarsim.world.shapes import closest

#: Decimals of a metre to which corners are rounded before merging.
_DIGITS = 5
#: Largest deviation of 99 % of the surface by decimation, m: a wall stays flat to a few wavelengths.
DEVIATION = 0.02
_SAMPLES = 200_000


def clean(part: Part, source: str) -> Part | None:
    """Merge corners of a part and remove degenerate and repeated triangles; None if nothing is left.

    Raises:
        InputError: corners that are not finite, or triangles of corners that do not exist.
    """
    vertices, faces = np.asarray(part.mesh.vertices, float), np.asarray(part.mesh.faces)
    used = np.zeros(len(vertices), bool)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InputError(
            f"{source}: part {part.name!r} has a triangle of corner {faces.max()}, but only {len(vertices)} corners"
        )
    used[faces.ravel()] = True
    if bad := int(np.sum(~np.isfinite(vertices[used]).all(axis=1))):
        raise InputError(f"{source}: part {part.name!r} has {bad} corners that are no finite numbers")
    mesh = trimesh.Trimesh(np.where(used[:, None], vertices, 0.0), faces, process=False)
    mesh.merge_vertices(digits_vertex=_DIGITS)
    mesh.update_faces(mesh.area_faces > 1e-12)
    if not len(mesh.faces):
        return None
    mesh.update_faces(mesh.unique_faces())  # the same three corners in either order are one sheet
    mesh.remove_unreferenced_vertices()
    return replace(part, mesh=mesh)


def edges_of_many(mesh: trimesh.Trimesh) -> int:
    """Number of edges with more than two triangles, where the mesh is no surface."""
    _, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return int(np.sum(count > 2))


def decimate(
    parts: list[Part], budget: int, source: str, progress: Callable[..., object] = unreported
) -> tuple[list[Part], float]:
    """Decimate parts to about `budget` triangles together; return them and the deviation of 99 % of the surface, m.

    Quadric error metrics (Garland and Heckbert 1997) collapse flat ground first, and so keep walls flat.

    Raises:
        InputError: the deviation would be too large.
    """
    import open3d as o3d

    total = sum(len(part.mesh.faces) for part in parts)
    if total <= budget:
        return parts, 0.0
    made, deviations = [], []
    for number, part in enumerate(parts):
        progress("decimating", number, len(parts))
        target = max(12, int(budget * len(part.mesh.faces) / total))
        if len(part.mesh.faces) <= target:
            made.append(part)
            continue
        dense = o3d.geometry.TriangleMesh(
            o3d.utility.Vector3dVector(part.mesh.vertices), o3d.utility.Vector3iVector(part.mesh.faces)
        )
        coarse = dense.simplify_quadric_decimation(target)
        mesh = trimesh.Trimesh(np.asarray(coarse.vertices), np.asarray(coarse.triangles), process=False)
        share = int(np.ceil(_SAMPLES * len(part.mesh.faces) / total))
        points = part.mesh.vertices[:: max(1, len(part.mesh.vertices) // share)]
        deviations.append(closest(mesh.triangles, points)[0])
        thin = clean(replace(part, mesh=mesh), source)
        if thin is not None:
            made.append(thin)
    progress("decimating", len(parts), len(parts))
    left = sum(len(part.mesh.faces) for part in made)
    moved = float(np.quantile(np.concatenate(deviations), 0.99))
    if moved > DEVIATION or left > 1.2 * budget:
        raise InputError(
            f"{source}: has {total} triangles, and {left} would move 1 % of its surface by more than {moved:.3f} m, "
            f"expected at most {budget} triangles within {DEVIATION} m: raise --budget or simplify the mesh first"
        )
    return made, moved
