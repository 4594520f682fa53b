"""The coherent echo of spheres and cylinders, from the point or the line that faces the radar.

Physical optics of a round body (stationary phase across the curvature) is the wall's echo lambda / (8 pi h), h from the
sensor to the nearest point, times sqrt(a / (a + h)) for each curved direction:

    sphere    lambda / (8 pi h) a / (a + h), far away sigma = pi a^2;
    cylinder  lambda / (8 pi h) sqrt(a / (a + h)) (interior - ends), far away at broadside sigma = k a l^2.

Along a cylinder the Fresnel integral splits into the interior (if the foot of the perpendicular lies between the ends)
and one term per end that decays away from it:

    F = [G(u)] from u_1 to u_2,  G(u) = (C(u) + j S(u)) / (1 + j) = sign(u) (1/2 - E(|u|)),
    u = +-2 sqrt((L_end - L_line) / lambda), L the round trip.

From the middle of the arrays, paths are isometries of the receiver as for plates: a half turn about the nearest line of
the cylinder, inversions in its ends and in the sphere's nearest point. But that line or point wanders over the body as
the sensor moves, and is another for each pair of antennas; held through a burst it makes the path wrong by
delta^2 (1 / h - 1 / (a + h)) for a step delta across, which is 16 deg of phase at 0.3 m. So for each pair and instant
the path goes by the point whose normal halves the angle (`path_over`); what a few steps towards it leave of its error
enters by the square.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit
from scipy.special import fresnel

from radarsim.propagation.antenna import amplitude_gain
from radarsim.propagation.fields import along as moved
from radarsim.propagation.fields import cross, dot, length, minus, mirrored, unit
from radarsim.propagation.fields import vector as vec
from radarsim.propagation.media import HEAD_ON, LAYER
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table

#: What a flash goes over: a sphere or an end of a cylinder, a cylinder lengthwise, a piece of a smooth surface.
POINT, LINE, QUADRIC = 1.0, 2.0, 3.0
#: Columns of `Arcs.shape`.
SHAPE = 13


@dataclass(frozen=True)
class RoundBodies(Table):
    """Round bodies.

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

    @classmethod
    def of(cls, rows: list[tuple]) -> "RoundBodies":
        """A table of rows."""
        if not rows:
            none = np.zeros((0, 3))
            return cls(none, none, np.zeros(0), np.zeros(0), np.zeros((0, LAYER), complex))
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    def arcs(self, body: Int[np.ndarray, "part"], part: Int[np.ndarray, "part"]) -> Float[np.ndarray, "part 13"]:
        """What `path_over` takes of flashes and ends."""
        axis, half = self.axis[body], self.half[body]
        pivot = self.center[body] + (np.array([0, -1, 1])[part] * half)[:, None] * axis
        kind = np.where((part == 0) & (half > 0), LINE, POINT)
        return np.column_stack([kind, pivot, axis, self.radius[body], np.zeros((len(body), SHAPE - 8))])

    def flashes(self, observation: Observation, frame: int) -> "Arcs":
        """Flashes and ends as the radar sees them."""
        position, reach, wavelength = observation.position[frame], observation.range, observation.wavelength
        offset = position - self.center
        z = np.einsum("bd,bd->b", offset, self.axis)
        radial = offset - z[:, None] * self.axis
        rho = np.linalg.norm(radial, axis=1)
        near = np.flatnonzero((rho - self.radius > 0.01) & (rho - self.radius < reach) & (abs(z) - self.half < reach))
        z, radius, half, axis = z[near], self.radius[near], self.half[near], self.axis[near]
        h = rho[near] - radius
        line = self.center[near] + radial[near] * (radius / rho[near])[:, None]
        sphere = half == 0
        across = np.stack([np.zeros_like(z), -half - z, half - z], axis=1)
        slant = np.hypot(h[:, None], across)
        size = _side_terms(across[:, None], slant[:, None], h, wavelength)[:, 0]
        size[:, 1:] *= np.sqrt(2) * h[:, None] ** 2 / (slant[:, 1:] ** 1.5 * np.sqrt(slant[:, 1:] + h[:, None]))
        size[sphere] = [1.0, 0.0, 0.0]
        spread = radius / (radius + h)
        size *= (wavelength / (8 * np.pi * h) * np.where(sphere, spread, np.sqrt(spread)))[:, None]
        size *= self.layer[near, HEAD_ON, None]
        b, part = np.nonzero((np.abs(size) * observation.peak_gain**2 > observation.threshold) & (slant < reach))
        along = np.stack([np.where(sphere, 0, z), -half, half], axis=1)[b, part]
        point = line[b] + along[:, None] * axis[b]
        amplitude = size[b, part] * _gains((point - position) @ observation.rotation[frame], observation) ** 2
        keep = np.abs(amplitude) > observation.threshold
        b, part, point, amplitude = b[keep], part[keep], point[keep], amplitude[keep]
        turned = axis[b] * (part == 0)[:, None]
        matrix = 2 * np.einsum("pd,pe->pde", turned, turned) - np.eye(3)
        shift = point - np.einsum("pde,pe->pd", matrix, point)
        inward = np.array([0.0, 1.0, -1.0])[part] * np.minimum(0.01, half[b])
        isometry = np.concatenate([matrix, shift[:, :, None]], axis=2)
        return Arcs(point + inward[:, None] * axis[b], isometry, amplitude, self.arcs(near[b], part))


