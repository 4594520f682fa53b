"""Flat regions of a mesh, scanned and noisy ones included, and the quadrilaterals that cover them.

A scanned wall is thousands of triangles that lie a millimetre off and a few degrees askew. Each by itself would be a
mirror that points somewhere else, and the wall would sparkle. So triangles join their neighbours as long as they stay
near one plane, and the region echoes as that plane. What is left over, the distance of the corners from the plane, is
an artefact of scanning (half a millimetre RMS would cost 11 dB as roughness), and not told apart from true roughness
by its size; true roughness is the material's, so the residual is left out of the response altogether. Regions that
bend within a Fresnel zone are no planes: of them only the exactly flat parts count.
"""

from dataclasses import dataclass

import numpy as np
import shapely
import trimesh
from jaxtyping import Bool, Float, Int
from numba import njit

#: Corners of a region's triangles are within this of its plane, m: six times the 0.5 mm RMS of a good scan.
OFFSET = 3e-3
#: Normals of a region's triangles are within this of its normal, cosine of 12 deg: below the step of a 24-sided column.
ASKEW = np.cos(np.deg2rad(12))
#: A region whose radius of curvature is below this bends by more than lambda / 8 in a Fresnel zone at 2 m, m.
STRAIGHT = 2.0
#: A region that fills this share of its bounding rectangle is taken for it, unless it is one trapezoid: walls that lean
#: fill all but a thousandth, and meet without an overlap. Other regions are cut into strips.
SMALLEST_FILL, EXACT_FILL = 0.97, 1 - 1e-6
#: Straightening an outline changes its area by less than this share.
LOSS = 0.01
#: Outlines are computed on a grid of this step, m. What is not ten steps wide is left out.
GRID = 1e-6


@dataclass(frozen=True)
class Plate:
    """A flat convex quadrilateral, of which two corners may fall together, and a large rectangle in it.

    Attributes:
        corners: in order around it, m.
        center, half: of the rectangle, half its side lengths, m; `half` is zero where there is none.
        normal, u, v: unit vectors, u and v along the rectangle's sides.
    """

    corners: Float[np.ndarray, "4 3"]
    center: Float[np.ndarray, "3"]
    normal: Float[np.ndarray, "3"]
    u: Float[np.ndarray, "3"]
    v: Float[np.ndarray, "3"]
    half: Float[np.ndarray, "2"]


def plates(mesh: trimesh.Trimesh, among: Bool[np.ndarray, "face"], smallest: float) -> list[Plate]:
    """Quadrilaterals that cover the flat regions of a mesh.

    Args:
        mesh: triangles that share corners where they join.
        among: which triangles to take.
        smallest: regions of less area are left out, m^2.
    """
    found = []
    if not among.all():
        mesh = trimesh.Trimesh(mesh.vertices, mesh.faces[among], process=False)
    for faces in regions(mesh):
        if mesh.area_faces[faces].sum() >= smallest:
            found += _cover(mesh, faces)
    return found


def regions(mesh: trimesh.Trimesh) -> list[Int[np.ndarray, "face"]]:
    """Groups of neighbouring triangles near one plane, by their numbers, those with the largest triangles first."""
    pairs = np.concatenate([mesh.face_adjacency, mesh.face_adjacency[:, ::-1]])
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    first = np.searchsorted(pairs[:, 0], np.arange(len(mesh.faces) + 1))
    seeds = np.argsort(-mesh.area_faces.round(9), kind="stable")
    label = _grow(
        seeds, first, np.ascontiguousarray(pairs[:, 1]), np.ascontiguousarray(mesh.triangles),
        np.ascontiguousarray(mesh.face_normals), np.ascontiguousarray(mesh.area_faces),
    )  # fmt: skip
    order = np.argsort(label, kind="stable")
    groups = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    return [part for faces in groups for part in (_flat_parts(mesh, faces) if _bends(mesh, faces) else [faces])]


