"""Coherent echo of spheres and cylinders, from the point or line of specular reflection.

Physical optics of a round body (stationary phase across the curvature) is the wall's echo lambda / (8 pi h), h from the
sensor to the nearest point, times sqrt(a / (a + h)) for each curved direction:

    sphere    lambda / (8 pi h) a / (a + h), far away sigma = pi a^2;
    cylinder  lambda / (8 pi h) sqrt(a / (a + h)) (interior - ends), far away at broadside sigma = k a l^2.

Along a cylinder the Fresnel integral splits into the interior (if the foot of the perpendicular lies between the ends)
and one term per end that decays away from it:

    F = [G(u)] from u_1 to u_2,  G(u) = (C(u) + j S(u)) / (1 + j) = sign(u) (1/2 - E(|u|)),
    u = +-2 sqrt((L_end - L_line) / lambda), L the round trip.

Relative to the centre of the arrays, paths are isometries of the receiver as for plates: a half turn about the nearest
line of the cylinder, inversions in its ends and in the sphere's nearest point. But that line or point moves over the
body with the sensor, and differs for each pair of antennas; kept constant through a burst it causes a path error of
delta^2 (1 / h - 1 / (a + h)) for a step delta across, which is 16 deg of phase at 0.3 m. So for each pair and time the
path is taken over the point whose normal bisects the angle (`path_over`); the error that remains after a few iterations
enters squared.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit
from scipy.special import erfcx

from radarsim.propagation.fields import along as moved
from radarsim.propagation.fields import cross, dot, gain_towards, length, minus, mirrored, unit, vec
from radarsim.propagation.media import HEAD_ON
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table

#: Kind of specular point: on a sphere or an end of a cylinder, along a cylinder, on a piece of a smooth surface.
POINT, LINE, QUADRIC = 1.0, 2.0, 3.0
#: Columns of a curved surface in `SpecularPoints.geometry`.
SHAPE = 13
#: Square of an angle, rad^2, at which the iteration for a normal stops.
_STILL = 1e-22


@dataclass(frozen=True)
class SpecularPoints(Table):
    """Specular points, edges and corners of flat and curved reflectors.

    Attributes:
        facet: index of the flat reflector; -1: a curved one.
        aim: end point of the visibility ray, m.
        geometry: of a flat reflector, the isometry of the receiver by rows (12 numbers). Of a curved one, `POINT`, a
            sphere or an end of a cylinder, or `LINE`, along a cylinder: a point of the axis, or the centre, m; the
            axis; radius, m; zero. Or `QUADRIC`: its central point, m; a principal direction; zero; the normal;
            the curvatures along that direction and across, 1/m.
        amplitude: square root of received over transmitted power, with phase.
    """

    facet: Int[np.ndarray, "point"]
    aim: Float[np.ndarray, "point 3"]
    geometry: Float[np.ndarray, "point 13"]
    amplitude: Complex[np.ndarray, "point"]

    @property
    def isometry(self) -> Float[np.ndarray, "point 3 4"]:
        """Isometries of the receiver for flat reflectors."""
        return self.geometry[:, :12].reshape(-1, 3, 4)


@dataclass(frozen=True)
class RoundBodies(Table):
    """Spheres and cylinders.

    Attributes:
        center: m.
        axis: unit vector along a cylinder; zero for a sphere.
        radius: m.
        half: half the length of a cylinder, m; zero for a sphere.
        layer: as of flat reflectors (`reflectors.Flat`).
    """

    center: Float[np.ndarray, "body 3"]
    axis: Float[np.ndarray, "body 3"]
    radius: Float[np.ndarray, "body"]
    half: Float[np.ndarray, "body"]
    layer: Complex[np.ndarray, "body 5"]

    def specular_points(self, observation: Observation, frame: int) -> SpecularPoints:
        """Specular points and ends above the threshold in one frame."""
        position, reach, wavelength = observation.position[frame], observation.range, observation.wavelength
        offset = position - self.center
        z = np.einsum("bd,bd->b", offset, self.axis)
        radial = offset - z[:, None] * self.axis
        rho = np.linalg.norm(radial, axis=1)
        near = np.flatnonzero((rho - self.radius > 0.01) & (rho - self.radius < reach) & (abs(z) - self.half < reach))
        some, z = self[near], z[near]
        h, sphere = rho[near] - some.radius, some.half == 0
        foot = some.center + radial[near] * (some.radius / rho[near])[:, None]
        height = np.stack([np.where(sphere, 0, z), -some.half, some.half], axis=1)  # along the axis
        slant = np.hypot(h[:, None], height - z[:, None])
        # Fresnel's integral to the ends, phases relative to the path over each part: (1/2 - E(u)) exp(-j pi u^2 / 2)
        u = 2 * np.sqrt(2 * np.maximum(slant[:, 1:] - h[:, None], 0) / wavelength)
        side = np.where(
            height[:, 1:] >= z[:, None], 0.5, -0.5
        )  # on the end itself: counted for one of two abutting bodies
        size = np.ones(height.shape, complex)
        size[:, 0] = side[:, 1] - side[:, 0]
        size[:, 1:] = side * [1, -1] * erfcx(np.sqrt(np.pi / 2) * np.exp(-0.25j * np.pi) * u)
        size[:, 1:] *= np.sqrt(2) * h[:, None] ** 2 / (slant[:, 1:] ** 1.5 * np.sqrt(slant[:, 1:] + h[:, None]))
        size[sphere] = [1.0, 0.0, 0.0]
        spread = some.radius / (some.radius + h)
        size *= (wavelength / (8 * np.pi * h) * np.where(sphere, spread, np.sqrt(spread)))[:, None]
        size *= some.layer[:, HEAD_ON, None]
        b, part = np.nonzero((np.abs(size) * observation.peak_gain**2 > observation.threshold) & (slant < reach))
        point = foot[b] + height[b, part, None] * some.axis[b]
        amplitude = size[b, part] * _gains(point - position, observation.rotation[frame], observation) ** 2
        keep = np.abs(amplitude) > observation.threshold
        b, part, point, amplitude = b[keep], part[keep], point[keep], amplitude[keep]
        inward, axis = np.array([0.0, 1.0, -1.0])[part] * np.minimum(0.01, some.half[b]), some.axis[b]
        pivot = some.center[b] + (np.array([0, -1, 1])[part] * some.half[b])[:, None] * axis
        kind = np.where((part == 0) & (some.half[b] > 0), LINE, POINT)
        shape = np.column_stack([kind, pivot, axis, some.radius[b], np.zeros((len(b), SHAPE - 8))])
        return SpecularPoints(np.full(len(b), -1), point + inward[:, None] * axis, shape, amplitude)


@njit
def halving(body, one, two, steps):
    """Normal of a round body that bisects the angle between the directions to two places.

    Args:
        body: a point of its axis, the axis (zero for a sphere), radius; m.
        one, two: the places, m.
        steps: number of iterations; each reduces the error at least by the ratio of radius to distance.

    Returns:
        The normal, and the vectors from there to both places across the axis, m.
    """
    pivot, axis, radius = body
    a, b = minus(one, pivot), minus(two, pivot)
    a, b = moved(a, -dot(a, axis), axis), moved(b, -dot(b, axis), axis)
    n = unit(moved(unit(a), 1.0, unit(b)))
    for _ in range(steps):
        before, n = n, unit(moved(unit(moved(a, -radius, n)), 1.0, unit(moved(b, -radius, n))))
        if dot(minus(n, before), minus(n, before)) < _STILL:
            break
    return n, moved(a, -radius, n), moved(b, -radius, n)


@njit
def _quadric(shape):
    return vec(shape[1:4]), vec(shape[4:7]), vec(shape[8:11]), shape[11], shape[12]


@njit
def path_over(shape, one, two):
    """Length of the shortest path over a curved surface between two nearby places, m."""
    if shape[0] == QUADRIC:
        return stationary(_quadric(shape), one, two)[1]
    body = vec(shape[1:4]), vec(shape[4:7]), shape[7]
    n, _, _ = halving(body, one, two, 3)
    place = moved(body[0], body[2], n)
    if shape[0] == LINE:
        return length(minus(one, mirrored(two, place, n)))
    return length(minus(one, place)) + length(minus(two, place))


@njit
def facing_point(shape, place):
    """Point of a curved surface nearest to a place, m."""
    if shape[0] == QUADRIC:
        return stationary(_quadric(shape), place, place)[0]
    pivot, axis, radius = vec(shape[1:4]), vec(shape[4:7]), shape[7]
    foot = moved(pivot, dot(minus(place, pivot), axis), axis) if shape[0] == LINE else pivot
    return moved(foot, radius, halving((pivot, axis, radius), place, place, 0)[0])


@njit
def stationary(quadric, one, two):
    """Stationary path between two places over a quadric, by Newton's method.

    Args:
        quadric: point, principal direction, normal, curvatures along the direction and across it (1/m).

    Returns:
        The point of reflection, m; the path's length, m; its Hessian over the two directions, 1/m, as h11, h22, h12;
        and
            that of an infinite plane.
    """
    u1, u2 = 0.0, 0.0
    for _ in range(3):
        _, _, (h11, h22, h12), (p11, p22, _), (g1, g2) = growth(quadric, (u1, u2), one, two)
        # near a caustic the exact point is irrelevant
        det = h11 * h22 - h12 * h12
        if abs(det) < 0.01 * p11 * p22:
            break
        u1 += (h22 * g1 - h12 * g2) / det
        u2 += (h11 * g2 - h12 * g1) / det
    place, way, hessian, plane, _ = growth(quadric, (u1, u2), one, two)
    return place, way, hessian, plane


@njit
def growth(quadric, at, one, two):
    """Gradient and Hessian of a path between two places over a quadric at a point of the quadric.

    Args:
        quadric, one, two: see `stationary`.
        at: position of the point along the principal directions, m.

    Returns:
        The results of `stationary`, and the negative gradient of the path.
    """
    (point, axis, normal, bend1, bend2), (u1, u2) = quadric, at
    across = cross(normal, axis)
    s1, s2 = bend1 * u1, bend2 * u2
    place = moved(moved(moved(point, u1, axis), u2, across), -0.5 * (s1 * u1 + s2 * u2), normal)
    along1, along2 = moved(axis, -s1, normal), moved(across, -s2, normal)
    there, back = minus(one, place), minus(two, place)
    r1, r2 = length(there), length(back)
    there, back = (there[0] / r1, there[1] / r1, there[2] / r1), (back[0] / r2, back[1] / r2, back[2] / r2)
    a1, a2, b1, b2 = dot(there, along1), dot(there, along2), dot(back, along1), dot(back, along2)
    sum_, slope = 1 / r1 + 1 / r2, dot(there, normal) + dot(back, normal)
    p11 = (1 + s1 * s1) * sum_ - a1 * a1 / r1 - b1 * b1 / r2
    p22 = (1 + s2 * s2) * sum_ - a2 * a2 / r1 - b2 * b2 / r2
    p12 = s1 * s2 * sum_ - a1 * a2 / r1 - b1 * b2 / r2
    hessian = p11 + slope * bend1, p22 + slope * bend2, p12
    return place, r1 + r2, hessian, (p11, p22, p12), (a1 + b1, a2 + b2)


@njit
def grazes(surface, one, two, least):
    """Whether the cosine of incidence on a surface (point, normal) from either place is below a limit."""
    there, back = unit(minus(one, surface[0])), unit(minus(two, surface[0]))
    return dot(there, surface[1]) < least or dot(back, surface[1]) < least


@njit(cache=True)
def _gains(directions, rotation, observation):
    out = np.empty(len(directions))
    for i in range(len(directions)):
        out[i] = gain_towards(vec(directions[i]), rotation, observation)
    return out
