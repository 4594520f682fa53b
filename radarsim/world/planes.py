"""Flat regions of a mesh, noisy scans included, and the quadrilaterals that cover them.

A scanned wall is thousands of triangles with errors of a millimetre and a few degrees. Each by itself would be a mirror
with another direction, and the wall would scatter diffusely. So neighbouring triangles are joined as long as they are
near one plane, and the region reflects as that plane. The residual, the distance of the corners from the plane, is an
artefact of scanning (half a millimetre RMS would cost 11 dB as roughness) that cannot be distinguished from true
roughness by its size; true roughness is the material's, so the residual is ignored. In regions that bend within a
Fresnel zone only the exactly flat parts are planes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
import trimesh
from jaxtyping import Bool, Float, Int
from numba import njit

#: Largest distance of a region's corners from its plane, m: six times the 0.5 mm RMS of a good scan.
OFFSET = 3e-3
#: Largest angle of a region's normals, cosine of 12 deg: below the step of a 24-sided column.
ASKEW = np.cos(np.deg2rad(12))
#: Radius of curvature below which a region bends by more than lambda / 8 in a Fresnel zone at 2 m, m.
STRAIGHT = 2.0
#: Fraction of its bounding rectangle from which a region is replaced by it, unless it is one trapezoid: leaning walls
#: fill all but a thousandth, and must meet without overlap. Other regions are cut into strips.
SMALLEST_FILL, EXACT_FILL = 0.97, 1 - 1e-6
#: Largest relative change of area by straightening an outline.
LOSS = 0.01
#: Grid step of outlines, m. Regions narrower than ten steps are left out.
GRID = 1e-6


@dataclass(frozen=True)
class Plate:
    """Flat convex quadrilateral, of which two corners may coincide, and a large rectangle in it.

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


class _Triangles(NamedTuple):
    """Triangles of one region, or of several regions of equal number.

    Attributes:
        corners, center: m.
        normal: unit vectors.
        area: m^2.
        number: of the corners in their mesh.
    """

    corners: Float[np.ndarray, "*region face 3 3"]
    normal: Float[np.ndarray, "*region face 3"]
    area: Float[np.ndarray, "*region face"]
    center: Float[np.ndarray, "*region face 3"]
    number: Int[np.ndarray, "*region face 3"]

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> "_Triangles":
        """All triangles of a mesh."""
        return cls(mesh.triangles, mesh.face_normals, mesh.area_faces, mesh.triangles_center, np.asarray(mesh.faces))

    def take(self, index: Int[np.ndarray, "*region face"]) -> "_Triangles":
        """Select some triangles."""
        return _Triangles(*(column[index] for column in self))


def plates(mesh: trimesh.Trimesh, among: Bool[np.ndarray, "face"], smallest: float) -> list[Plate]:
    """Cover the flat regions of a mesh by quadrilaterals; arguments as for `plates_of_each`."""
    return plates_of_each([(mesh, among)], smallest)[0]


def plates_of_each(
    meshes: Sequence[tuple[trimesh.Trimesh, Bool[np.ndarray, "face"]]], smallest: float
) -> list[list[Plate]]:
    """Cover the flat regions of each mesh by quadrilaterals.

    Args:
        meshes: triangles that share corners where they join, and the mask of those to use.
        smallest: smallest area of a region, m^2.
    """
    taken = [m if among.all() else trimesh.Trimesh(m.vertices, m.faces[among], process=False) for m, among in meshes]
    triangles = _Triangles(*map(np.concatenate, zip(*map(_Triangles.of, taken), strict=True)))
    first = np.cumsum([0, *(len(mesh.faces) for mesh in taken)])
    found = [(k, first[k] + faces) for k, mesh in enumerate(taken) for faces in regions(mesh)]
    found = [(k, faces) for k, faces in found if triangles.area[faces].sum() >= smallest]
    counts = np.array([len(faces) for _, faces in found], int)
    covers: list[list[Plate]] = [[] for _ in found]
    for count in np.unique(counts):  # regions of as many triangles together
        some = np.flatnonzero(counts == count)
        for k, plate in _cover(triangles.take(np.stack([found[k][1] for k in some]))):
            covers[some[k]].append(plate)
    per_mesh: list[list[Plate]] = [[] for _ in meshes]
    for (k, _), cover in zip(found, covers, strict=True):
        per_mesh[k] += cover
    return per_mesh


def regions(mesh: trimesh.Trimesh) -> list[Int[np.ndarray, "face"]]:
    """Groups of neighbouring triangles near one plane, by index, those with the largest triangles first."""
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
    """Region index of each triangle. A region's plane is the area-weighted mean of its triangles so far."""
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