@njit(cache=True)
def _grow(seeds, first, neighbours, triangles, normals, areas):
    """Region number of each triangle. A region's plane is the mean of its triangles so far, weighted by area."""
    label = np.full(len(triangles), -1)
    queue = np.empty(len(triangles), np.int64)
    regions = 0
    for seed in seeds:
        if label[seed] >= 0:
            continue
        label[seed] = regions
        queue[0], head, tail = seed, 0, 1
        normal, moment, area = normals[seed] * areas[seed], np.zeros(3), 0.0
        while head < tail:
            face = queue[head]
            head += 1
            area += areas[face]
            for corner in range(3):
                moment += triangles[face, corner] * (areas[face] / 3)
            if face != seed:
                normal += normals[face] * areas[face]
            n = normal / (np.sqrt(np.dot(normal, normal)) + 1e-300)
            level = np.dot(n, moment) / max(area, 1e-300)
            for other in neighbours[first[face] : first[face + 1]]:
                if label[other] >= 0 or np.dot(normals[other], n) < ASKEW:
                    continue
                near = True
                for corner in range(3):
                    near &= abs(np.dot(triangles[other, corner], n) - level) < OFFSET
                if near:
                    label[other] = regions
                    queue[tail] = other
                    tail += 1
        regions += 1
    return label


