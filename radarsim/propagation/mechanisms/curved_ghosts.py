"""Curved reflectors seen over mirrors: specular ghosts of theirs, out on one way and back on another.

Seen through the mirrors of its two ways, the radar sends from one image and receives at another. Between the two, light
takes the shortest way over the body, by the point P whose normal halves the angle. Its strength follows from how the
path's length grows about P (stationary phase): an endless plane there would have 1 / (r_1 + r_2) and the Hessian
H_0 = (1 / r_1 + 1 / r_2) (1 - t t'), t the tangential part of the direction; a body of curvature C has

    1 / (r_1 + r_2) sqrt(det H_0 / det H),  H = H_0 + 2 cos(theta) C,

geometric optics with its caustics (Deschamps, Proc. IEEE 60(9), 1972). A cylinder's ends cut Fresnel's integral along
its axis, and borders that of other smooth surfaces (`patches`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit

from radarsim.propagation.apertures import STRIP_FAR, aperture, passes, strip
from radarsim.propagation.environment import View
from radarsim.propagation.fields import (
    along,
    cross,
    dot,
    gain_towards,
    length,
    minus,
    mirrored,
    reflected,
    sent,
    unit,
    upright,
    upwards,
    write,
)
from radarsim.propagation.fields import vector as vec
from radarsim.propagation.fresnelzone import LEAST_LOSS
from radarsim.propagation.observation import Observation
from radarsim.propagation.patches import strength
from radarsim.propagation.paths import Kind, Paths
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.table import Table, filled

#: Steps to the point between two images; each shrinks the error by at least the share of the radius in the distance.
STEPS = 12
#: Rays to a cylinder aim at least this far inside the part of it that is lit, m: a leg's end is in the floor.
_INSIDE = 0.01


@dataclass(frozen=True)
class RoundGhosts(Table):
    """Echoes of round bodies by way of mirrors.

    Attributes:
        points: P as seen through the mirrors of its ways out and back, m.
        stops: place of reflection and P, out and back (P twice on a straight way), m.
        mirrors: out and back, as indices of flat reflectors; -1: straight.
        amplitude: square root of received over transmitted power, with phase.
    """

    points: Float[np.ndarray, "ghost 2 3"]
    stops: Float[np.ndarray, "ghost 2 2 3"]
    mirrors: Int[np.ndarray, "ghost 2"]
    amplitude: Complex[np.ndarray, "ghost"]

    @property
    def bounces(self) -> Int[np.ndarray, "ghost"]:
        """Mirrors on both ways, 1 or 2."""
        return (self.mirrors >= 0).sum(axis=1)


def find(view: View) -> Paths:
    """Ghosts above the threshold that nothing hides, weakened and delayed where they pass slabs."""
    observation, flat, reflectors = view.observation, view.flat, view.environment.reflectors
    if reflectors is None:
        return Paths.none()
    found = [ghosts(observation, k, flat, some.seen, reflectors) for k, some in enumerate(view.mirrors)]
    frame, every = np.repeat(np.arange(len(found)), [len(f) for f in found]), RoundGhosts.joined(found)
    n = 2 * len(every)
    allowed = np.repeat(np.abs(every.amplitude) > LEAST_LOSS * observation.threshold, 2)
    passed = view.obstacles.way(
        observation, np.repeat(frame, 2), every.stops.reshape(n, 2, 3), np.full(n, 2), allowed
    )  # fmt: skip
    here = observation.position[frame, None]
    away = every.points - here  # a delay moves the point away
    points = here + away * (1 + passed.delay.reshape(-1, 2, 1) / np.linalg.norm(away, axis=2, keepdims=True))
    mirrors = np.full((len(every), 4), -1)
    mirrors[:, [0, 2]] = every.mirrors
    paths = Paths.of(Kind.POINT, points, every.amplitude, frame=frame, bounces=every.bounces, mirrors=mirrors)
    return paths.behind(observation, passed.after_one_another(np.arange(0, n, 2)))


def ghosts(
    observation: Observation, frame: int, flat: Flat, seen: Int[np.ndarray, "n"], reflectors: Reflectors
) -> RoundGhosts:
    """Ghosts over a mirror on one way or on both, above the threshold, not yet tested for what is in the way."""
    curved = reflectors.round.columns, reflectors.smooth
    return filled(
        lambda n: RoundGhosts(
            np.empty((n, 2, 3)), np.empty((n, 2, 2, 3)), np.empty((n, 2), np.int64), np.empty(n, complex)
        ),
        lambda found: _find(observation, frame, flat.columns, seen, curved, found.columns),
        256,
    )


@njit(cache=True)
def _find(observation, frame, flat, seen, curved, found):
    """Returns how many there are, of which as many as fit are written."""
    p, count = vec(observation.position[frame]), 0
    mirrors, images = np.empty(len(seen) + 1, np.int64), np.empty((len(seen) + 1, 3))
    bodies, patches = curved
    for b in range(len(bodies.radius)):
        ball = vec(bodies.center[b]), bodies.radius[b] + bodies.half[b]
        ways = _ways(observation, p, flat, seen, ball, (mirrors, images))
        for i in range(ways):
            for j in range(max(i, 1), ways):
                way = mirrors[i], vec(images[i]), mirrors[j], vec(images[j])
                place, aim, n, size = _strength(observation, flat, bodies, b, way)
                count += _add(observation, frame, flat, way, (place, aim, n, size, bodies.layer[b]), (found, count))
    for k in range(len(patches.ball)):
        ways = _ways(observation, p, flat, seen, (vec(patches.ball[k]), patches.ball[k, 3]), (mirrors, images))
        for i in range(ways):
            for j in range(max(i, 1), ways):
                for turn in range(2 if patches.two_sided[k] else 1):
                    of, way = (k, 1.0 - 2.0 * turn), (mirrors[i], vec(images[i]), mirrors[j], vec(images[j]))
                    aim, quadric, place, size = strength(observation, patches, of, way[1], way[3])
                    echo = place, aim, quadric[2], size, patches.layer[k]
                    count += _add(observation, frame, flat, way, echo, (found, count))
    return count


@njit
def _add(observation, frame, flat, way, echo, found):
    """Write an echo, either way round, if it is strong enough; how many that makes.

    Args:
        observation, frame, flat: of `_find`.
        way: mirrors and images of the radar out and back.
        echo: place P, a lit point for rays to aim at, normal, amplitude from image to image, layer.
        found: ghosts so far, and how many.
    """
    one, source, two, sink = way
    place, aim, n, size, layer = echo
    ghosts, count = found
    if abs(size) * observation.peak_gain**2 <= observation.threshold:
        return 0
    if not (_before(flat, one, source, aim) and _before(flat, two, sink, aim)):
        return 0
    out, back = _over(observation, frame, flat, one, source, aim), _over(observation, frame, flat, two, sink, aim)
    value = size * out[1] * back[1]
    if abs(value) <= observation.threshold:
        return 0
    value *= _polarisation(upwards(observation.rotation[frame]), flat, way, aim, n, layer)
    if abs(value) <= observation.threshold:
        return 0
    clear, ways = along(aim, 2e-3, n), 1 if one == two else 2
    for swapped in range(ways):
        row = count + swapped
        if row < len(ghosts.amplitude):
            ghosts.amplitude[row] = value
            for end in range(2):
                leg, m = (out, one) if end == swapped else (back, two)
                ghosts.mirrors[row, end] = m
                write(_seen(flat, m, place), ghosts.points[row, end])
                write(leg[0] if m >= 0 else clear, ghosts.stops[row, end, 0])
                write(clear, ghosts.stops[row, end, 1])
    return ways


@njit
def _ways(observation, p, flat, seen, ball, ways):
    """Mirrors (-1: none, the first) and images of the radar of all ways that may lead into a ball; returns how many."""
    mirrors, images = ways
    center, size = ball
    if length(minus(center, p)) - size > observation.range:
        return 0
    mirrors[0], count = -1, 1
    write(p, images[0])
    for m in seen:
        c, n = vec(flat.center[m]), vec(flat.normal[m])
        height = dot(minus(p, c), n)
        level = dot(minus(center, c), n) * (1.0 if height > 0 else -1.0)
        if abs(height) < 0.01 or level + size < 0.01:
            continue
        source = along(p, -2 * height, n)
        share = abs(height) / (abs(height) + max(level, 0.0))
        at = minus(along(source, share, minus(center, source)), c)
        spare = size * share + STRIP_FAR * np.sqrt(observation.wavelength * observation.range / 8) + 0.1
        if (
            abs(dot(at, vec(flat.u[m]))) < flat.half[m, 0] + spare
            and abs(dot(at, vec(flat.v[m]))) < flat.half[m, 1] + spare
        ):
            mirrors[count] = m
            write(source, images[count])
            count += 1
    return count


@njit
def _strength(observation, flat, bodies, b, way):
    """The specular point of a body between two images of the radar, a lit point near it for rays to aim at, the normal
    there, and the amplitude that an isotropic antenna gets from one image to the other."""
    radius, half, axis, none = bodies.radius[b], bodies.half[b], vec(bodies.axis[b]), (0.0, 0.0, 0.0)
    first, one, second, two = way
    a, c = minus(one, vec(bodies.center[b])), minus(two, vec(bodies.center[b]))
    z_a, z_c = dot(a, axis), dot(c, axis)
    a, c = along(a, -z_a, axis), along(c, -z_c, axis)
    n = unit(along(unit(a), 1.0, unit(c)))
    for _ in range(STEPS):
        n = unit(along(unit(along(a, -radius, n)), 1.0, unit(along(c, -radius, n))))
    near, far = length(along(a, -radius, n)), length(along(c, -radius, n))
    z = z_a + (z_c - z_a) * near / (near + far)
    line = along(vec(bodies.center[b]), radius, n)
    place = along(line, z, axis)
    there, back = minus(place, one), minus(place, two)
    r1, r2 = length(there), length(back)
    there, back = unit(there), unit(back)
    cosine = -dot(n, there)
    if cosine < 1e-3 or dot(n, back) > -1e-3 or r1 + r2 > 2 * observation.range:
        return none, none, none, 0j
    # Hessians of the path over the tangent plane, of a plane there and of the body
    side = axis if half > 0 else unit(cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.9 else (1.0, 0.0, 0.0)))
    curvature, bend = 1 / r1 + 1 / r2, 2 * cosine / radius
    t1, t2 = dot(there, cross(n, side)), dot(there, side)
    h11, h22, h12 = curvature * (1 - t1 * t1), curvature * (1 - t2 * t2), -curvature * t1 * t2
    plane = h11 * h22 - h12 * h12
    h11, h22 = h11 + bend, h22 + (0.0 if half > 0 else bend)
    size = observation.wavelength / (4 * np.pi * (r1 + r2)) * np.sqrt(plane / (h11 * h22 - h12 * h12)) + 0j
    if half == 0:
        return place, place, n, size
    zone = np.sqrt(observation.wavelength / (2 * (h22 - h12 * h12 / h11)))
    low, high = _above(flat, second, two, line, axis, _above(flat, first, one, line, axis, (-half, half)))
    if low >= high or z <= low - STRIP_FAR * zone or z >= high + STRIP_FAR * zone:
        return none, none, none, 0j
    inside = min(_INSIDE, (high - low) / 2)
    aim = along(line, min(max(z, low + inside), high - inside), axis)
    return place, aim, n, size * strip((low - z) / zone, (high - z) / zone)


@njit
def _above(flat, m, image, line, axis, span):
    """What of a span along a line lies before a mirror, on the side from which the radar of that image sees it."""
    if m < 0:
        return span
    c, n = vec(flat.center[m]), vec(flat.normal[m])
    turn = -1.0 if dot(minus(image, c), n) > 0 else 1.0
    level, rise, (low, high) = turn * dot(minus(line, c), n), turn * dot(axis, n), span
    if abs(rise) < 1e-9:
        return span if level > 0 else (low, low)
    return (max(low, -level / rise), high) if rise > 0 else (low, min(high, -level / rise))


@njit
def _before(flat, m, image, place):
    """Whether a place is before a mirror, where its light gets to."""
    if m < 0:
        return True
    c, n = vec(flat.center[m]), vec(flat.normal[m])
    return dot(minus(image, c), n) * dot(minus(place, c), n) < 0


@njit
def _seen(flat, m, place):
    """Where a place is seen over a mirror, or straight."""
    return place if m < 0 else mirrored(place, vec(flat.center[m]), vec(flat.normal[m]))


@njit
def _over(observation, frame, flat, m, source, place):
    """Where a way to a place leaves for, and gain times what the mirror's aperture passes."""
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    if m < 0:
        return place, gain_towards(minus(place, p), rotation, observation) + 0j
    center, normal = vec(flat.center[m]), vec(flat.normal[m])
    h, level = abs(dot(minus(source, center), normal)), abs(dot(minus(place, center), normal))
    share, far = h / (h + level), length(minus(place, source))
    stop = along(source, share, minus(place, source))
    square = 0.5 * observation.wavelength * far * share * (1 - share)
    value = passes(stop, unit(minus(place, source)), square, aperture(flat, m))
    return stop, value * gain_towards(minus(stop, p), rotation, observation)


@njit
def _polarisation(up, flat, way, place, n, layer):
    """Product of the reflection coefficients, an upright field sent and taken.

    Directions are those from the images: where the body stands on the mirror, both reflections are at one place.

    Args:
        up: of the board.
        flat, way: mirrors and images of the radar out and back.
        place, n, layer: of the body.
    """
    one, source, two, sink = way
    there, back = unit(minus(place, source)), unit(minus(sink, place))
    first, last = _turned(flat, one, there), _turned(flat, two, back)
    field = sent(up, first)
    if one >= 0:
        field = reflected(field, first, there, vec(flat.normal[one]), flat.layer[one])
    field = reflected(field, there, back, n, layer)
    if two >= 0:
        field = reflected(field, back, last, vec(flat.normal[two]), flat.layer[two])
    return dot(field, upright(up, last))


@njit
def _turned(flat, m, way):
    """A direction beyond a mirror, or the same."""
    return way if m < 0 else mirrored(way, (0.0, 0.0, 0.0), vec(flat.normal[m]))