def _plane(some: _Triangles) -> tuple[Float[np.ndarray, "*region 3"], Float[np.ndarray, "*region 3"]]:
    """Unit normal of each region and a point on its plane: means over its area."""
    area = some.area[..., None]
    return _unit((area * some.normal).sum(axis=-2)), (area * some.center).sum(axis=-2) / area.sum(axis=-2)


def _frame(normal: Float[np.ndarray, "*region 3"]) -> Float[np.ndarray, "*region 2 3"]:
    """Two directions in each plane, the first one horizontal if possible."""
    u = np.cross([0.0, 0.0, 1.0], normal)
    lying = np.sqrt(np.vecdot(u, u)) < 1e-6
    u = _unit(np.where(lying[..., None], [1.0, 0.0, 0.0], u))
    return np.stack([u, np.cross(normal, u)], axis=-2)


def _unit(vectors: Float[np.ndarray, "*region 3"]) -> Float[np.ndarray, "*region 3"]:
    return vectors / np.sqrt(np.vecdot(vectors, vectors))[..., None]


def _bends(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "face"]) -> bool:
    """Whether a paraboloid through the corners of a region has a significant curvature for a radar."""
    if len(faces) < 5:  # n triangles that join have n + 2 corners at most
        return False
    corners = np.unique(mesh.faces[faces])
    if len(corners) < 7:
        return False
    normal, center = _plane(_Triangles.of(mesh).take(faces))
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


def _cover(some: _Triangles) -> Iterator[tuple[int, Plate]]:
    """Quadrilateral of each region, or trapezoids that add up to it, and the index of the region."""
    normal, center = _plane(some)
    axes = _frame(normal)
    flat = (some.corners - center[:, None, None]) @ axes[:, None].swapaxes(2, 3)
    outlines = shapely.minimum_rotated_rectangle(shapely.multipoints(flat.reshape(len(flat), -1, 2)))
    region = np.flatnonzero(shapely.get_type_id(outlines) == shapely.GeometryType.POLYGON)
    outline = shapely.get_coordinates(outlines[region]).reshape(-1, 5, 2)
    sides = np.diff(outline[:, :3], axis=1)
    lengths = np.linalg.norm(sides, axis=2)
    wide = lengths.min(axis=1) >= 10 * GRID
    region, outline, sides, lengths = region[wide], outline[wide], sides[wide], lengths[wide]
    u = sides[:, 0] / lengths[:, :1]
    turn = np.stack([u, np.stack([-u[:, 1], u[:, 0]], axis=1)], axis=1)
    flat, outline = flat[region] @ turn[:, None].swapaxes(2, 3), outline @ turn.swapaxes(1, 2)
    fill = some.area[region].sum(axis=1) / lengths.prod(axis=1)
    rectangle, (single, trapezoid) = _rectangles(outline), _lone_trapezoids(flat, some.number[region])
    rows = zip(fill, flat, rectangle, single, trapezoid, strict=True)
    quads = [
        [whole] if f >= EXACT_FILL else [lone] if f >= SMALLEST_FILL and is_one else _strips(f, parts, whole)
        for f, parts, whole, is_one, lone in rows
    ]
    owner = np.repeat(np.arange(len(quads)), [len(each) for each in quads])
    quad = np.reshape([q for each in quads for q in each], (-1, 4, 2))
    uv, region = (turn @ axes[region])[owner], region[owner]
    x0, y0, x1, y1 = inner_rectangle(quad).T[..., None]
    middle = center[region] + (x0 + x1) / 2 * uv[:, 0] + (y0 + y1) / 2 * uv[:, 1]
    half = np.concatenate([x1 - x0, y1 - y0], axis=1) / 2
    columns = center[region, None] + quad @ uv, middle, normal[region], uv[:, 0], uv[:, 1], half
    return ((k, Plate(*row)) for k, *row in zip(region.tolist(), *columns, strict=True))


def _strips(
    fill: float, triangles: Float[np.ndarray, "face 3 2"], rectangle: Float[np.ndarray, "4 2"]
) -> list[Float[np.ndarray, "4 2"]]:
    """Trapezoids that add up to triangles, or the rectangle around them if they fill it."""
    quads = trapezoids(_smoothed(shapely.union_all(shapely.polygons(triangles), grid_size=GRID)))
    return [rectangle] if fill >= SMALLEST_FILL and len(quads) != 1 else quads


def _rectangles(points: Float[np.ndarray, "n point 2"]) -> Float[np.ndarray, "n 4 2"]:
    """Upright rectangles around points."""
    (x0, y0), (x1, y1) = points.min(axis=1).T, points.max(axis=1).T
    return np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=1).reshape(-1, 4, 2)


