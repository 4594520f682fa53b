"""Coherent echo of smooth curved surfaces: geometric optics at specular points, Fresnel's integral up to borders.

Where the path from the radar over a surface and back is stationary, physical optics is the wall's echo times a factor
from the path's Hessians (Deschamps, Proc. IEEE 60(9), 1972), with the principal radii a_1 and a_2 there

    lambda / (8 pi h) / sqrt((1 + h / a_1) (1 + h / a_2)),

far away sigma = pi a_1 a_2; beyond a caustic, where a factor is negative, its root has a phase of -90 deg. Borders
truncate the integral: with coordinates y in which the path's phase is pi |y|^2 / 2, it is (`apertures`)

    F = (1 / 2j) int exp(j pi |y|^2 / 2) dA = inside - (1 / 2 pi) closed int exp(j pi |y|^2 / 2) dphi.

Both hold if the specular point has left the piece: then it lies on the quadric that continues beyond the border, and F
fades. At a caustic the first factor grows as y shrinks, so an echo is at most that of its piece with uniform
phase: energy is conserved without a separate bound. Where the Hessian has both signs, F is taken with |y|^2 of equal
signs, which is exact in the middle, at a straight border and for small pieces.

Each piece has one specular point, because pieces have curvatures of one sign: their normals are all different.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from numba import njit

from radarsim.propagation.apertures import FAR, diffracted, side
from radarsim.propagation.curved import QUADRIC, SpecularPoints, grazes, stationary
from radarsim.propagation.fields import along, cross, dot, gain_towards, length, minus, unit, vec, write
from radarsim.propagation.media import HEAD_ON, LAYER
from radarsim.propagation.observation import Observation
from radarsim.propagation.smooth import Piece
from radarsim.propagation.table import filled

#: Number of a piece's corners from which the search for its specular point may start, and largest number of triangles
#: between the start and the triangle with the specular point.
STARTS, STEPS = 64, 512
#: Square of an angle between normals, rad^2, regarded as zero where no border is near.
BESIDE = 1e-4


class Patches(NamedTuple):
    """Pieces of smooth surfaces.

    Attributes:
        mesh: all pieces as one mesh; corners and triangles are numbered consecutively.
        home: a triangle of each corner.
        begin: first corner, triangle and side of each piece, and the end of the last.
        ball: centre and radius of a sphere around each, m.
        two_sided: sheets reflect on both sides.
        layer: see flat reflectors (`reflectors.Flat`).
    """

    mesh: Piece
    home: Int[np.ndarray, "corner"]
    begin: Int[np.ndarray, "piece+1 3"]
    ball: Float[np.ndarray, "piece 4"]
    two_sided: Bool[np.ndarray, "piece"]
    layer: Complex[np.ndarray, "piece 5"]

    @classmethod
    def of(cls, rows: list[tuple[Piece, bool, Complex[np.ndarray, "5"]]]) -> "Patches":
        """Build the table of pieces, each with whether it is two-sided and its layer."""
        pieces = [row[0] for row in rows]
        begin = np.cumsum([(0, 0, 0), *((len(p.place), len(p.faces), len(p.border)) for p in pieces)], axis=0)
        place, corners = np.zeros((0, 3)), np.zeros((0, 3), int)
        none = Piece(place, place, np.zeros((0, 6)), corners, corners, corners[:, :2])
        numbered = [
            p._replace(
                faces=p.faces + corner, across=np.where(p.across < 0, -1, p.across + face), border=p.border + corner
            )
            for p, (corner, face, _) in zip(pieces, begin, strict=False)
        ]
        mesh = Piece(*(np.concatenate(column) for column in zip(none, *numbered, strict=True)))
        middle = [(p.place.min(axis=0) + p.place.max(axis=0)) / 2 for p in pieces]
        ball = [(*m, np.linalg.norm(p.place - m, axis=1).max()) for p, m in zip(pieces, middle, strict=True)]
        home = np.zeros(len(mesh.place), int)
        home[mesh.faces] = np.arange(len(mesh.faces))[:, None]
        return cls(
            mesh, home, begin, np.reshape(ball, (-1, 4)), np.array([row[1] for row in rows], bool),
            np.reshape([row[2] for row in rows], (-1, LAYER)).astype(complex),
        )  # fmt: skip


def specular_points(observation: Observation, frame: int, patches: Patches) -> SpecularPoints:
    """Specular points of all pieces above the threshold in one frame."""
    return filled(
        SpecularPoints,
        lambda found: _specular_points(observation, frame, patches, found.columns),
        2 * len(patches.ball) + 1,
    )


@njit(cache=True)
def _specular_points(observation, frame, patches, found):
    """Return the number of specular points, of which as many as fit are written."""
    p, rotation, count = vec(observation.position[frame]), observation.rotation[frame], 0
    for k in range(len(patches.ball)):
        if length(minus(vec(patches.ball[k]), p)) - patches.ball[k, 3] > observation.range:
            continue
        for turn in range(2 if patches.two_sided[k] else 1):
            aim, quadric, place, value = strength(observation, patches, (k, 1.0 - 2.0 * turn), p, p)
            if abs(value) * observation.peak_gain**2 <= observation.threshold:
                continue
            value *= patches.layer[k, HEAD_ON] * gain_towards(minus(place, p), rotation, observation) ** 2
            if abs(value) <= observation.threshold:
                continue
            found.facet[count], found.amplitude[count] = -1, value
            write(aim, found.aim[count])
            shape = found.geometry[count]
            point, axis, normal, shape[11], shape[12] = quadric
            shape[0] = QUADRIC
            write(point, shape[1:4])
            write(axis, shape[4:7])
            write(normal, shape[8:11])
            count += 1
    return count


@njit(cache=True)
def strength(observation, patches, of, one, two):
    """Echo of one side of a piece between two places.

    Args:
        observation: range and wavelength.
        patches, of: the pieces; index of one, and 1.0 for the side of its normals, -1.0 for the other.
        one, two: m.

    Returns:
        End point of the visibility ray, m; the surface there (`curved.stationary`); the specular point, m; and the
            amplitude from one place to the other for an isotropic antenna.
    """
    k, turn = of
    face, weights, inside = _foot(patches, k, turn, one, two)
    aim, quadric = _surface(patches.mesh, face, turn, weights)
    place, way, hessian, plane = stationary(quadric, one, two)
    size = patches.ball[k, 3]
    if way > 2 * observation.range or grazes((place, quadric[2]), one, two, 0.05):
        return aim, quadric, place, 0j
    # Fresnel zones are no larger than the piece
    (high, first), (low, second) = _principal(hessian, quadric[1], cross(quadric[2], quadric[1]))
    least = observation.wavelength / (2 * size * size)
    high, low = _clamped(high, least), _clamped(low, least)
    elliptic = high * low > 0
    first = _scaled(np.sqrt(2 * abs(high) / observation.wavelength), first)
    second = _scaled(np.sqrt(2 * abs(low) / observation.wavelength), second)
    value = _fresnel(patches, of, (place, first, second, elliptic, inside), (one, two, way, observation.wavelength))
    if not elliptic:
        value = -1j * abs(value)
    elif high < 0:
        value = -np.conj(value)
    endless = plane[0] * plane[1] - plane[2] * plane[2]
    return aim, quadric, place, value * observation.wavelength / (4 * np.pi * way) * np.sqrt(endless / abs(high * low))


@njit
def _clamped(value, least):
    """Clamp the magnitude away from zero."""
    return value if abs(value) > least else (least if value >= 0 else -least)


@njit
def _scaled(scale, a):
    return scale * a[0], scale * a[1], scale * a[2]


@njit
def _principal(tensor, one, two):
    """Principal values, the larger one first, of a symmetric tensor (11, 22, 12) over two orthogonal directions, and
    their directions."""
    mean, half = (tensor[0] + tensor[1]) / 2, (tensor[0] - tensor[1]) / 2
    apart, angle = np.hypot(half, tensor[2]), 0.5 * np.arctan2(tensor[2], half)
    c, s = np.cos(angle), np.sin(angle)
    return (mean + apart, along(_scaled(c, one), s, two)), (mean - apart, along(_scaled(-s, one), c, two))


@njit
def _off(mesh, corner, turn, one, two):
    """Difference between the direction that bisects the angle and the normal at a corner."""
    place, normal = vec(mesh.place[corner]), vec(mesh.normal[corner])
    return along(unit(along(unit(minus(one, place)), 1.0, unit(minus(two, place)))), -turn, normal)


@njit(cache=True)
def _foot(patches, k, turn, one, two):
    """Triangle of a piece and weights of its corners where the normal best bisects the angle, and whether it does: a
    search from the best of some corners, across sides."""
    mesh, nearest, best, begin, end = patches.mesh, 9.0, 0, patches.begin[k, 0], patches.begin[k + 1, 0]
    for corner in range(begin, end, (end - begin) // STARTS + 1):
        off = _off(mesh, corner, turn, one, two)
        if dot(off, off) < nearest:
            nearest, best = dot(off, off), corner
    face, came = patches.home[best], -1
    holds, least, weights, circles = face, 9.0, (1.0, 0.0, 0.0), False
    for step in range(STEPS):
        off, others, shares = _nearest(mesh, face, turn, one, two)
        if off < least:
            least, weights, holds = off, others, face
        low, to = 0.0, -1
        for corner in range(3):  # across the side beyond which it lies, the farthest first
            if shares[corner] < low and mesh.across[face, corner] >= 0:
                low, to = shares[corner], mesh.across[face, corner]
        circles = to >= 0 and (to == came or step == STEPS - 1)
        if to < 0 or circles:
            break
        came, face = face, to
    if circles and least > 0:
        for face in range(patches.begin[k, 1], patches.begin[k + 1, 1]):
            off, others, _ = _nearest(mesh, face, turn, one, two)
            if off < least:
                least, weights, holds = off, others, face
    return holds, weights, least < BESIDE


@njit(cache=True)
def _nearest(mesh, face, turn, one, two):
    """Point of a triangle whose normal best bisects the angle: the square of the deviation; weights of the corners; and
    the weights if the triangle extended without limit."""
    a, b, c = mesh.faces[face]
    m = unit(along(along(vec(mesh.normal[a]), 1.0, vec(mesh.normal[b])), 1.0, vec(mesh.normal[c])))
    wa, wb, wc = (
        _off(mesh, a, turn, one, two), _off(mesh, b, turn, one, two), _off(mesh, c, turn, one, two)
    )  # fmt: skip
    seen = dot(wa, m) * turn > -1  # the angle is bisected from behind as well
    wa, wb, wc = along(wa, -dot(wa, m), m), along(wb, -dot(wb, m), m), along(wc, -dot(wc, m), m)
    ka, kb, kc = dot(cross(wb, wc), m), dot(cross(wc, wa), m), dot(cross(wa, wb), m)
    total = ka + kb + kc
    total = total if abs(total) > 1e-300 else 1e-300
    shares = ka / total, kb / total, kc / total
    if not seen:
        return 4.0, (1 / 3, 1 / 3, 1 / 3), shares
    if min(shares) >= 0:
        return 0.0, shares, shares
    ab, bc, ca = _on_side(wa, wb), _on_side(wb, wc), _on_side(wc, wa)
    if ab[0] <= bc[0] and ab[0] <= ca[0]:
        return ab[0], (1 - ab[1], ab[1], 0.0), shares
    if bc[0] <= ca[0]:
        return bc[0], (0.0, 1 - bc[1], bc[1]), shares
    return ca[0], (ca[1], 0.0, 1 - ca[1]), shares


@njit
def _on_side(one, two):
    """Square of the shortest vector between two, and its fraction of the way from one to the other."""
    way = minus(two, one)
    t = min(max(-dot(one, way) / (dot(way, way) + 1e-30), 0.0), 1.0)
    off = along(one, t, way)
    return dot(off, off), t


@njit(cache=True)
def _surface(mesh, face, turn, weights):
    """Point of a triangle as the end of visibility rays, m, and the surface there, see `curved.stationary`.

    The surface lies over the triangle as an arc lies over its chord: by (q - p_i) . n_i / (1 + n_i . n) from each
    corner, which any quadric has to second order and a circle half way precisely.
    """
    q, n, middle = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in range(3):
        corner = mesh.faces[face, i]
        q = along(q, weights[i], vec(mesh.place[corner]))
        n = along(n, turn * weights[i], vec(mesh.normal[corner]))
        middle = along(middle, 1 / 3, vec(mesh.place[corner]))
    n = unit(n)
    one = unit(cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.7 else (1.0, 0.0, 0.0)))
    two = cross(n, one)
    height, c11, c22, c12 = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        corner = mesh.faces[face, i]
        normal, c = vec(mesh.normal[corner]), mesh.curvature[corner]
        over = dot(minus(q, vec(mesh.place[corner])), normal) * turn
        height -= weights[i] * over / (1 + turn * dot(normal, n))
        rows, share = ((c[0], c[1], c[2]), (c[1], c[3], c[4]), (c[2], c[4], c[5])), turn * weights[i]
        on = dot(rows[0], one), dot(rows[1], one), dot(rows[2], one)
        beside = dot(rows[0], two), dot(rows[1], two), dot(rows[2], two)
        c11, c22, c12 = c11 + share * dot(on, one), c22 + share * dot(beside, two), c12 + share * dot(on, two)
    (bend1, axis), (bend2, _) = _principal((c11, c22, c12), one, two)
    quadric = along(q, height, n), axis, n, bend1, bend2
    return along(q, 0.02, minus(middle, q)), quadric


@njit(cache=True)
def _fresnel(patches, of, zones, way):
    """Factor on a piece's echo by the diffraction of its borders.

    Args:
        patches, of: see `strength`.
        zones: the specular point, m; axes in which places about it are Fresnel units, 1/m; whether the path is shortest
            or longest there; and whether it is inside, where no border is near.
        way: from where, to where, how long, and the wavelength, m.
    """
    (k, turn), mesh = of, patches.mesh
    total, nearest, left = 0j, FAR * FAR, 1.0 if zones[4] else -1.0
    for edge in range(patches.begin[k, 2], patches.begin[k + 1, 2]):
        a, b = mesh.border[edge]
        if turn < 0:
            a, b = b, a
        if _hidden(mesh, a, turn, way) and _hidden(mesh, b, turn, way):
            continue  # round the corner
        x0, y0 = _units(vec(mesh.place[a]), zones, way)
        x1, y1 = _units(vec(mesh.place[b]), zones, way)
        size = np.hypot(x1 - x0, y1 - y0)
        if size < 1e-12:
            continue
        s, begin, end = side(x0, y0, x1, y1, size)
        s = s if abs(s) > 1e-6 else 1e-6
        beyond = max(begin, -end, 0.0)
        far = s * s + beyond * beyond
        if far >= FAR * FAR:
            continue
        # of two sides that meet at the nearest corner, the one that is farther from being passed
        if far < nearest - 1e-9 * nearest or (far < nearest + 1e-9 * nearest and abs(s) > abs(left)):
            nearest, left = far, s
        total -= diffracted(s, begin, end)
    inside = 1.0 if left > 0 else 0.0
    return inside + total / (2 * np.pi)


@njit
def _hidden(mesh, corner, turn, way):
    return turn * dot(minus(way[0], vec(mesh.place[corner])), vec(mesh.normal[corner])) < 0


@njit
def _units(place, zones, way):
    """Offset from the specular point in Fresnel units: direction on its quadric, length by path difference."""
    middle, first, second, elliptic, _ = zones
    one, two, least, wavelength = way
    offset = minus(place, middle)
    x, y = dot(offset, first), dot(offset, second)
    square = x * x + y * y
    longer = 4 * abs(length(minus(one, place)) + length(minus(two, place)) - least) / wavelength
    scale = np.sqrt(max(longer / (square + 1e-18), 0.5 if elliptic else 1.0))
    return x * scale, y * scale
