"""Common aperture of a chain of mirrors: a polygon across the unfolded path, in Fresnel units."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from numba import njit

from radarsim.propagation.apertures import CORNERS, FAR, depth
from radarsim.propagation.fields import along, cross, dot, minus, mirrored, unit, vec

#: Cosines of incidence up to which a mirror passes nothing, and from which on it has no extra loss. Without this fade
#: an echo would vanish in one step, since wide mirrors pass it at any grazing angle.
GRAZING, CLEAR = 0.004, 0.02


class Room(NamedTuple):
    """Work space for polygons: bounds as outward normals and offsets, and corners for `apertures.overlap`."""

    planes: Float[np.ndarray, "14 3"]
    polygon: Float[np.ndarray, "corner 2"]
    spare: Float[np.ndarray, "corner 3"]


@njit
def scratch():
    """Allocate work space for three quadrilaterals and the lines where their planes meet."""
    return Room(np.empty((14, 3)), np.empty((CORNERS, 2)), np.empty((CORNERS, 3)))


@njit(cache=True)
def window(way, p, path, ray, wavelength, flat, room):
    """Compute the bounds `room.planes` of a chain of mirrors along a ray from p.

    Args:
        way: the mirrors.
        path: length of the whole path, m.

    Returns:
        Number of bounds, -1 if nothing is open; two axes across the ray; and the factor on the amplitude by mirrors at
            grazing incidence.
    """
    normal, corners, planes = flat.normal, flat.corners, room.planes
    aside = (0.0, 0.0, 1.0) if abs(ray[2]) < 0.7 else (1.0, 0.0, 0.0)
    e1 = unit(cross(aside, ray))
    e2 = cross(ray, e1)
    # Instead of unfolding the mirrors, the path and its axes are folded; its start becomes an image.
    start, now, f1, f2 = p, ray, e1, e2
    count, before, last, left = 0, 0.0, ray, 1.0
    for k in range(len(way)):
        m = way[k]
        n, c = vec(normal[m]), vec(flat.center[m])
        slope = dot(now, n)
        if abs(slope) <= GRAZING or (slope > 0 and not flat.two_sided[m]):
            return -1, e1, e2, 0.0
        share = min((abs(slope) - GRAZING) / (CLEAR - GRAZING), 1.0)
        left *= share * share * (3 - 2 * share)
        t = dot(minus(c, start), n) / slope
        if t <= 0.005 or t >= path - 0.005 or t < before - np.sqrt(wavelength * path):
            return -1, e1, e2, 0.0
        if k > 0:
            count = _bounded(planes, count, _junction((now, f1, f2), (before, last), (t, n)), path, wavelength)
            if count < 0:
                return -1, e1, e2, 0.0
        before = t
        x, y = 0.0, 0.0  # the middle of the window
        for side in range(4):
            one = minus(vec(corners[m, side]), start)
            x, y = x + dot(one, f1) / 4, y + dot(one, f2) / 4
        middle = (x, y)
        for side in range(4):
            one, two = minus(vec(corners[m, side]), start), minus(vec(corners[m, (side + 1) % 4]), start)
            x, y = dot(one, f1), dot(one, f2)
            dx, dy = dot(two, f1) - x, dot(two, f2) - y
            square = dx * dx + dy * dy
            if square < 1e-8:
                continue
            turn = dx * (middle[1] - y) - dy * (middle[0] - x)
            sign = (1.0 if turn < 0 else -1.0) / np.sqrt(square)
            nx, ny = -dy * sign, dx * sign  # outward
            share = min(max(-(x * dx + y * dy) / square, 0.0), 1.0)
            at = dot(one, now) + share * (dot(two, now) - dot(one, now))
            count = _bounded(planes, count, (nx, ny, nx * x + ny * y, at), path, wavelength)
            if count < 0:
                return -1, e1, e2, 0.0
        now, last = along(now, -2 * slope, n), n
        start = mirrored(start, c, n)
        f1, f2 = along(f1, -2 * dot(f1, n), n), along(f2, -2 * dot(f2, n), n)
    return count, e1, e2, left


@njit(cache=True)
def inside(room, count, corners):
    """Point where a ray passes the polygon: on the path itself, or, near an edge, a little inside."""
    mx, my = 0.0, 0.0
    for k in range(corners):
        mx += room.polygon[k, 0] / corners
        my += room.polygon[k, 1] / corners
    toward = 0.0
    for step in (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0):
        toward = step
        if depth(room.planes, count, step * mx, step * my) > 0.25:
            break
    return toward * mx, toward * my


@njit
def _junction(axes, last, mirror):
    """Line where the planes of two consecutive mirrors meet, for `_bounded`: no ray meets the second mirror before the
    first one, even if they extend behind each other.

    Args:
        axes: direction of the path between the mirrors, and axes across it.
        last, mirror: distance along the path, and normal, of each.
    """
    (now, f1, f2), (before, a), (t, b) = axes, last, mirror
    # at offset x, y across the path, a mirror is met at t - (x f1 + y f2) . n / (now . n) along it
    x1, y1, x2, y2 = dot(f1, a), dot(f2, a), dot(f1, b), dot(f2, b)
    away, slope = dot(now, a), dot(now, b)
    nx, ny = x2 / slope - x1 / away, y2 / slope - y1 / away
    size = np.hypot(nx, ny) + 1e-9
    nx, ny, offset = nx / size, ny / size, (t - before) / size
    return nx, ny, offset, t - offset * (nx * x2 + ny * y2) / slope


@njit
def _bounded(planes, count, line, path, wavelength):
    """Bound the polygon by a line across the path; returns the number of bounds, -1 if nothing is left.

    Args:
        planes, count: bounds so far, outward normals and offsets in Fresnel units.
        line: outward normal, offset (m), and distance along the path (m) of its nearest point.
        path, wavelength: m.
    """
    nx, ny, offset, at = line
    d = at / path
    if d < 0.02 or d > 0.98:  # beside or behind the radar
        return -1 if offset < 0 else count
    offset /= np.sqrt(wavelength * path * d * (1 - d) / 2)
    if offset < -FAR:
        return -1
    planes[count, 0], planes[count, 1], planes[count, 2] = nx, ny, offset
    return count + 1
