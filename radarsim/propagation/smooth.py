"""Smooth curved pieces of a mesh, with normals and curvatures of the surface that its triangles approximate.

A tessellated surface is exact at its corners. Its normals there follow from the edges: chords of a circle leave one end
at the angle at which they arrive at the other, (n_a + n_b) . (b - a) = 0, which holds exactly for cylinders and spheres
of any tessellation, and for other smooth surfaces to third order. These equations of all edges are solved by least
squares together with the means of triangles' normals after Max (J. Graphics Tools 4(2), 1999), so that they hold at
borders, too. The change of the normals over a triangle is its curvature. Noisy corners, as in scans, are first moved
onto a cubic through their neighbours (osculating jets, Cazals, Pouget, CAGD 22(2), 2005).

Triangles that hardly bend stay flat. A piece ends at creases, and where curvature is discontinuous: where a pipe joins
its rounded end, the end of the pipe and that of the rounding cancel except for the residual of physical optics.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse.linalg import lsmr
from scipy.spatial import cKDTree

from radarsim.world.planes import STRAIGHT, regions

#: Largest angle between neighbouring triangles of one surface, rad: that of a cylinder of 18 sides or more.
CREASE = np.deg2rad(21)
#: Largest angle between coplanar triangles, rad.
COPLANAR = np.deg2rad(0.3)
#: Smallest number of facets of a piece: fewer are a bend between plates.
FEWEST = 4
#: Largest relative difference of the principal curvatures of neighbouring triangles of one piece; a curvature above
#: this fraction of the other must have the same sign.
LIKE, LITTLE = 0.5, 0.15
#: Smallest area of an uneven plane, m^2; smaller areas remain between the regions of a curved surface.
UNEVEN = 0.01
#: Error of a mean normal, rad, above which its weight drops, and number of iterations that determine the weights.
WRONG, ROUNDS = 0.005, 6
#: RMS distance from a cubic through neighbours, m, above which corners are noisy, and number of neighbours.
NEIGHBOURS, NOISY = 32, 1e-5


class Piece(NamedTuple):
    """Smooth surface over some triangles of a mesh.

    Attributes:
        place: positions of the corners, m.
        normal: unit vectors at the corners, outwards as the triangles have it.
        curvature: at the corners, change of the normal along the surface, 1/m: xx, xy, xz, yy, yz, zz of a symmetric
            tensor; positive where it is convex.
        faces: corners of triangles, counter-clockwise.
        across: neighbouring triangle across the side opposite each corner; -1: none.
        border: sides of triangles where the piece ends, the surface on the left.
    """

    place: Float[np.ndarray, "corner 3"]
    normal: Float[np.ndarray, "corner 3"]
    curvature: Float[np.ndarray, "corner 6"]
    faces: Int[np.ndarray, "face 3"]
    across: Int[np.ndarray, "face 3"]
    border: Int[np.ndarray, "side 2"]


def pieces(
    mesh: trimesh.Trimesh, among: Bool[np.ndarray, "face"], smallest: float
) -> tuple[list[Piece], Bool[np.ndarray, "face"]]:
    """Find smooth curved pieces of a mesh, and the triangles that they replace.

    Args:
        mesh: triangles that share corners where they join.
        among: mask of triangles to use.
        smallest: smallest area of a piece, m^2.
    """
    found: list[Piece] = []
    taken = np.zeros(len(mesh.faces), bool)
    joins = (mesh.face_adjacency_angles < CREASE) & among[mesh.face_adjacency].all(axis=1)
    if not np.any(joins & (mesh.face_adjacency_angles > COPLANAR)):
        return found, taken
    joins &= ~_uneven(mesh, among)[mesh.face_adjacency].any(axis=1)
    rows, pairs = np.unique(mesh.face_adjacency[joins], return_inverse=True)
    pairs = pairs.reshape(-1, 2)
    if not len(rows):
        return found, taken
    place, normal, corners, tensor = _surfaces(mesh, rows, pairs)
    bend = _principal(tensor, place[corners])
    bent = np.abs(bend).max(axis=1) * STRAIGHT > 1
    one, two = bend[pairs].transpose(1, 0, 2)
    most = np.maximum(np.abs(one).max(axis=1), np.abs(two).max(axis=1))
    like = bent[pairs].all(axis=1) & (np.abs(one - two).max(axis=1) < LIKE * most)
    like &= (_sense(one) == _sense(two)).all(axis=1)
    groups = trimesh.graph.connected_components(pairs[like], nodes=np.flatnonzero(bent), min_len=FEWEST)
    number = np.full(len(mesh.faces), -1)
    number[rows] = np.arange(len(rows))
    beside = number[mesh.face_adjacency]
    beside = beside[(beside >= 0).all(axis=1)]
    piece = _filled(groups, beside, mesh.area_faces[rows])
    for k in range(len(groups)):
        faces = np.flatnonzero(piece == k)
        facets = np.unique(mesh.face_normals[rows[faces]].round(3), axis=0)
        if len(facets) >= FEWEST and mesh.area_faces[rows[faces]].sum() >= smallest:
            joined = np.searchsorted(faces, beside[(piece[beside] == k).all(axis=1)])
            found.append(_piece(place, normal, corners[faces], tensor[faces], joined))
            taken[rows[faces]] = True
    return found, taken


def _filled(
    groups: list[np.ndarray], pairs: Int[np.ndarray, "pair 2"], area: Float[np.ndarray, "face"]
) -> Int[np.ndarray, "face"]:
    """Group of each triangle, -1: none; isolated triangles between two of one group are added to it."""
    group = np.full(len(area), -1)
    for k, faces in enumerate(groups):
        group[faces] = k
    largest = np.array([area[faces].max() for faces in groups])
    for one, two in (np.concatenate([pairs, pairs[:, ::-1]]).T,) * 2:
        around = (group[one] < 0) & (group[two] >= 0) & (area[one] <= largest[group[two]] if len(groups) else False)
        beside, times = np.unique(np.stack([one, group[two]], axis=1)[around], axis=0, return_counts=True)
        face, own = beside[times > 1].T
        group[face] = own
    return group


def _uneven(mesh: trimesh.Trimesh, among: Bool[np.ndarray, "face"]) -> Bool[np.ndarray, "face"]:
    """Mask of triangles of uneven planes, as in scans."""
    rows, uneven = np.flatnonzero(among), np.zeros(len(mesh.faces), bool)
    for faces in regions(trimesh.Trimesh(mesh.vertices, mesh.faces[rows], process=False)):
        if mesh.area_faces[rows[faces]].sum() > UNEVEN and len(np.unique(mesh.faces[rows[faces]])) > 6:
            uneven[rows[faces]] = np.ptp(mesh.face_normals[rows[faces]], axis=0).max() > COPLANAR
    return uneven


def _surfaces(
    mesh: trimesh.Trimesh, rows: Int[np.ndarray, "face"], pairs: Int[np.ndarray, "pair 2"]
) -> tuple[
    Float[np.ndarray, "corner 3"], Float[np.ndarray, "corner 3"], Int[np.ndarray, "face 3"],
    Float[np.ndarray, "face 3 3"],
]:  # fmt: skip
    """Corners, separate for each surface that meets there, their unit normals, corners of the triangles, and
    curvatures.

    Args:
        mesh, rows: some triangles of a mesh.
        pairs: pairs of them that are on one surface.
    """
    surface = trimesh.graph.connected_component_labels(pairs, len(rows))
    triangles = mesh.triangles[rows]
    _, first, corners = np.unique(
        surface[:, None] * len(mesh.vertices) + mesh.faces[rows], return_index=True, return_inverse=True
    )
    place, corners = triangles.reshape(-1, 3)[first], corners.reshape(-1, 3)
    mean = np.zeros_like(place)
    for k in range(3):
        after, before = triangles[:, (k + 1) % 3] - triangles[:, k], triangles[:, k - 1] - triangles[:, k]
        square = np.sum(after**2, axis=1) * np.sum(before**2, axis=1)
        np.add.at(mean, corners[:, k], np.cross(after, before) / np.maximum(square, 1e-300)[:, None])
    mean = _unit(mean)
    sides = np.unique(np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]]).reshape(-1, 2), axis=0)
    normal = _by_chords(place, mean, sides)
    tensor = _turning(place[corners], normal[corners])
    fitted, jets = _jets(place, mean, surface[first // 3])
    if fitted.any():
        place, normal = (np.where(fitted[:, None], *both) for both in zip(jets[:2], (place, normal), strict=True))
        whole = fitted[corners].all(axis=1)
        tensor[whole] = jets[2][corners[whole]].mean(axis=1)
    return place, normal, corners, tensor


def _by_chords(
    place: Float[np.ndarray, "corner 3"], mean: Float[np.ndarray, "corner 3"], sides: Int[np.ndarray, "side 2"]
) -> Float[np.ndarray, "corner 3"]:
    """Normals near given means for which sides are chords of circles."""
    chord = _unit(place[sides[:, 1]] - place[sides[:, 0]])
    columns = 3 * sides[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(sides))[:, None, None], columns.shape)
    values = np.broadcast_to(chord[:, None], columns.shape)
    chords = scipy.sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), (len(sides), mean.size))
    off = np.append(chords @ mean.ravel(), np.zeros(mean.size))
    change = np.zeros_like(mean)
    for _ in range(ROUNDS):  # normals that must change much are not tied to their mean
        anchor = 1 / (1 + np.sum(change**2, axis=1) / WRONG**2)
        equations = scipy.sparse.vstack([chords, scipy.sparse.diags_array(anchor.repeat(3))])
        change = lsmr(equations, -off, maxiter=200)[0].reshape(-1, 3)
    most = np.maximum(np.linalg.norm(change, axis=1, keepdims=True) / (CREASE / 2), 1)
    return _unit(mean + change / most)


def _jets(place, normal, surface):
    """Mask of corners of noisy surfaces; and all positions, normals and tensors by cubics through neighbours."""
    if len(place) <= NEIGHBOURS:
        return np.zeros(len(place), bool), None
    away, near = cKDTree(place).query(place, NEIGHBOURS + 1)
    reach = away[:, -1:] + 1e-12
    u = _unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)]))
    axes = np.stack([u, np.cross(normal, u), normal], axis=1)
    x, y, z = np.einsum("cad,ckd->ack", axes, place[near] - place[:, None]) / reach
    weight = (1 - (away / reach) ** 2) * (surface[near] == surface[:, None])
    weight *= np.einsum("cd,ckd->ck", normal, normal[near]) > 0.5
    terms = np.stack([x**0, x, y, x * x / 2, x * y, y * y / 2, x**3, x * x * y, x * y * y, y**3], axis=2)
    square = np.einsum("cki,ck,ckj->cij", terms, weight, terms) + 1e-9 * np.eye(10)
    fit = np.linalg.solve(square, np.einsum("cki,ck,ck->ci", terms, weight, z)[..., None])[..., 0]
    rest = np.einsum("ck,ck->c", weight, (np.einsum("cki,ci->ck", terms, fit) - z) ** 2)
    rest = np.sqrt(rest / np.maximum(weight.sum(axis=1), 1e-9)) * reach[:, 0]
    # the quartic term of a circle beyond a cubic is not noise
    rest -= np.abs(fit[:, 3:6]).max(axis=1) ** 3 * reach[:, 0] / 40
    fitted = (weight > 0).sum(axis=1) > 15
    for one in np.unique(surface):
        fitted[surface == one] &= np.median(rest[surface == one]) > NOISY
    slope = _unit(normal - np.einsum("ca,cad->cd", fit[:, 1:3], axes[:, :2]))
    bend = -fit[:, [[3, 4], [4, 5]]] / reach[:, None]
    tensor = np.einsum("cad,cab,cbe->cde", axes[:, :2], bend, axes[:, :2])
    return fitted, (place + reach * fit[:, :1] * normal, slope, tensor)


def _turning(
    place: Float[np.ndarray, "face 3 3"], normal: Float[np.ndarray, "face 3 3"]
) -> Float[np.ndarray, "face 3 3"]:
    """Change of the normal over triangles, 1/m."""
    axes = _axes(place)
    sides, turns = (np.einsum("fad,fkd->fak", axes, x[:, 1:] - x[:, :1]) for x in (place, normal))
    nothing = np.abs(np.linalg.det(sides)) < 1e-12
    sides[nothing], turns[nothing] = np.eye(2), 0.0
    tensor = turns @ np.linalg.inv(sides)
    return np.einsum("fad,fab,fbe->fde", axes, (tensor + tensor.transpose(0, 2, 1)) / 2, axes)


def _principal(
    tensor: Float[np.ndarray, "face 3 3"], place: Float[np.ndarray, "face 3 3"]
) -> Float[np.ndarray, "face 2"]:
    """Principal curvatures in the planes of triangles, 1/m, the lower one first."""
    axes = _axes(place)
    return np.linalg.eigvalsh(np.einsum("fad,fde,fbe->fab", axes, tensor, axes))


def _axes(place: Float[np.ndarray, "face 3 3"]) -> Float[np.ndarray, "face 2 3"]:
    """Two unit vectors in the plane of each triangle."""
    u = _unit(place[:, 1] - place[:, 0])
    return np.stack([u, np.cross(_unit(np.cross(u, place[:, 2] - place[:, 0])), u)], axis=1)


def _sense(bend: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "n 2"]:
    """Sign of principal curvatures: convex (1), concave (-1) or, relative to the other one, negligible (0)."""
    return np.sign(np.where(np.abs(bend) < LITTLE * np.abs(bend).max(axis=1, keepdims=True), 0, bend)).astype(int)


def _piece(
    place: Float[np.ndarray, "corner 3"], normal: Float[np.ndarray, "corner 3"], corners: Int[np.ndarray, "face 3"],
    tensor: Float[np.ndarray, "face 3 3"], pairs: Int[np.ndarray, "pair 2"],
) -> Piece:  # fmt: skip
    """Build the piece of some triangles with these corners and tensors, and its connectivity."""
    used, own = np.unique(corners, return_inverse=True)
    own = own.reshape(-1, 3)
    across = np.full(own.shape, -1)
    for one, two in (pairs.T, pairs[:, ::-1].T):
        opposite = ~(own[one][:, :, None] == own[two][:, None]).any(axis=2)
        across[one, opposite.argmax(axis=1)] = two
    ends, side = np.nonzero(across < 0)
    border = np.stack([own[ends, (side + 1) % 3], own[ends, (side + 2) % 3]], axis=1)
    summed, area = np.zeros((len(used), 3, 3)), np.zeros(len(used))
    size = np.linalg.norm(
        np.cross(place[corners[:, 1]] - place[corners[:, 0]], place[corners[:, 2]] - place[corners[:, 0]]), axis=1
    )
    for k in range(3):
        np.add.at(summed, own[:, k], size[:, None, None] * tensor)
        np.add.at(area, own[:, k], size)
    curvature = (summed / area[:, None, None]).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
    return Piece(place[used], normal[used], curvature, own, across, border)


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)
