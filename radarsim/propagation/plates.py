"""Coherent echo of flat convex polygons: physical optics, in near and far field, on and off the normal.

The physical-optics integral of a plate under a point source at height h over its plane,

    I = int cos exp(2jk rho) / rho^2 dA = h int dphi int exp(2jk rho) / rho^2 drho,

polar about the foot of the perpendicular, has an end at the foot, the specular point, and one along the outline. Over
the echo of the endless plane, lambda / (8 pi h), it is to the leading order in 1 / (k rho)

    F = inside - h^2 / (2 pi) closed int exp(2jk (rho - h)) / rho^2 dphi,

inside: whether the foot is. (The contour form of Kirchhoff's integral after Maggi and Rubinowicz; for far polygons it
is Gordon's, IEEE TAP 23(4), 1975.) Along an edge whose line passes the foot at s and the radar at L = |(h, s)|, with
X = sqrt(8 (rho - L) / lambda), it is exactly

    h^2 s sqrt(lambda / 2) / (2 pi) int exp(j pi X^2 / 2) / (rho (rho^2 - h^2) sqrt(rho + L)) dX,

which splits into the edge's own echo, from the point of its line nearest to the radar if that is on the edge, and one
from either end. Every part has its own exact path length |tx - M rx|: the mirror image in the plane, half turns
about edges, inversions in corners. So Doppler, angle and range of edges and corners are correct, and parts of
adjoining coplanar plates cancel along their seam.
"""

import numpy as np
from numba import njit

from radarsim.propagation.curved import SpecularPoints
from radarsim.propagation.fields import along, cross, dot, gain_towards, length, minus, vec, write
from radarsim.propagation.media import HEAD_ON
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.table import filled

#: Shift of the foot inwards, m: on a seam it is inside both plates, whose parts add up.
NUDGE = 1e-8
#: Nodes and weights of the quadrature along an edge, on 0 ... 1: for most edges, and for those near the pole.
_FEW, _MANY = ((np.polynomial.legendre.leggauss(n) + np.array([[1.0], [0.0]])) / 2 for n in (8, 28))


def specular_points(flat: Flat, observation: Observation, frame: int) -> SpecularPoints:
    """Specular points, edges and corners of all facets above the threshold in one frame."""
    return filled(SpecularPoints, lambda found: _specular_points(flat.columns, observation, frame, found.columns))


@njit(cache=True)
def _specular_points(flat, observation, frame, found):
    """Return the number of specular points, of which as many as fit are written."""
    corners, zero = flat.corners, (0.0, 0.0, 0.0)
    p, rotation, reach = vec(observation.position[frame]), observation.rotation[frame], observation.range
    wavelength, weakest = observation.wavelength, observation.threshold
    sides, count = corners.shape[1], 0
    outward, value = np.empty((sides, 3)), np.empty(sides, np.complex128)
    for f in range(len(corners)):
        n = vec(flat.normal[f])
        h = dot(minus(p, vec(corners[f, 0])), n)
        if abs(h) < 0.01 or abs(h) > reach or (h < 0 and not flat.two_sided[f]):
            continue
        if h < 0:
            n, h = (-n[0], -n[1], -n[2]), -h
        middle = zero
        for k in range(sides):
            middle = along(middle, 1 / sides, vec(corners[f, k]))
        foot = along(p, -h, n)
        inwards = minus(middle, foot)
        foot = along(foot, NUDGE / (length(inwards) + NUDGE), inwards)
        mirror = wavelength / (8 * np.pi * h) * abs(flat.layer[f, HEAD_ON])
        if mirror == 0:
            continue
        turn = flat.layer[f, HEAD_ON] / abs(flat.layer[f, HEAD_ON])
        inside = True
        value[:] = 0
        for k in range(sides):
            one, two = vec(corners[f, k]), vec(corners[f, (k + 1) % sides])
            side = minus(two, one)
            size = length(side)
            if size < 1e-6:
                outward[k] = 0.0
                continue
            side = (side[0] / size, side[1] / size, side[2] / size)
            out = cross(side, n)
            if dot(minus(middle, one), out) > 0:
                out = (-out[0], -out[1], -out[2])
            write(out, outward[k])
            s = dot(minus(one, foot), out)
            inside = inside and s > 0
            low = dot(minus(one, foot), side)
            high = low + size
            slant = np.hypot(h, s)
            # Ends of the edge: evaluated if the leading term, far from the specular point, is significant.
            for end, x, sign in ((k, low, 1.0), ((k + 1) % sides, high, -1.0)):
                rho = np.hypot(slant, x)
                if rho >= reach:
                    continue
                least = h * h * abs(s) / (rho * (s * s + x * x) * abs(x) + 1e-12) * wavelength / (8 * np.pi**2)
                most = min(least, 0.25) * mirror
                if most * observation.peak_gain**2 <= 0.1 * weakest:
                    continue
                if most * gain_towards(minus(vec(corners[f, end]), p), rotation, observation) ** 2 > 0.1 * weakest:
                    value[end] -= sign * np.sign(x) * _beyond(h, s, slant, abs(x), wavelength)
            if low < 0 < high and slant < reach:
                least = h * h * np.sqrt(wavelength * slant / 2) / (slant * slant * abs(s)) / (2 * np.pi)
                if min(least, 0.5) * mirror * observation.peak_gain**2 <= weakest:
                    continue
                point = along(foot, s, out)
                scale = mirror * gain_towards(minus(point, p), rotation, observation) ** 2
                if min(least, 0.5) * scale > weakest:
                    own = -2 * _beyond(h, s, slant, 0.0, wavelength)
                    if abs(own) * scale > weakest:
                        aim = along(along(point, -0.01, out), 0.002, n)
                        count = _add(found, count, f, own * scale * turn, aim, (1.0, n, out, point))
        for k in range(sides):
            if value[k] == 0:
                continue
            point = vec(corners[f, k])
            scale = mirror * gain_towards(minus(point, p), rotation, observation) ** 2
            if abs(value[k]) * scale > weakest:
                before, after = vec(outward[(k - 1) % sides]), vec(outward[k])
                aim = along(along(along(point, -0.01, before), -0.01, after), 0.002, n)
                count = _add(found, count, f, value[k] * scale * turn, aim, (-1.0, zero, zero, point))
        if inside:
            scale = mirror * gain_towards(minus(foot, p), rotation, observation) ** 2
            if scale > weakest:
                count = _add(found, count, f, scale * turn, along(foot, 0.002, n), (1.0, n, zero, foot))
    return count


