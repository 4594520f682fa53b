"""Diffraction by apertures on a path, in Fresnel units: Kirchhoff's integral over polygons and rectangles."""

import numpy as np
from jaxtyping import Complex, Float
from numba import njit

from radarsim.propagation.fields import dot, minus, vec

#: Distance of an edge from the path, in Fresnel units, from which its part of the sum fades, and from which it is left
#: out: the edge diffracts along a path of its own, longer by s^2 lambda / 4.
FADE, FAR = 3.0, 5.0
#: The same for one-way paths to scatterers, which are many; at 3 an edge diffracts -23 dB.
STRIP_FADE, STRIP_FAR = 2.0, 3.0
#: Largest value of Fresnel's integral over a slit.
SLIT = 1.17
#: Largest number of corners of the overlap of three quadrilaterals and a square, plus one to close it.
CORNERS = 20


def edge_integrals(
    radius: Float[np.ndarray, "radius"], angle: Float[np.ndarray, "angle"]
) -> Complex[np.ndarray, "radius angle"]:
    """Integral along an edge from a point on it to infinity, without the phase at that point:

        int exp(j pi (t^2 - x^2) / 2) s / (s^2 + t^2) dt from x on,

    with s = radius sin(angle), the distance of the edge's line from the path, and x = radius cos(angle), where it
    begins, in Fresnel units. The contour leaves x at 45 deg into the complex plane, where the phase decays. The result
    is smooth in both, since s / (s^2 + t^2) is an angle where the phase hardly changes; without phase it is `angle`.
    """
    radius = np.maximum(radius, 1e-6)[:, None, None]
    s, x = radius * np.sin(angle)[:, None], radius * np.cos(angle)[:, None]
    nodes, weights = np.polynomial.legendre.leggauss(64)
    around = radius  # distance of the pole at t = j s from the start
    last = np.arcsinh(4 / around)
    u = last * (nodes + 1) / 2
    turn = np.exp(0.25j * np.pi)
    y = around * np.sinh(u) * turn
    phase = np.exp(0.5j * np.pi * y * (2 * x + y))
    return np.sum(weights * last / 2 * around * np.cosh(u) * turn * phase * s / (s * s + (x + y) ** 2), axis=2)


def _tabulated() -> tuple[tuple[float, float], Complex[np.ndarray, "radius angle"]]:
    """Steps of radius and angle, and table of `edge_integrals` up to `FAR` in either."""
    radius, angle = np.linspace(0, np.sqrt(2) * FAR, 72), np.linspace(0, np.pi / 2, 36)
    return (float(radius[1]), float(angle[1])), edge_integrals(radius, angle)


_STEPS, _TAILS = _tabulated()


@njit
def depth(planes, count, x, y):
    """Distance of a point from the nearest of some edges, positive inside."""
    least = 1e9
    for k in range(count):
        least = min(least, planes[k, 2] - planes[k, 0] * x - planes[k, 1] * y)
    return least


@njit(cache=True)
def overlap(planes, count, polygon, spare):
    """Overlap of half planes n . x <= s with a wide square: writes its corners, counter-clockwise; returns their
    number."""
    wide, corner = 50.0, 4
    for i in range(4):
        polygon[i, 0], polygon[i, 1] = wide if 0 < i < 3 else -wide, wide if i > 1 else -wide
    for k in range(count):
        nx, ny, s = planes[k]
        outside = 0
        for i in range(corner):
            spare[i, 0], spare[i, 1] = polygon[i]
            spare[i, 2] = nx * polygon[i, 0] + ny * polygon[i, 1] - s
            outside += spare[i, 2] > 0
        if outside == 0:
            continue
        if outside == corner:
            return 0
        kept, before = 0, corner - 1
        for i in range(corner):
            d0, d1 = spare[before, 2], spare[i, 2]
            if (d0 <= 0) != (d1 <= 0):
                t = d0 / (d0 - d1)
                for axis in range(2):
                    polygon[kept, axis] = spare[before, axis] + t * (spare[i, axis] - spare[before, axis])
                kept += 1
            if d1 <= 0:
                polygon[kept, 0], polygon[kept, 1] = spare[i, 0], spare[i, 1]
                kept += 1
            before = i
        corner = kept
        if corner < 3:
            return 0
    return corner


@njit(cache=True)
def kirchhoff(polygon, corners):
    """(1 / 2j) int exp(j pi r^2 / 2) dA over a convex polygon (counter-clockwise, its first `corners` rows)."""
    total = 0j
    for k in range(corners):
        x0, y0 = polygon[k]
        x1, y1 = polygon[(k + 1) % corners]
        size = np.hypot(x1 - x0, y1 - y0)
        if size < 1e-12:
            continue
        s, low, high = side(x0, y0, x1, y1, size)
        if s != 0:
            total += np.arctan(high / s) - np.arctan(low / s)
        total -= diffracted(s, low, high)
    return total / (2 * np.pi)


@njit
def side(x0, y0, x1, y1, size):
    """Signed distance of the origin to the left of a side of this length, and start and end of the side along its
    line."""
    dx, dy = (x1 - x0) / size, (y1 - y0) / size
    return x0 * dy - y0 * dx, x0 * dx + y0 * dy, x1 * dx + y1 * dy