@dataclass(frozen=True)
class Arcs(Table):
    """Flashes and ends of round bodies.

    Attributes:
        aim: a point for a ray to it to aim at, m.
        isometry: of the receiver, from the middle of the arrays.
        amplitude: square root of received over transmitted power, with phase.
        shape: `POINT`, a sphere or an end of a cylinder, or `LINE`, along a cylinder: a point of the axis, or the
            centre, m; the axis; radius, m; nought. Or `QUADRIC`: its point in the middle, m; a principal direction;
            nought; the normal; the curvatures along that direction and across, 1/m.
    """

    aim: Float[np.ndarray, "part 3"]
    isometry: Float[np.ndarray, "part 3 4"]
    amplitude: Complex[np.ndarray, "part"]
    shape: Float[np.ndarray, "part 13"]


@njit
def path_over(shape, one, two):
    """Length of the shortest way over a round body between two places beside one another, m."""
    pivot, axis, radius = vec(shape[1:4]), vec(shape[4:7]), shape[7]
    if shape[0] == QUADRIC:
        return stationary((pivot, axis, vec(shape[8:11]), shape[11], shape[12]), one, two)[1]
    a, b = minus(one, pivot), minus(two, pivot)
    a, b = moved(a, -dot(a, axis), axis), moved(b, -dot(b, axis), axis)
    n = unit(moved(unit(a), 1.0, unit(b)))
    for _ in range(3):
        n = unit(moved(unit(moved(a, -radius, n)), 1.0, unit(moved(b, -radius, n))))
    place = moved(pivot, radius, n)
    if shape[0] == LINE:
        return length(minus(one, mirrored(two, place, n)))
    return length(minus(one, place)) + length(minus(two, place))


@njit
def facing_point(shape, place):
    """The point of a curved surface that faces a place, m."""
    pivot, axis, radius = vec(shape[1:4]), vec(shape[4:7]), shape[7]
    if shape[0] == QUADRIC:
        return stationary((pivot, axis, vec(shape[8:11]), shape[11], shape[12]), place, place)[0]
    a = minus(place, pivot)
    height = dot(a, axis)
    foot = moved(pivot, height, axis) if shape[0] == LINE else pivot
    return moved(foot, radius, unit(moved(a, -height, axis)))


@njit
def stationary(quadric, one, two):
    """Where a way between two places over a quadric is stationary, by Newton's steps.

    Args:
        quadric: point, principal direction, normal, curvatures along the direction and across it (1/m).

    Returns:
        the place there, m; the way's length, m; its Hessian over the two directions, 1/m, as h11, h22, h12; and that of
        an endless plane.
    """
    point, axis, normal, bend1, bend2 = quadric
    across = cross(normal, axis)
    u1, u2 = 0.0, 0.0
    for step in range(4):
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
        h11, h22, h12 = p11 + slope * bend1, p22 + slope * bend2, p12
        # near a caustic the place hardly matters
        det = h11 * h22 - h12 * h12
        if step == 3 or abs(det) < 0.01 * p11 * p22:
            break
        g1, g2 = a1 + b1, a2 + b2
        u1 += (h22 * g1 - h12 * g2) / det
        u2 += (h11 * g2 - h12 * g1) / det
    return place, r1 + r2, (h11, h22, h12), (p11, p22, p12)


def _side_terms(
    across: Float[np.ndarray, "facet side 3"], slant: Float[np.ndarray, "facet side 3"], h: Float[np.ndarray, "facet"],
    wavelength: float,
) -> Complex[np.ndarray, "facet side 3"]:  # fmt: skip
    """Interior and edge terms of the Fresnel integral along each side, phases referred to the part's own path."""
    u = 2 * np.sqrt(2 * np.maximum(slant - h[:, None, None], 0) / wavelength)
    sine, cosine = fresnel(u)
    edge = 0.5 - (cosine + 1j * sine) / (1 + 1j)
    edge = edge * np.exp(-0.5j * np.pi * u**2)
    terms = np.empty(across.shape, complex)
    sign = np.where(across >= 0, 1, -1)  # +1 on the edge itself, for both of two abutting plates
    terms[..., 0] = (sign[..., 2] - sign[..., 1]) / 2
    terms[..., 1] = sign[..., 1] * edge[..., 1]
    terms[..., 2] = -sign[..., 2] * edge[..., 2]
    return terms


@njit(cache=True)
def _gains(directions, pattern):
    out = np.empty(len(directions))
    for i in range(len(directions)):
        out[i] = amplitude_gain(directions[i, 0], directions[i, 1], directions[i, 2], pattern)
    return out
