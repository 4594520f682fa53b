"""What apertures on a path leave of a wave, in Fresnel units: Kirchhoff's integral over polygons, rectangles."""

import numpy as np
from numba import njit

from radarsim.physics.amplitudes import dot, minus
from radarsim.physics.amplitudes import vector as vec

#: Edges this far off the path, in units of the Fresnel integral, begin to fade from the sum, and those are left out:
#: what they diffract comes on a path of its own, longer by s^2 lambda / 4.
FADE, FAR = 3.0, 5.0
#: The same for one-way paths to scatterers: there are many, and at 3 an edge diffracts -23 dB.
STRIP_FADE, STRIP_FAR = 2.0, 3.0
#: Most corners that the overlap of three quadrilaterals and a square can have, and one to close it.
CORNERS = 20


@njit
def depth(planes, count, x, y):
    """Distance of a point inside the nearest of some edges."""
    least = 1e9
    for k in range(count):
        least = min(least, planes[k, 2] - planes[k, 0] * x - planes[k, 1] * y)
    return least


@njit(cache=True)
def overlap(planes, count, polygon, spare):
    """Corners, counter-clockwise, of what half planes n . x <= s leave of a wide square; returns their number."""
    wide = 50.0
    polygon[0, 0], polygon[0, 1] = -wide, -wide
    polygon[1, 0], polygon[1, 1] = wide, -wide
    polygon[2, 0], polygon[2, 1] = wide, wide
    polygon[3, 0], polygon[3, 1] = -wide, wide
    corner = 4
    for k in range(count):
        nx, ny, s = planes[k]
        kept = 0
        for i in range(corner):
            x0, y0 = polygon[i]
            x1, y1 = polygon[(i + 1) % corner]
            d0, d1 = nx * x0 + ny * y0 - s, nx * x1 + ny * y1 - s
            if d0 <= 0:
                spare[kept, 0], spare[kept, 1] = x0, y0
                kept += 1
            if (d0 <= 0) != (d1 <= 0):
                t = d0 / (d0 - d1)
                spare[kept, 0], spare[kept, 1] = x0 + t * (x1 - x0), y0 + t * (y1 - y0)
                kept += 1
        corner = kept
        polygon[:corner] = spare[:corner]
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
    """How far the origin is on the left of a side of this size, and where along it the side begins and ends."""
    dx, dy = (x1 - x0) / size, (y1 - y0) / size
    return x0 * dy - y0 * dx, x0 * dx + y0 * dy, x1 * dx + y1 * dy


@njit(cache=True)
def diffracted(s, low, high):
    """What a side takes from 2 pi times `kirchhoff`, but for the angle that it fills; far ones fade."""
    weight = min(max((FAR - abs(s)) / (FAR - FADE), 0.0), 1.0)
    if weight <= 0:
        return 0j
    return weight * weight * (3 - 2 * weight) * _edge(s, max(low, -FAR), min(high, FAR))


@njit(cache=True)
def _edge(s, low, high):
    """int exp(j pi (s^2 + x^2) / 2) s / (s^2 + x^2) dx, the part that is sharp for small s in closed form."""
    if high <= low or s == 0:
        return 0j
    total = 0j
    # Gauss-Legendre with four points on stretches over which the phase turns by a radian or less.
    x = low
    while x < high:
        nearest = 0.0 if x < 0 < x + 0.5 else min(abs(x), abs(x + 0.5))
        step = min(0.5, 1.2 / (nearest + 0.5), high - x)
        for node, weight in ((-0.8611363116, 0.3478548451), (-0.3399810436, 0.6521451549),
                             (0.3399810436, 0.6521451549), (0.8611363116, 0.3478548451)):  # fmt: skip
            at = x + 0.5 * step * (1 + node)
            angle = 0.5 * np.pi * at * at
            # exp(j angle) - 1, without loss of digits
            half = np.sin(angle / 2)
            total += 0.5 * step * weight * (-2 * half * half + 1j * np.sin(angle)) * s / (s * s + at * at)
        x += step
    total += np.arctan(high / s) - np.arctan(low / s)
    return total * np.exp(0.5j * np.pi * s * s)


@njit(cache=True)
def strip(low, high):
    """(1 / (1 + j)) int exp(j pi u^2 / 2) du from low to high: what a slit leaves; 1 for a wide one.

    Fresnel's integrals by the auxiliary functions f and g (Abramowitz and Stegun 7.3.9, 7.3.32, 7.3.33), good to 0.002.
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
def misses(stop, way, square, aperture):
    """Whether a path leaves nothing worth while: `passes` without a root, for a quick look."""
    center, normal, u, v, half_u, half_v = aperture
    offset, aside, cosine = minus(stop, center), dot(way, u), dot(way, normal)
    x, y = max(abs(dot(offset, u)) - half_u, 0.0), max(abs(dot(offset, v)) - half_v, 0.0)
    across = max(1 - aside * aside, 1e-6)
    farthest = STRIP_FAR * STRIP_FAR * square
    return x * x * across >= farthest or y * y * cosine * cosine >= farthest * across


@njit
def passes(stop, way, square, aperture):
    """What the aperture of a mirror passes of a path in a direction over a stop on it.

    Args:
        stop: m.
        way: unit direction of travel.
        square: of the Fresnel unit across the path, m^2. In the mirror's plane it is longer along the plane of
            incidence: by 1 / across along u, by across / cosine along v, which keeps its area and neglects its slant.
        aperture: of the mirror, see `aperture`.
    """
    center, normal, u, v, half_u, half_v = aperture
    offset = minus(stop, center)
    aside, cosine = dot(way, u), abs(dot(way, normal))
    across, size = np.sqrt(max(1 - aside * aside, 1e-6)), np.sqrt(square) + 1e-12
    along_u, along_v = across / size, cosine / (across * size)
    x, y, half_x, half_y = dot(offset, u) * along_u, dot(offset, v) * along_v, half_u * along_u, half_v * along_v
    return strip(-half_x - x, half_x - x) * strip(-half_y - y, half_y - y)


@njit
def aperture(flat, m):
    """The rectangle that stands for a flat reflector: center, normal, u, v, half sides."""
    return (
        vec(flat.center[m]), vec(flat.normal[m]), vec(flat.u[m]), vec(flat.v[m]), flat.half[m, 0], flat.half[m, 1]
    )  # fmt: skip
