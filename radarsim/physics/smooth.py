"""Smooth curved pieces of a mesh, with the normals and curvatures of the surface that its triangles stand for.

A tessellated surface is known at its corners. Its normals there follow from the edges: chords of a circle leave one end
at the angle at which they arrive at the other, (n_a + n_b) . (b - a) = 0, which cylinders and spheres of any
tessellation fulfil, and other smooth surfaces to third order. These equations of all edges are solved by least squares
next to the means of triangles' normals after Max (J. Graphics Tools 4(2), 1999), so that they hold at borders, too. How
normals turn over a triangle is its curvature. Over a triangle the surface is a quadric (`patches`).

Triangles that hardly bend stay flat. A piece ends at creases, and where curvature jumps: where a pipe goes over into
its rounded end there is an end of the pipe and one of the rounding, which cancel but for what physical optics leaves.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse.linalg import lsmr

from radarsim.physics.planes import STRAIGHT, regions

#: Neighbouring triangles that turn by less are of one surface, rad: the step of a column of 18 sides and more.
CREASE = np.deg2rad(21)
#: Those that turn by less are coplanar, rad.
COPLANAR = np.deg2rad(0.3)
#: A piece has at least this many facets: fewer are a bend between plates.
FEWEST = 4
#: Neighbouring triangles are of one piece if their principal curvatures differ by less than this share.
LIKE = 0.5
#: Weight of means of normals beside edges' equations.
WRONG, ROUNDS = 0.005, 6


@dataclass(frozen=True)
class Piece:
    """A smooth surface over some triangles of a mesh.

    Attributes:
        place: corners, m.
        normal: unit vectors at the corners, outwards as the triangles have it.
        curvature: at the corners, how the normal turns along the surface, 1/m: xx, xy, xz, yy, yz, zz of a symmetric
            tensor; positive where it is convex.
        faces: corners of triangles, counter-clockwise.
        across: the triangle beyond the side opposite each corner; -1: none.
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
    """Smooth curved pieces of a mesh, and which of its triangles they take.

    Args:
        mesh: triangles that share corners where they join.
        among: which triangles to take.
        smallest: pieces of less area are left out, m^2.
    """
    found, taken = [], np.zeros(len(mesh.faces), bool)
    joins = (mesh.face_adjacency_angles < CREASE) & among[mesh.face_adjacency].all(axis=1)
    if not np.any(joins & (mesh.face_adjacency_angles > COPLANAR)):
        return found, taken
    pairs = mesh.face_adjacency[joins]
    surface = trimesh.graph.connected_component_labels(pairs, len(mesh.faces))
    corners, normals = _normals(mesh, surface)
    tensor, bend = _curvature(mesh, normals[corners])
    bent = among & ~_nearly_flat(mesh, among) & (np.abs(bend).max(axis=1) * STRAIGHT > 1)
    one, two = bend[pairs].transpose(1, 0, 2)
    size = np.maximum(np.abs(one).max(axis=1), np.abs(two).max(axis=1))
    like = bent[pairs].all(axis=1) & (np.abs(one - two).max(axis=1) < LIKE * size)
    like &= (_kind(one) == _kind(two)).all(axis=1)
    for faces in trimesh.graph.connected_components(pairs[like], nodes=np.flatnonzero(bent), min_len=FEWEST):
        facets = np.unique(mesh.face_normals[faces].round(3), axis=0)
        if len(facets) >= FEWEST and mesh.area_faces[faces].sum() >= smallest:
            found.append(_piece(mesh, faces, pairs, (corners[faces], normals, tensor[faces])))
            taken[faces] = True
    return found, taken


def _nearly_flat(mesh, among) -> Bool[np.ndarray, "face"]:
    """Triangles of uneven planes, as a scan has them."""
    rows, flat = np.flatnonzero(among), np.zeros(len(mesh.faces), bool)
    for faces in regions(trimesh.Trimesh(mesh.vertices, mesh.faces[rows], process=False)):
        if len(np.unique(mesh.faces[rows[faces]])) > 6:
            flat[rows[faces]] = np.ptp(mesh.face_normals[rows[faces]], axis=0).max() > COPLANAR
    return flat