def _plane(
    mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Unit normal of a region and a point on its plane: means over its area."""
    area = mesh.area_faces[faces][:, None]
    normal = (area * mesh.face_normals[faces]).sum(axis=0)
    return normal / np.linalg.norm(normal), (area * mesh.triangles_center[faces]).sum(axis=0) / area.sum()


def _frame(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2 3"]:
    """Two directions in the plane, the first one horizontal where it can be."""
    u = np.cross([0.0, 0.0, 1.0], normal)
    u = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(u) < 1e-6 else u / np.linalg.norm(u)
    return np.stack([u, np.cross(normal, u)])


def _bends(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]) -> bool:
    """Whether a paraboloid through the corners of a region has a curvature that a radar would notice."""
    corners = np.unique(mesh.faces[faces])
    if len(corners) < 7:
        return False
    normal, center = _plane(mesh, faces)
    offset = mesh.vertices[corners] - center
    height = offset @ normal
    if np.abs(height).max() < 1e-4:
        return False
    a, b = offset @ _frame(normal).T[:, 0], offset @ _frame(normal).T[:, 1]
    scale = max(np.ptp(a), np.ptp(b))
    a, b = a / scale, b / scale
    _, _, _, aa, ab, bb = np.linalg.lstsq(np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], 1), height, 1e-9)[0]
    curvature = np.abs(np.linalg.eigvalsh([[2 * aa, ab], [ab, 2 * bb]])).max() / scale**2
    return bool(curvature * STRAIGHT > 1)


def _flat_parts(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]) -> list[Int[np.ndarray, "face"]]:
    """The exactly coplanar groups of triangles of a region, and its other triangles one by one."""
    inside = set(faces.tolist())
    groups = [np.array(group) for group in mesh.facets if inside.issuperset(group.tolist())]
    return groups + [np.array([face]) for face in sorted(inside.difference(*(g.tolist() for g in groups)))]


def _cover(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]) -> list[Plate]:
    """The quadrilateral that a region is, or trapezoids that add up to it."""
    normal, center = _plane(mesh, faces)
    axes = _frame(normal)
    flat = (mesh.triangles[faces] - center) @ axes.T
    outline = shapely.minimum_rotated_rectangle(shapely.MultiPoint(flat.reshape(-1, 2)))
    corners = shapely.get_coordinates(outline)
    sides = np.diff(corners[:3], axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    if len(corners) < 5 or lengths.min() < 10 * GRID:
        return []
    turn = sides[0] / lengths[0]
    turn = np.array([turn, [-turn[1], turn[0]]])
    fill, quads = mesh.area_faces[faces].sum() / lengths.prod(), []
    if fill < EXACT_FILL:
        quads = trapezoids(_smoothed(shapely.union_all(shapely.polygons(flat @ turn.T), grid_size=GRID)))
    if fill >= SMALLEST_FILL and len(quads) != 1:
        quads = [shapely.get_coordinates(shapely.transform(outline, lambda xy: xy @ turn.T).envelope)[:4]]
    u, v = turn @ axes
    found = []
    for quad in quads:
        x0, y0, x1, y1 = inner_rectangle(quad)
        middle = center + (x0 + x1) / 2 * u + (y0 + y1) / 2 * v
        half = np.array([x1 - x0, y1 - y0]) / 2
        found.append(Plate(center + quad @ np.stack([u, v]), middle, normal, u, v, half))
    return found


def _smoothed(region: shapely.Geometry) -> shapely.Geometry:
    """A region without what its outline's corners are off straight lines, unless that takes more than `LOSS` of it."""
    tolerances = OFFSET / 2.0 ** np.arange(12)
    coarse = (shapely.simplify(region, tolerance) for tolerance in tolerances)
    return next((found for found in coarse if abs(found.area - region.area) < LOSS * region.area), region)


def trapezoids(region: shapely.Geometry) -> list[Float[np.ndarray, "4 2"]]:
    """Disjoint trapezoids of the area of a region, holes respected, parallel to x or to y, whichever takes fewer.

    Cuts run through all corners, so straight edges are covered exactly.
    """
    along_x = _trapezoids(region)
    along_y = [quad[:, ::-1] for quad in _trapezoids(shapely.transform(region, lambda xy: xy[:, ::-1]))]
    return min(along_x, along_y, key=len)


def _trapezoids(region: shapely.Geometry) -> list[Float[np.ndarray, "4 2"]]:
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(region))]
    sides = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    sides = np.take_along_axis(sides, sides[:, :, 1].argsort(axis=1)[:, :, None], axis=1)  # upwards
    levels = np.unique(sides[:, :, 1])
    levels = levels[np.diff(levels, prepend=-np.inf) > GRID]
    (x0, y0), (x1, y1) = sides.transpose(1, 2, 0)
    thin, found = min(OFFSET / 2, LOSS / 2 * np.ptp(sides[:, :, 0])), []
    for low, high in zip(levels[:-1], levels[1:], strict=True):
        middle = (low + high) / 2
        through = (y0 <= middle) & (middle < y1)
        share = (np.array([[low], [middle], [high]]) - y0[through]) / (y1 - y0)[through]
        x = x0[through] + share.clip(0, 1) * (x1 - x0)[through]
        bottom, _, top = x[:, np.argsort(x[1])].reshape(3, -1, 2)  # the region lies between the 1st and 2nd side, ...
        for (a, b), (d, c) in zip(bottom, top, strict=True):
            if b - a + c - d > thin:
                found.append(np.array([[a, low], [b, low], [c, high], [d, high]]))
    return found


def inner_rectangle(quad: Float[np.ndarray, "4 2"]) -> tuple[float, float, float, float]:
    """x0 y0 x1 y1 of a large upright rectangle in a trapezoid: as high as it is, or half as high at either end.

    Half a triangle's area is the most that one can hold.
    """
    flip = abs(quad[1, 1] - quad[0, 1]) > 1e-9  # its parallel sides run along y
    (x0, low), (x1, _), (x2, high), (x3, _) = quad[:, ::-1] if flip else quad
    best = (0.0, 0.0, 0.0, 0.0)
    for begin, end in ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0)):
        left = max(x0 + begin * (x3 - x0), x0 + end * (x3 - x0))
        right = min(x1 + begin * (x2 - x1), x1 + end * (x2 - x1))
        y0, y1 = low + begin * (high - low), low + end * (high - low)
        if (right - left) * (y1 - y0) > (best[2] - best[0]) * (best[3] - best[1]):
            best = left, y0, right, y1
    return (best[1], best[0], best[3], best[2]) if flip else best