@njit
def _add(found, count, facet, amplitude, aim, image):
    """Write a part if there is room; return the number of parts.

    Args:
        found, count: parts so far, and their number.
        facet, amplitude, aim: see `SpecularPoints`.
        image: the isometry s (1 - 2 a a' - 2 b b') about a point: a reflection in a plane of normal a (b zero), a half
            turn about an edge at right angles to a and b, an inversion in a corner (s = -1, both zero).
    """
    sign, a, b, point = image
    if count < len(found.facet):
        found.facet[count], found.amplitude[count] = facet, amplitude
        write(aim, found.aim[count])
        for i in range(3):
            shift = point[i]
            for j in range(3):
                m = sign * ((1.0 if i == j else 0.0) - 2 * a[i] * a[j] - 2 * b[i] * b[j])
                found.geometry[count, 4 * i + j] = m
                shift -= m * point[j]
            found.geometry[count, 4 * i + 3] = shift
    return count + 1


@njit(cache=True)
def _beyond(h, s, slant, x, wavelength):
    """Integral along an edge's line from x >= 0 on, phase relative to the path over its start.

    The contour leaves X at 45 deg into the complex plane, where exp(j pi X^2 / 2) decays; steps grow with the distance
    from the pole X = +-j S at rho = h.
    """
    near = np.sqrt(slant * slant + x * x)
    begin = x * np.sqrt(8 / (wavelength * (near + slant)))
    pole = abs(s) * np.sqrt(8 / (wavelength * (slant + h)))
    around = np.sqrt(begin * begin + pole * pole) + 1e-12
    end = np.arcsinh(min(3.0, 5.5 / (begin + 1e-3)) / around)
    turn = np.exp(0.25j * np.pi)
    total = 0j
    nodes, weights = _FEW if end < 1.5 else _MANY
    for i in range(len(nodes)):
        u = end * nodes[i]
        y = around * np.sinh(u) * turn
        rise = wavelength / 8 * (begin + y) ** 2  # rho - L
        rho = slant + rise
        below = s * s / (slant + h) + rise  # rho - h
        phase = np.exp(0.5j * np.pi * y * (2 * begin + y))
        total += weights[i] * np.cosh(u) * phase / (rho * below * (rho + h) * np.sqrt(rho + slant))
    return total * turn * around * end * h * h * s * np.sqrt(wavelength / 2) / (2 * np.pi)