def _normals(mesh, surface) -> tuple[Int[np.ndarray, "face 3"], Float[np.ndarray, "corner 3"]]:
    """Corners of each triangle, one each for every surface that meets there, and unit normals at them."""
    key = surface[:, None] * len(mesh.vertices) + mesh.faces
    _, corners = np.unique(key, return_inverse=True)
    corners, place = corners.reshape(-1, 3), mesh.triangles
    mean = np.zeros((corners.max() + 1, 3))
    for k in range(3):
        after, before = place[:, (k + 1) % 3] - place[:, k], place[:, k - 1] - place[:, k]
        square = np.sum(after**2, axis=1) * np.sum(before**2, axis=1)
        np.add.at(mean, corners[:, k], np.cross(after, before) / np.maximum(square, 1e-300)[:, None])
    mean = _unit(mean)
    sides = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    sides, which = np.unique(sides, axis=0, return_index=True)
    chord = _unit((np.roll(place, -1, axis=1) - place).reshape(-1, 3)[which])
    columns = 3 * sides[:, :, None] + np.arange(3)
    rows = np.broadcast_to(np.arange(len(sides))[:, None, None], columns.shape)
    values = np.broadcast_to(chord[:, None], columns.shape)
    chords = scipy.sparse.csr_array((values.ravel(), (rows.ravel(), columns.ravel())), (len(sides), mean.size))
    change = np.zeros_like(mean)
    for _ in range(ROUNDS):  # what has to change much is not held to its mean
        anchor = 1 / (1 + np.sum(change**2, axis=1) / WRONG**2)
        equations = scipy.sparse.vstack([chords, scipy.sparse.diags_array(anchor.repeat(3))])
        off = np.append(chords @ mean.ravel(), np.zeros(mean.size))
        change = lsmr(equations, -off, maxiter=200)[0].reshape(-1, 3)
    return corners, _unit(mean + change)


def _curvature(mesh, normal) -> tuple[Float[np.ndarray, "face 3 3"], Float[np.ndarray, "face 2"]]:
    """How normals turn over each triangle: the tensor, 1/m, and the two principal curvatures, the lower one first.

    Args:
        mesh: the triangles.
        normal: at their corners, (face, corner, 3).
    """
    place = mesh.triangles
    u = _unit(place[:, 1] - place[:, 0])
    axes = np.stack([u, np.cross(mesh.face_normals, u)], axis=1)
    sides, turns = (np.einsum("fad,fkd->fak", axes, x[:, 1:] - x[:, :1]) for x in (place, normal))
    flat = np.abs(np.linalg.det(sides)) < 1e-12
    sides[flat] = np.eye(2)
    tensor = turns @ np.linalg.inv(sides)
    tensor[flat] = 0.0
    tensor = (tensor + tensor.transpose(0, 2, 1)) / 2
    return np.einsum("fad,fab,fbe->fde", axes, tensor, axes), np.linalg.eigvalsh(tensor)


def _kind(bend: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "n 2"]:
    """Whether principal curvatures are convex (1), concave (-1) or, beside the other one, nothing."""
    return np.sign(np.where(np.abs(bend) < 0.15 * np.abs(bend).max(axis=1, keepdims=True), 0, bend)).astype(int)


def _piece(mesh, faces, pairs, surface) -> Piece:
    """The piece of some triangles; of the whole mesh which join, of these corners and tensors, and all normals."""
    corners, normals, tensor = surface
    used, first, own = np.unique(corners, return_index=True, return_inverse=True)
    own = own.reshape(-1, 3)
    number = np.full(len(mesh.faces), -1)
    number[faces] = np.arange(len(faces))
    joined = number[pairs]
    joined = joined[(joined >= 0).all(axis=1)]
    across = np.full((len(faces), 3), -1)
    for one, two in (joined.T, joined[:, ::-1].T):
        opposite = ~(own[one][:, :, None] == own[two][:, None]).any(axis=2)
        across[one, opposite.argmax(axis=1)] = two
    ends, side = np.nonzero(across < 0)
    border = np.stack([own[ends, (side + 1) % 3], own[ends, (side + 2) % 3]], axis=1)
    summed, area = np.zeros((len(used), 3, 3)), np.zeros(len(used))
    for k in range(3):
        np.add.at(summed, own[:, k], mesh.area_faces[faces, None, None] * tensor)
        np.add.at(area, own[:, k], mesh.area_faces[faces])
    curvature = (summed / area[:, None, None]).reshape(-1, 9)[:, [0, 1, 2, 4, 5, 8]]
    place = mesh.triangles[faces].reshape(-1, 3)[first]
    return Piece(place, normals[used], curvature, own, across, border)


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