def _lone_trapezoids(
    flat: Float[np.ndarray, "n face 3 2"], number: Int[np.ndarray, "n face 3"]
) -> tuple[Bool[np.ndarray, "n"], Float[np.ndarray, "n 4 2"]]:
    """Mask of convex regions of two triangles that make one trapezoid, and the result of `trapezoids` for each.

    Nearly all faces of furniture in rooms that are not quite square are such; with arrays this is 20 times as fast.

    Args:
        flat: corners in the plane, m.
        number: of the corners.
    """
    if flat.shape[1] != 2:
        return np.zeros(len(flat), bool), np.zeros((len(flat), 4, 2))
    apart = ~(number[:, 1, :, None] == number[:, 0, None]).any(axis=2)
    fourth = np.take_along_axis(flat[:, 1], apart.argmax(axis=1)[:, None, None], axis=1)
    quad = np.floor(np.concatenate([flat[:, 0], fourth], axis=1) * (1 / GRID) + 0.5) / (1 / GRID)
    (along_x, found), (along_y, other) = _between_levels(quad), _between_levels(quad[:, :, ::-1])
    found = np.where(along_x[:, None, None], found, other[:, :, ::-1])
    return (along_x | along_y) & (apart.sum(axis=1) == 1), found


def _between_levels(quad: Float[np.ndarray, "n 4 2"]) -> tuple[Bool[np.ndarray, "n"], Float[np.ndarray, "n 4 2"]]:
    """Mask of convex quadrilaterals with two corners at one y and two at another, and these as in `_trapezoids`."""
    quad = np.take_along_axis(quad, quad[:, :, 1].argsort(axis=1)[:, :, None], axis=1)
    steps = np.diff(quad[:, :, 1], axis=1) > GRID
    low, high = quad[:, :1, 1], quad[:, 2:3, 1]
    ends = quad.reshape(-1, 2, 2, 2)  # of the left and the right side, below and above
    ends = np.take_along_axis(ends, ends[..., :1].argsort(axis=2), axis=2)
    (x0, y0), (x1, y1) = np.moveaxis(ends, (1, 3), (0, 1))
    rise = np.where(steps[:, 1:2], y1 - y0, 1.0)
    (a, b), (d, c) = ((x0 + ((y - y0) / rise).clip(0, 1) * (x1 - x0)).T for y in (low, high))
    low, high = low[:, 0], high[:, 0]
    found = np.stack([a, low, b, low, c, high, d, high], axis=1).reshape(-1, 4, 2)
    return (steps == [False, True, False]).all(axis=1), found


def _smoothed(region: shapely.Geometry) -> shapely.Geometry:
    """Straighten the outline of a region, unless that changes more than `LOSS` of its area."""
    tolerances = OFFSET / 2.0 ** np.arange(12)
    coarse = (shapely.simplify(region, tolerance) for tolerance in tolerances)
    return next((found for found in coarse if abs(found.area - region.area) < LOSS * region.area), region)


def trapezoids(region: shapely.Geometry) -> list[Float[np.ndarray, "4 2"]]:
    """Divide a region, holes respected, into disjoint trapezoids parallel to x or to y, whichever gives fewer.

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


def inner_rectangle(quad: Float[np.ndarray, "*n 4 2"]) -> Float[np.ndarray, "*n 4"]:
    """x0 y0 x1 y1 of a large axis-aligned rectangle in each trapezoid: of full height, or half the height at either
    end.

    Half a triangle's area is the maximum of an inscribed rectangle.
    """
    flip = (np.abs(quad[..., 1, 1] - quad[..., 0, 1]) > 1e-9)[..., None]  # its parallel sides run along y
    x, y = np.moveaxis(np.where(flip[..., None], quad[..., ::-1], quad), (-1, -2), (0, 1))
    best, most = np.zeros((*flip.shape[:-1], 4)), np.zeros(flip.shape)
    for begin, end in ((0.0, 1.0), (0.0, 0.5), (0.5, 1.0)):
        left = np.maximum(x[0] + begin * (x[3] - x[0]), x[0] + end * (x[3] - x[0]))
        right = np.minimum(x[1] + begin * (x[2] - x[1]), x[1] + end * (x[2] - x[1]))
        y0, y1 = y[0] + begin * (y[2] - y[0]), y[0] + end * (y[2] - y[0])
        area = ((right - left) * (y1 - y0))[..., None]
        best = np.where(area > most, np.stack([left, y0, right, y1], axis=-1), best)
        most = np.maximum(area, most)
    return np.where(flip, best[..., [1, 0, 3, 2]], best)