@njit(cache=True)
def diffracted(s, low, high):
    """Diffraction integral of a side in 2 pi times `kirchhoff`, without the angle that the side subtends; fades far
    off.

    It is int exp(j pi (s^2 + x^2) / 2) s / (s^2 + x^2) dx from low to high.
    """
    weight = _fading(s)
    if weight == 0 or s == 0:
        return 0j
    if low >= 0:
        return weight * (_tail(s, low) - _tail(s, high))
    if high <= 0:
        return weight * (_tail(s, -high) - _tail(s, -low))
    return weight * (2 * _tail(s, 0.0) - _tail(s, -low) - _tail(s, high))


@njit
def _fading(distance):
    """Weight 1 up to `FADE`, 0 from `FAR` on."""
    weight = min(max((FAR - abs(distance)) / (FAR - FADE), 0.0), 1.0)
    return weight * weight * (3 - 2 * weight)


@njit(cache=True)
def _tail(s, x):
    """The integral of `diffracted` from x >= 0 on, fading as x grows; odd in s."""
    weight = _fading(x)
    if weight == 0:
        return 0j
    square = s * s + x * x
    at_radius, at_angle = np.sqrt(square) / _STEPS[0], np.arctan2(abs(s), x) / _STEPS[1]
    i, p = _cubic(at_radius, len(_TAILS))
    j, q = _cubic(at_angle, _TAILS.shape[1])
    total = 0j
    for k in range(4):
        row = _TAILS[i + k]
        total += p[k] * (q[0] * row[j] + q[1] * row[j + 1] + q[2] * row[j + 2] + q[3] * row[j + 3])
    angle = 0.5 * np.pi * square
    return np.sign(s) * weight * total * complex(np.cos(angle), np.sin(angle))


@njit
def _cubic(at, count):
    """Indices of four of `count` values at 0, 1, 2 ... around a position, and their Lagrange weights."""
    first = min(max(int(at) - 1, 0), count - 4)
    t = at - first
    a, b, c = t - 1, t - 2, t - 3
    return first, (-a * b * c / 6, t * b * c / 2, -t * a * c / 2, t * a * b / 6)


@njit(cache=True)
def slit_diffraction(low, high):
    """Amplitude behind a slit, (1 / (1 + j)) int exp(j pi u^2 / 2) du from low to high; 1 for a wide one.

    Fresnel's integrals by the auxiliary functions f and g (Abramowitz and Stegun 7.3.9, 7.3.32, 7.3.33), accurate to
    0.002.
    """
    return _from_middle(high) - _from_middle(low)


@njit(cache=True)
def _from_middle(u):
    x = abs(u)
    if x >= STRIP_FAR:
        return np.sign(u) * 0.5 + 0j
    f = (1 + 0.926 * x) / (2 + 1.792 * x + 3.104 * x * x)
    g = 1 / (2 + 4.142 * x + 3.492 * x * x + 6.670 * x * x * x)
    angle = 0.5 * np.pi * x * x
    edge = (g + 1j * f) * (0.5 - 0.5j) * complex(np.cos(angle), np.sin(angle))
    weight = min((STRIP_FAR - x) / (STRIP_FAR - STRIP_FADE), 1.0)
    return np.sign(u) * (0.5 - weight * weight * (3 - 2 * weight) * edge)


@njit
def outside_aperture(stop, way, square, aperture):
    """Whether a path leaves a negligible amplitude: a fast test, `aperture_diffraction` without a root."""
    center, normal, u, v, half_u, half_v = aperture
    offset, aside, cosine = minus(stop, center), dot(way, u), dot(way, normal)
    x, y = max(abs(dot(offset, u)) - half_u, 0.0), max(abs(dot(offset, v)) - half_v, 0.0)
    across = max(1 - aside * aside, 1e-6)
    farthest = STRIP_FAR * STRIP_FAR * square
    return x * x * across >= farthest or y * y * cosine * cosine >= farthest * across


@njit
def aperture_diffraction(stop, way, square, aperture):
    """Amplitude that a mirror's aperture passes along a path.

    Args:
        stop: point of reflection, m.
        way: unit direction of propagation.
        square: square of the Fresnel unit across the path, m^2. In the mirror's plane it is longer along the plane of
            incidence: by 1 / across along u, by across / cosine along v, which preserves its area and neglects its
                slant.
        aperture: rectangle of the mirror, see `aperture`.
    """
    center, normal, u, v, half_u, half_v = aperture
    offset = minus(stop, center)
    aside, cosine = dot(way, u), abs(dot(way, normal))
    across, size = np.sqrt(max(1 - aside * aside, 1e-6)), np.sqrt(square) + 1e-12
    along_u, along_v = across / size, cosine / (across * size)
    x, y, half_x, half_y = dot(offset, u) * along_u, dot(offset, v) * along_v, half_u * along_u, half_v * along_v
    return slit_diffraction(-half_x - x, half_x - x) * slit_diffraction(-half_y - y, half_y - y)


@njit
def aperture(flat, m):
    """Rectangle that represents a flat reflector: center, normal, u, v, half sides."""
    return (
        vec(flat.center[m]), vec(flat.normal[m]), vec(flat.u[m]), vec(flat.v[m]), flat.half[m, 0], flat.half[m, 1]
    )  # fmt: skip


@njit(cache=True)
def outlines(flat):
    """Smallest and largest offset of each flat reflector's corners from its centre along u and v, m."""
    out = np.zeros((len(flat.center), 4))
    for m in range(len(out)):
        for k in range(4):
            offset = minus(vec(flat.corners[m, k]), vec(flat.center[m]))
            x, y = dot(offset, vec(flat.u[m])), dot(offset, vec(flat.v[m]))
            out[m] = min(out[m, 0], x), max(out[m, 1], x), min(out[m, 2], y), max(out[m, 3], y)
    return out
