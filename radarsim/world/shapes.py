"""Primitive meshes: planar facets as triangles that share vertices, outward normals, metres.

Faces of a box can be left out where they would touch another surface: a hidden face would scatter without being seen,
and two coplanar faces would reflect twice.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import shapely
import trimesh
from jaxtyping import Float, Int
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from shapely.geometry import Polygon

Vector = ArrayLike  # x, y, z

# Corner signs of each face of a box, counter-clockwise seen from outside.
_FACES = {
    "-x": ((-1, -1, -1), (-1, -1, 1), (-1, 1, 1), (-1, 1, -1)),
    "+x": ((1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1)),
    "-y": ((-1, -1, -1), (1, -1, -1), (1, -1, 1), (-1, -1, 1)),
    "+y": ((-1, 1, -1), (-1, 1, 1), (1, 1, 1), (1, 1, -1)),
    "-z": ((-1, -1, -1), (-1, 1, -1), (1, 1, -1), (1, -1, -1)),
    "+z": ((-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)),
}


def mesh(vertices: Float[np.ndarray, "v 3"], faces: ArrayLike) -> trimesh.Trimesh:
    """Build a mesh exactly as given, with equal vertices merged, nothing reordered or repaired."""
    result = trimesh.Trimesh(np.asarray(vertices, float), np.asarray(faces), process=False)
    result.merge_vertices(digits_vertex=9)
    return result


def exact(vertices: ArrayLike, faces: ArrayLike) -> trimesh.Trimesh:
    """Build a mesh of vertices that are known to be different."""
    return trimesh.Trimesh(np.asarray(vertices, float), np.array(faces), process=False)


def box(center: Vector, size: Vector, without: tuple[str, ...] = ()) -> trimesh.Trimesh:
    """Axis-aligned box, `without` some of its faces (``"-x"``, ``"+x"``, ... ``"+z"``)."""
    corners, faces = _box_without(tuple(without))
    return exact(np.asarray(center, float) + 0.5 * np.asarray(size, float) * corners, faces)


@cache
def _box_without(without: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Signs of the corners and triangles of a box without some faces."""
    signs = np.array([c for face, signs in _FACES.items() if face not in without for c in signs], float)
    corners, number = np.unique(signs, axis=0, return_inverse=True)
    quads = number.reshape(-1, 4)
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def span(low: Vector, high: Vector, without: tuple[str, ...] = ()) -> trimesh.Trimesh:
    """Axis-aligned box between two corners."""
    begin, end = np.asarray(low, float), np.asarray(high, float)
    return box((begin + end) / 2, end - begin, without)


def rectangle(center: Vector, size: tuple[float, float], facing: Vector) -> trimesh.Trimesh:
    """Rectangle of (width, height) whose normal is `facing`.

    Height runs as close to vertical as the plane allows; if it is horizontal, height runs along y and width along x.
    """
    normal = np.asarray(facing, float) / np.linalg.norm(facing)
    if abs(normal[2]) > 0.999:
        up = np.array([0.0, 1.0, 0.0])
    else:
        up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
        up /= np.linalg.norm(up)
    across = np.cross(up, normal)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5 * np.asarray(size, float)
    return exact(np.asarray(center, float) + corners @ np.stack([across, up]), [[0, 1, 2], [0, 2, 3]])


def cylinder(
    center: Vector, radius: float, height: float, sides: int = 12, without: tuple[str, ...] = ()
) -> trimesh.Trimesh:
    """Vertical prism with `sides` facets around, `without` its lower (``"-z"``) or upper (``"+z"``) cap."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(sides, -height / 2)])
    vertices = np.concatenate([low, low + [0, 0, height]]) + np.asarray(center, float)
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    faces = [np.stack([i, j, j + sides], 1), np.stack([i, j + sides, i + sides], 1)]
    fan = np.stack([np.zeros(sides - 2, int), np.arange(1, sides - 1), np.arange(2, sides)], 1)
    if "+z" not in without:
        faces.append(fan + sides)
    if "-z" not in without:
        faces.append(fan[:, ::-1])
    return exact(vertices, np.concatenate(faces))


def sphere(center: Vector, radius: float, subdivisions: int = 3) -> trimesh.Trimesh:
    """Icosphere of a radius, m."""
    result = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    result.apply_translation(center)
    return result


def polygon(
    outline: Polygon,
    origin: Vector = (0, 0, 0),
    u: Vector = (1, 0, 0),
    v: Vector = (0, 1, 0),
) -> trimesh.Trimesh:
    """Planar polygon, holes included: the point (a, b) of `outline` lies at origin + a u + b v, the normal is u x v."""
    flat, faces = trimesh.creation.triangulate_polygon(shapely.geometry.polygon.orient(outline), engine="earcut")
    a, b, c = (flat[faces[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    faces = np.where(turn[:, None] < 0, faces[:, ::-1], faces)[np.abs(turn) > 1e-12]
    return mesh(np.asarray(origin, float) + flat @ np.array([u, v], float), faces)


def placed(
    shape: trimesh.Trimesh,
    position: Vector = (0, 0, 0),
    rotation: Vector = (0, 0, 0),
) -> trimesh.Trimesh:
    """Copy, rotated by roll, pitch, yaw (rad; about x, then y, then z) about the origin and moved to `position`."""
    turn = Rotation.from_euler("xyz", rotation).as_matrix()
    return trimesh.Trimesh(shape.vertices @ turn.T + np.asarray(position, float), shape.faces.copy(), process=False)


def joined(*shapes: trimesh.Trimesh) -> trimesh.Trimesh:
    """Join several meshes to one."""
    offsets = np.cumsum([0] + [len(s.vertices) for s in shapes[:-1]])
    faces = [s.faces + offset for s, offset in zip(shapes, offsets, strict=True)]
    return trimesh.Trimesh(np.concatenate([s.vertices for s in shapes]), np.concatenate(faces), process=False)


def areas(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n"]:
    """Areas of triangles, m^2."""
    sides = triangles[:, 1:] - triangles[:, :1]
    return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2


def scattered(corners: Float[np.ndarray, "n 3 3"], rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Draw a random point on each of some triangles, m."""
    share = rng.random((len(corners), 2))
    share[share.sum(axis=1) > 1] = 1 - share[share.sum(axis=1) > 1]  # the other half of the parallelogram
    return corners[:, 0] + np.einsum("nk,nkd->nd", share, corners[:, 1:] - corners[:, :1])


def loose(triangles: Float[np.ndarray, "t 3 3"]) -> trimesh.Trimesh:
    """Mesh of triangles that share no corners."""
    return trimesh.Trimesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False)


def closest(
    triangles: Float[np.ndarray, "t 3 3"], points: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
    """Distance from points to the nearest of some triangles, m, and its index."""
    world, tensor = tested(triangles)
    query = np.asarray(points, np.float32)
    found = world.compute_closest_points(tensor(query))
    distance = np.linalg.norm(found["points"].numpy() - query, axis=1).astype(float)
    return distance, found["primitive_ids"].numpy().astype(np.int64)


def tested(triangles: Float[np.ndarray, "t 3 3"]) -> tuple[Any, Callable[[np.ndarray], Any]]:
    """Open3D's ray and distance tests on triangles, and the function that makes their tensors."""
    import open3d

    world, tensor = open3d.t.geometry.RaycastingScene(), open3d.core.Tensor.from_numpy
    mesh = loose(triangles)
    world.add_triangles(tensor(mesh.vertices.astype(np.float32)), tensor(mesh.faces.astype(np.uint32)))
    return world, tensor
