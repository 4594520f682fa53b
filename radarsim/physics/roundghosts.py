"""Spheres and cylinders seen over mirrors: specular ghosts of round bodies, out on one way and back on another.

Seen through the mirrors of its two ways, the radar sends from one image and receives at another. Between the two, light
takes the shortest way over the body, by the point P whose normal halves the angle. Its strength follows from how the
path's length grows about P (stationary phase): an endless plane there would have 1 / (r_1 + r_2) and the Hessian
H_0 = (1 / r_1 + 1 / r_2) (1 - t t'), t the tangential part of the direction; a body of curvature C has

    1 / (r_1 + r_2) sqrt(det H_0 / det H),  H = H_0 + 2 cos(theta) C,

geometric optics with its caustics (Deschamps, Proc. IEEE 60(9), 1972). A cylinder's ends cut Fresnel's integral along
its axis.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int, UInt8

from radarsim.physics.amplitudes import gain_towards, reflected, unit, upright
from radarsim.physics.apertures import STRIP_FAR, strip
from radarsim.physics.curved import RoundBodies
from radarsim.physics.echoes import Provenance
from radarsim.physics.obstacles import Obstacles
from radarsim.physics.reflectors import Flat
from radarsim.physics.search import Search
from radarsim.physics.sight import Mirrors
from radarsim.physics.table import Table

#: Steps to the point between two images; each shrinks the error by at least the share of the radius in the distance.
STEPS = 12


@dataclass(frozen=True)
class RoundGhosts(Table):
    """Echoes of round bodies by way of mirrors.

    Attributes:
        points: P as seen through the mirrors of its ways out and back, m.
        stops: place of reflection and P, out and back (P twice on a straight way), m.
        bounces: mirrors on both ways, 1 or 2.
        amplitude: square root of received over transmitted power, with phase.
    """

    points: Float[np.ndarray, "ghost 2 3"]
    stops: Float[np.ndarray, "ghost 2 2 3"]
    bounces: Int[np.ndarray, "ghost"]
    amplitude: Complex[np.ndarray, "ghost"]

    @property
    def cause(self) -> UInt8[np.ndarray, "ghost"]:
        """A `Provenance` each."""
        return np.where(self.bounces == 1, Provenance.GHOST_1, Provenance.GHOST_2).astype(np.uint8)


def seen(search: Search, flat: Flat, mirrors: list[Mirrors], bodies: RoundBodies, obstacles: Obstacles) -> list:
    """Ghosts in each frame that nothing hides; slabs are opaque to them."""
    found = [find(search, k, flat, some.seen, bodies) for k, some in enumerate(mirrors)]
    frame, every = np.repeat(np.arange(len(found)), [len(f) for f in found]), RoundGhosts.joined(found)
    clear, never = np.ones(len(every), bool), np.zeros(len(every), bool)
    for way in range(2):
        factor, _ = obstacles.way(search, frame, every.stops[:, way], np.full(len(every), 2), never)
        clear &= factor != 0
    return [every[clear & (frame == k)] for k in range(search.frames)]


def _dot(a, b):
    return np.einsum("...d,...d->...", a, b)


def _units(a):
    return a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-12)


def _ways(search: Search, frame: int, flat: Flat, seen, bodies: RoundBodies):
    """Bodies, mirrors (-1: none) and images of the radar of all ways that may lead to a body."""
    p, reach = search.position[frame], search.range
    size = bodies.radius + bodies.half
    near = np.flatnonzero(np.linalg.norm(bodies.center - p, axis=1) - size < reach)
    center, normal = flat.center[seen], flat.normal[seen]
    height = _dot(p - center, normal)
    image = p - 2 * height[:, None] * normal
    level = _dot(bodies.center[near, None] - center, normal) * np.sign(height)
    share = np.abs(height) / (np.abs(height) + np.maximum(level, 1e-3))
    at = image + share[..., None] * (bodies.center[near, None] - image) - center
    spare = size[near, None] * share + STRIP_FAR * np.sqrt(search.wavelength * reach / 8) + 0.1
    ok = (level > 0.01) & (np.abs(height) > 0.01)
    for axis, half in ((flat.u[seen], flat.half[seen, 0]), (flat.v[seen], flat.half[seen, 1])):
        ok &= np.abs(_dot(at, axis)) < half + spare
    body, way = np.nonzero(ok)
    return (
        np.append(near, near[body]),
        np.append(np.full(len(near), -1), seen[way]),
        np.concatenate([np.tile(p, (len(near), 1)), image[way]]),
    )


def _between(bodies: RoundBodies, b, one, two):
    """The point of each body between two places, its normal there, and how far it lies along the axis."""
    axis, radius = bodies.axis[b], bodies.radius[b, None]
    a, c = one - bodies.center[b], two - bodies.center[b]
    z_a, z_c = _dot(a, axis), _dot(c, axis)
    a, c = a - z_a[:, None] * axis, c - z_c[:, None] * axis
    n = _units(_units(a) + _units(c))
    for _ in range(STEPS):
        n = _units(_units(a - radius * n) + _units(c - radius * n))
    near, far = np.linalg.norm(a - radius * n, axis=1), np.linalg.norm(c - radius * n, axis=1)
    z = z_a + (z_c - z_a) * near / (near + far)
    return bodies.center[b] + radius * n + z[:, None] * axis, n, z


def _spread(bodies: RoundBodies, b, n, there, back, r1, r2):
    """sqrt(det H_0 / det H) / (r_1 + r_2), and the curvature of the path along the axis once the other is summed."""
    flat_on = np.abs(n[:, 2]) < 0.9
    aside = np.cross(n, np.where(flat_on[:, None], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]))
    round_ = bodies.half[b] == 0
    along = np.where(round_[:, None], _units(aside), bodies.axis[b])
    around = np.cross(n, along)
    cosine, curvature = np.maximum(_dot(n, -there), 1e-3), 1 / r1 + 1 / r2
    t1, t2 = _dot(there, around), _dot(there, along)
    h11, h22, h12 = curvature * (1 - t1 * t1), curvature * (1 - t2 * t2), -curvature * t1 * t2
    before = h11 * h22 - h12 * h12
    bend = 2 * cosine / bodies.radius[b]
    h11, h22 = h11 + bend, h22 + np.where(round_, bend, 0)
    return np.sqrt(before / (h11 * h22 - h12 * h12)) / (r1 + r2), h22 - h12 * h12 / h11


def find(search: Search, frame: int, flat: Flat, seen: Int[np.ndarray, "n"], bodies: RoundBodies) -> RoundGhosts:
    """Ghosts over a mirror on one way or on both, above the threshold, not yet tested for what is in the way."""
    p, rotation = search.position[frame], search.rotation[frame]
    body, mirror, image = _ways(search, frame, flat, seen, bodies)
    one, two = np.nonzero((body[:, None] == body) & ((mirror[:, None] >= 0) | (mirror >= 0)))
    b = body[one]
    place, n, z = _between(bodies, b, image[one], image[two])
    there, back = place - image[one], place - image[two]
    r1, r2 = np.linalg.norm(there, axis=1), np.linalg.norm(back, axis=1)
    there, back = there / r1[:, None], back / r2[:, None]
    size, bend = _spread(bodies, b, n, there, back, r1, r2)
    size *= search.wavelength / (4 * np.pi)
    lit = (_dot(n, there) < -1e-3) & (_dot(n, back) < -1e-3) & (r1 + r2 < 2 * search.range)
    lit &= size * search.peak_gain**2 > search.threshold
    unit_z = np.sqrt(search.wavelength / (2 * bend))
    lit &= (bodies.half[b] == 0) | (np.abs(z) < bodies.half[b] + STRIP_FAR * unit_z)
    found = []
    for k in np.flatnonzero(lit):
        ways = []
        value = complex(size[k])
        if bodies.half[b[k]] > 0:
            value *= strip((-bodies.half[b[k]] - z[k]) / unit_z[k], (bodies.half[b[k]] - z[k]) / unit_z[k])
        for end, far in ((one[k], r1[k]), (two[k], r2[k])):
            stop, seen_at, share = _over(search, flat, mirror[end], image[end], place[k], far)
            value *= share * gain_towards(tuple(stop - p), rotation, search)
            ways.append((stop, seen_at))
        if abs(value) <= search.threshold:
            continue
        bounces = [(mirror[end], way[0]) for end, way in zip((one[k], two[k]), ways, strict=True)]
        course = [p, *(stop for m, stop in bounces[:1] if m >= 0), place[k], *(s for m, s in bounces[1:] if m >= 0), p]
        met = [(flat.normal[m], flat.reflection[m]) for m, _ in bounces if m >= 0]
        met.insert(int(bounces[0][0] >= 0), (n[k], bodies.reflection[b[k]]))
        value *= _polarisation(tuple(rotation[:, 2]), course, met)
        if abs(value) > search.threshold:
            clear = place[k] + 2e-3 * n[k]
            ends = zip((one[k], two[k]), ways, strict=True)
            stops = [[way[0] if mirror[end] >= 0 else clear, clear] for end, way in ends]
            found.append(([way[1] for way in ways], stops, int(mirror[one[k]] >= 0) + int(mirror[two[k]] >= 0), value))
    if not found:
        return RoundGhosts(np.zeros((0, 2, 3)), np.zeros((0, 2, 2, 3)), np.zeros(0, int), np.zeros(0, complex))
    return RoundGhosts(*(np.array(column) for column in zip(*found, strict=True)))


def _over(search: Search, flat: Flat, m: int, image, place, far: float):
    """Where the way to a place leaves for, where the place is seen, and what the mirror's aperture passes."""
    if m < 0:
        return place, place, 1.0
    center, normal = flat.center[m], flat.normal[m]
    h, level = abs(_dot(image - center, normal)), abs(_dot(place - center, normal))
    share = h / (h + level)
    way = (place - image) / far
    stop = image + share * far * way
    aside, cosine = _dot(way, flat.u[m]), abs(_dot(way, normal))
    across = np.sqrt(max(1 - aside**2, 1e-6))
    size = np.sqrt(0.5 * search.wavelength * far * share * (1 - share)) + 1e-12
    passed = 1.0
    units = size / across, size * across / max(cosine, 1e-3)
    for axis, half, unit_ in zip((flat.u[m], flat.v[m]), flat.half[m], units, strict=True):
        at = _dot(stop - center, axis)
        passed *= strip((-half - at) / unit_, (half - at) / unit_)
    return stop, place - 2 * _dot(place - center, normal) * normal, passed


def _polarisation(up, course, surfaces) -> complex:
    """Product of the reflection coefficients over surfaces (normal, table), an upright field sent and taken."""
    steps = [unit(tuple(after - before)) for before, after in zip(course, course[1:], strict=False)]
    field = tuple(complex(x) for x in upright(up, steps[0]))
    for now, after, (normal, table) in zip(steps, steps[1:], surfaces, strict=False):
        field = reflected(field, now, after, tuple(normal), table)
    return sum(f * t for f, t in zip(field, upright(up, steps[-1]), strict=True))
