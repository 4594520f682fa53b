"""Curved reflectors seen over mirrors: specular ghosts of theirs, out on one way and back on another.

Seen through the mirrors of its two ways, the radar sends from one image and receives at another. Between the two, light
takes the shortest way over the body, by the point P whose normal halves the angle. Its strength follows from how the
path's length grows about P (stationary phase): an endless plane there would have 1 / (r_1 + r_2) and the Hessian
H_0 = (1 / r_1 + 1 / r_2) (1 - t t'), t the tangential part of the direction; a body of curvature C has

    1 / (r_1 + r_2) sqrt(det H_0 / det H),  H = H_0 + 2 cos(theta) C,

geometric optics with its caustics (Deschamps, Proc. IEEE 60(9), 1972). A cylinder's ends cut Fresnel's integral along
its axis, and borders that of other smooth surfaces (`patches`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit

from radarsim.propagation.apertures import STRIP_FAR, aperture, passes, strip
from radarsim.propagation.echoes import Provenance
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
from radarsim.propagation.obstacles import Obstacles
from radarsim.propagation.patches import strength
from radarsim.propagation.pointechoes import PointEchoes
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.table import Table, filled
from radarsim.propagation.visible_mirrors import Mirrors

#: Steps to the point between two images; each shrinks the error by at least the share of the radius in the distance.
STEPS = 12


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


def seen(
    observation: Observation, flat: Flat, mirrors: list[Mirrors], reflectors: Reflectors, obstacles: Obstacles
) -> PointEchoes:
    """Ghosts that nothing hides, weakened and delayed where they pass slabs."""
    found = [find(observation, k, flat, some.seen, reflectors) for k, some in enumerate(mirrors)]
    frame, every = np.repeat(np.arange(len(found)), [len(f) for f in found]), RoundGhosts.joined(found)
    n = 2 * len(every)
    allowed = np.abs(every.amplitude) > LEAST_LOSS * observation.threshold
    factor, delay = obstacles.way(
        observation, np.repeat(frame, 2), every.stops.reshape(n, 2, 3), np.full(n, 2), np.repeat(allowed, 2)
    )
    amplitude = every.amplitude * factor.reshape(-1, 2).prod(axis=1)
    away = every.points - observation.position[frame, None]  # a delay moves the point away
    away *= 1 + delay.reshape(-1, 2, 1) / np.linalg.norm(away, axis=2, keepdims=True)
    every = replace(every, amplitude=amplitude, points=observation.position[frame, None] + away)
    heard = np.abs(amplitude) > observation.threshold
    frame, every, passes = frame[heard], every[heard], (factor != 1).reshape(-1, 2).any(axis=1)[heard]
    cause = np.where(every.bounces == 1, Provenance.GHOST_1, Provenance.GHOST_2).astype(np.uint8)
    cause[passes] = Provenance.THROUGH_SLAB
    mirrors = np.stack([every.mirrors, np.full_like(every.mirrors, -1)], axis=2)
    return PointEchoes(frame, every.points, mirrors, np.full(len(frame), -1), every.amplitude, cause)


def find(
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
                place, n, size = _strength(observation, bodies, b, vec(images[i]), vec(images[j]))
                way = mirrors[i], vec(images[i]), mirrors[j], vec(images[j])
                count += _add(
                    observation, frame, flat, way, (place, place, n, size, bodies.reflection[b]), (found, count)
                )
    for k in range(len(patches.ball)):
        ways = _ways(observation, p, flat, seen, (vec(patches.ball[k]), patches.ball[k, 3]), (mirrors, images))
        for i in range(ways):
            for j in range(max(i, 1), ways):
                for turn in range(2 if patches.two_sided[k] else 1):
                    of, way = (k, 1.0 - 2.0 * turn), (mirrors[i], vec(images[i]), mirrors[j], vec(images[j]))
                    aim, quadric, place, size = strength(observation, patches, of, way[1], way[3])
                    echo = place, aim, quadric[2], size, patches.reflection[k]
                    count += _add(observation, frame, flat, way, echo, (found, count))
    return count


@njit
def _add(observation, frame, flat, way, echo, found):
    """Write an echo, either way round, if it is strong enough; how many that makes.

    Args:
        observation, frame, flat: of `_find`.
        way: mirrors and images of the radar out and back.
        echo: place, a point for rays to aim at, normal, amplitude from image to image, reflection.
        found: ghosts so far, and how many.
    """
    one, source, two, sink = way
    place, aim, n, size, reflection = echo
    ghosts, count = found
    if abs(size) * observation.peak_gain**2 <= observation.threshold:
        return 0
    out, back = _over(observation, frame, flat, one, source, place), _over(observation, frame, flat, two, sink, place)
    value = size * out[2] * back[2]
    if abs(value) <= observation.threshold:
        return 0
    value *= _polarisation(observation, frame, flat, ((one, out[0]), (two, back[0])), place, n, reflection)
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
                write(leg[1], ghosts.points[row, end])
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
        if abs(height) < 0.01 or level < 0.01:
            continue
        source = along(p, -2 * height, n)
        share = abs(height) / (abs(height) + level)
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
def _strength(observation, bodies, b, one, two):
    """The point of a body between two places, its normal there, and the amplitude that an isotropic antenna gets from
    one place to the other."""
    radius, half, axis, none = bodies.radius[b], bodies.half[b], vec(bodies.axis[b]), (0.0, 0.0, 0.0)
    a, c = minus(one, vec(bodies.center[b])), minus(two, vec(bodies.center[b]))
    z_a, z_c = dot(a, axis), dot(c, axis)
    a, c = along(a, -z_a, axis), along(c, -z_c, axis)
    n = unit(along(unit(a), 1.0, unit(c)))
    for _ in range(STEPS):
        n = unit(along(unit(along(a, -radius, n)), 1.0, unit(along(c, -radius, n))))
    near, far = length(along(a, -radius, n)), length(along(c, -radius, n))
    z = z_a + (z_c - z_a) * near / (near + far)
    place = along(along(vec(bodies.center[b]), radius, n), z, axis)
    there, back = minus(place, one), minus(place, two)
    r1, r2 = length(there), length(back)
    there, back = unit(there), unit(back)
    cosine = -dot(n, there)
    if cosine < 1e-3 or dot(n, back) > -1e-3 or r1 + r2 > 2 * observation.range:
        return none, none, 0j
    # Hessians of the path over the tangent plane, of a plane there and of the body
    side = axis if half > 0 else unit(cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.9 else (1.0, 0.0, 0.0)))
    curvature, bend = 1 / r1 + 1 / r2, 2 * cosine / radius
    t1, t2 = dot(there, cross(n, side)), dot(there, side)
    h11, h22, h12 = curvature * (1 - t1 * t1), curvature * (1 - t2 * t2), -curvature * t1 * t2
    plane = h11 * h22 - h12 * h12
    h11, h22 = h11 + bend, h22 + (0.0 if half > 0 else bend)
    size = observation.wavelength / (4 * np.pi * (r1 + r2)) * np.sqrt(plane / (h11 * h22 - h12 * h12)) + 0j
    if half > 0:
        zone = np.sqrt(observation.wavelength / (2 * (h22 - h12 * h12 / h11)))
        if abs(z) >= half + STRIP_FAR * zone:
            return none, none, 0j
        size *= strip((-half - z) / zone, (half - z) / zone)
    return place, n, size


@njit
def _over(observation, frame, flat, m, source, place):
    """Where a way to a place leaves for, where the place is seen, and gain times what the mirror's aperture passes."""
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    if m < 0:
        return place, place, gain_towards(minus(place, p), rotation, observation) + 0j
    center, normal = vec(flat.center[m]), vec(flat.normal[m])
    h, level = abs(dot(minus(source, center), normal)), abs(dot(minus(place, center), normal))
    share, far = h / (h + level), length(minus(place, source))
    stop = along(source, share, minus(place, source))
    square = 0.5 * observation.wavelength * far * share * (1 - share)
    value = passes(stop, unit(minus(place, source)), square, aperture(flat, m))
    return stop, mirrored(place, center, normal), value * gain_towards(minus(stop, p), rotation, observation)


@njit
def _polarisation(observation, frame, flat, ends, place, n, reflection):
    """Product of the reflection coefficients, an upright field sent and taken.

    Args:
        ends: mirror and stop, out and back.
        place, n, reflection: of the body.
    """
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    up = upwards(rotation)
    (m, stop), (last, end) = ends
    now = unit(minus(stop, p))
    field = sent(up, now)
    if m >= 0:
        after = unit(minus(place, stop))
        field = reflected(field, now, after, vec(flat.normal[m]), flat.reflection[m])
        now = after
    after = unit(minus(end if last >= 0 else p, place))
    field = reflected(field, now, after, n, reflection)
    now = after
    if last >= 0:
        after = unit(minus(p, end))
        field = reflected(field, now, after, vec(flat.normal[last]), flat.reflection[last])
        now = after
    return dot(field, upright(up, now))
