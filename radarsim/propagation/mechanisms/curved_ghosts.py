"""Specular reflections of curved bodies over mirrors: ghosts with different paths out and back.

Unfolded at the mirrors of its two paths, the radar transmits from one image and receives at another. Between the two,
the wave takes the shortest path over the body, by the point P whose normal bisects the angle. Its strength follows from
the Hessian of the path's length at P (stationary phase): an infinite plane there would have 1 / (r_1 + r_2) and the
Hessian H_0 = (1 / r_1 + 1 / r_2) (1 - t t'), t the tangential part of the direction; a body of curvature C has

    1 / (r_1 + r_2) sqrt(det H_0 / det H),  H = H_0 + 2 cos(theta) C,

geometric optics with its caustics (Deschamps, Proc. IEEE 60(9), 1972). A cylinder's ends truncate Fresnel's integral
along its axis, and borders that of other smooth surfaces (`patches`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit

from radarsim.propagation.apertures import STRIP_FAR, aperture, aperture_diffraction, outside_aperture, slit_diffraction
from radarsim.propagation.curved import grazes, growth, halving
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
    vec,
    write,
)  # fmt: skip
from radarsim.propagation.fresnelzone import LEAST_LOSS
from radarsim.propagation.mirror_images import images
from radarsim.propagation.observation import Observation
from radarsim.propagation.patches import strength
from radarsim.propagation.paths import Kind, Paths
from radarsim.propagation.reflectors import Flat, Reflectors
from radarsim.propagation.segments import Capsule, aim, clip, empty_segments, fill, matched
from radarsim.propagation.table import Table, filled

#: Iterations to the point between two images (`curved.halving`).
STEPS = 12


@dataclass(frozen=True)
class CurvedGhosts(Table):
    """Echoes of curved reflectors over mirrors.

    Attributes:
        points: P unfolded at the mirrors of its paths out and back, m.
        stops: point of reflection and P, out and back (P twice on a direct path), m.
        mirrors: out and back, as indices of flat reflectors; -1: direct.
        amplitude: square root of received over transmitted power, with phase.
    """

    points: Float[np.ndarray, "ghost 2 3"]
    stops: Float[np.ndarray, "ghost 2 2 3"]
    mirrors: Int[np.ndarray, "ghost 2"]
    amplitude: Complex[np.ndarray, "ghost"]

    @property
    def bounces(self) -> Int[np.ndarray, "ghost"]:
        """Number of mirrors on both paths, 1 or 2."""
        return (self.mirrors >= 0).sum(axis=1)


def find(view: View) -> Paths:
    """Find visible ghosts above the threshold, attenuated and delayed by slabs."""
    observation, flat, reflectors = view.observation, view.flat, view.environment.reflectors
    if reflectors is None:
        return Paths.zeros(0)
    found = [ghosts(observation, k, flat, some.seen, reflectors) for k, some in enumerate(view.mirrors)]
    frame, every = np.repeat(np.arange(len(found)), [len(f) for f in found]), CurvedGhosts.joined(found)
    n = 2 * len(every)
    allowed = np.repeat(np.abs(every.amplitude) > LEAST_LOSS * observation.threshold, 2)
    passed = view.obstacles.way(
        observation, np.repeat(frame, 2), every.stops.reshape(n, 2, 3), np.full(n, 2), allowed
    )  # fmt: skip
    here = observation.position[frame, None]
    away = every.points - here  # a delay shifts the point away
    points = here + away * (1 + passed.delay.reshape(-1, 2, 1) / np.linalg.norm(away, axis=2, keepdims=True))
    mirrors = np.full((len(every), 4), -1)
    mirrors[:, [0, 2]] = every.mirrors
    paths = Paths.of(Kind.POINT, points, every.amplitude, frame=frame, bounces=every.bounces, mirrors=mirrors)
    return paths.behind(observation, passed.after_one_another(np.arange(0, n, 2)))


def ghosts(
    observation: Observation, frame: int, flat: Flat, seen: Int[np.ndarray, "n"], reflectors: Reflectors
) -> CurvedGhosts:
    """Ghosts over a mirror on one path or on both, above the threshold, before visibility tests."""
    curved = reflectors.round.columns, reflectors.smooth
    return filled(CurvedGhosts, lambda found: _find(observation, frame, flat.columns, seen, curved, found.columns))


@njit(cache=True)
def _find(observation, frame, flat, seen, curved, found):
    """Return the number of ghosts; as many as fit are written."""
    count, segments, mirrored_radar = 0, empty_segments(len(seen) + 1), images(observation, frame, flat, seen)
    bodies, patches = curved
    for b in range(len(bodies.radius) + len(patches.ball)):
        k = b - len(bodies.radius)
        if k < 0:
            capsule, sides = Capsule(vec(bodies.center[b]), vec(bodies.axis[b]), bodies.half[b], bodies.radius[b]), 1
        else:
            capsule = Capsule(vec(patches.ball[k]), (0.0, 0.0, 0.0), 0.0, patches.ball[k, 3])
            sides = 2 if patches.two_sided[k] else 1
        total = fill(observation, frame, flat, mirrored_radar, capsule, segments)
        for i in range(total):
            for j in range(max(i, 1), total):
                if not matched(observation, capsule, segments, i, j):
                    continue
                way = segments.mirror[i], vec(segments.image[i]), segments.mirror[j], vec(segments.image[j])
                for turn in range(sides):
                    if k < 0:
                        place, lit, n, size = _strength(observation, flat, bodies, b, way)
                        layer = bodies.layer[b]
                    else:
                        lit, quadric, place, size = strength(
                            observation, patches, (k, 1.0 - 2.0 * turn), way[1], way[3]
                        )
                        n, layer = quadric[2], patches.layer[k]
                    count += _add(observation, frame, flat, way, (place, lit, n, size, layer), (found, count))
    return count


@njit
def _add(observation, frame, flat, way, echo, found):
    """Write an echo in both directions, if it is strong enough; return the number written.

    Args:
        observation, frame, flat: see `_find`.
        way: mirrors and images of the radar out and back.
        echo: point P, a lit point as the end of visibility rays, normal, amplitude from image to image, layer.
        found: ghosts so far, and their number.
    """
    (one, source, two, sink), p = way, vec(observation.position[frame])
    place, lit, n, size, layer = echo
    ghosts, count = found
    if abs(size) * observation.peak_gain**2 <= observation.threshold:
        return 0
    back = _stop(observation, flat, two, sink, lit)
    if not back[0]:
        return 0
    out = _stop(observation, flat, one, source, lit)
    if not out[0]:
        return 0
    for m, (_, stop, direction, square) in ((one, out), (two, back)):
        size *= gain_towards(minus(stop, p), observation.rotation[frame], observation)
        if m >= 0:
            size *= aperture_diffraction(stop, direction, square, aperture(flat, m))
    if abs(size) <= observation.threshold:
        return 0
    value = size * _polarisation(observation, frame, flat, way, (lit, n, layer))
    if abs(value) <= observation.threshold:
        return 0
    clear, ways = along(lit, 2e-3, n), 1 if one == two else 2
    for swapped in range(ways):
        row = count + swapped
        if row < len(ghosts.amplitude):
            ghosts.amplitude[row] = value
            for end in range(2):
                hop, m = (out, one) if end == swapped else (back, two)
                ghosts.mirrors[row, end] = m
                write(_seen(flat, m, place), ghosts.points[row, end])
                write(hop[1] if m >= 0 else clear, ghosts.stops[row, end, 0])
                write(clear, ghosts.stops[row, end, 1])
    return ways


@njit
def _strength(observation, flat, bodies, b, way):
    """Specular point of a body between two images of the radar, a lit point near it as the end of visibility rays, the
    normal there, and the amplitude from one image to the other for an isotropic antenna."""
    radius, half, axis, none = bodies.radius[b], bodies.half[b], vec(bodies.axis[b]), (0.0, 0.0, 0.0)
    (first, one, second, two), center = way, vec(bodies.center[b])
    n, a, c = halving((center, axis, radius), one, two, STEPS)
    z_a, z_c, share = dot(minus(one, center), axis), dot(minus(two, center), axis), length(a) / (length(a) + length(c))
    z = z_a + (z_c - z_a) * share
    line = along(center, radius, n)
    place = along(line, z, axis)
    side = axis if half > 0 else unit(cross(n, (0.0, 0.0, 1.0) if abs(n[2]) < 0.9 else (1.0, 0.0, 0.0)))
    surface = place, side, n, 0.0 if half > 0 else 1 / radius, 1 / radius
    _, path, (h11, h22, h12), plane, _ = growth(surface, (0.0, 0.0), one, two)
    if path > 2 * observation.range or grazes((place, n), one, two, 1e-3):
        return none, none, none, 0j
    spread = (plane[0] * plane[1] - plane[2] * plane[2]) / (h11 * h22 - h12 * h12)
    size = observation.wavelength / (4 * np.pi * path) * np.sqrt(spread) + 0j
    if half == 0:
        return place, place, n, size
    zone = np.sqrt(observation.wavelength / (2 * (h11 - h12 * h12 / h22)))
    low, high = _above(flat, second, two, line, axis, _above(flat, first, one, line, axis, (-half, half)))
    if low >= high or z <= low - STRIP_FAR * zone or z >= high + STRIP_FAR * zone:
        return none, none, none, 0j
    return place, along(line, aim(z, low, high), axis), n, size * slit_diffraction((low - z) / zone, (high - z) / zone)


@njit
def _above(flat, m, image, line, axis, span):
    """Part of a span along a line in front of a mirror, on the side from which the radar of that image sees it."""
    if m < 0:
        return span
    c, n = vec(flat.center[m]), vec(flat.normal[m])
    turn = -1.0 if dot(minus(image, c), n) > 0 else 1.0
    return clip(span, -turn * dot(minus(line, c), n), -turn * dot(axis, n), 0.0)


@njit
def _seen(flat, m, place):
    """Image of a place in a mirror, or the place itself."""
    return place if m < 0 else mirrored(place, vec(flat.center[m]), vec(flat.normal[m]))


@njit
def _stop(observation, flat, m, source, place):
    """Whether a place is reached over a mirror or directly, the first point of the path after the radar, the direction
    from there on, and the square of the Fresnel unit there, m^2."""
    if m < 0:
        return True, place, (0.0, 0.0, 0.0), 0.0
    window = aperture(flat, m)
    h, level = dot(minus(source, window[0]), window[1]), dot(minus(place, window[0]), window[1])
    if h * level >= 0:
        return False, place, (0.0, 0.0, 0.0), 0.0
    share, way = h / (h - level), minus(place, source)
    stop, square = along(source, share, way), 0.5 * observation.wavelength * length(way) * share * (1 - share)
    way = unit(way)
    return not outside_aperture(stop, way, square, window), stop, way, square


@njit
def _polarisation(observation, frame, flat, way, surface):
    """Product of the reflection coefficients for vertical polarisation at transmitter and receiver.

    Directions are those from the images: where the body touches the mirror, both reflections are at one place.

    Args:
        observation, frame: of the radar.
        flat, way: mirrors and images of the radar out and back.
        surface: place on the body, normal and layer there.
    """
    (one, source, two, sink), (place, n, layer) = way, surface
    p, up = vec(observation.position[frame]), upwards(observation.rotation[frame])
    there, back = unit(minus(place, source)), unit(minus(sink, place))
    first, last = unit(minus(_seen(flat, one, place), p)), unit(minus(p, _seen(flat, two, place)))
    field = sent(up, first)
    if one >= 0:
        field = reflected(field, first, there, vec(flat.normal[one]), flat.layer[one])
    field = reflected(field, there, back, n, layer)
    if two >= 0:
        field = reflected(field, back, last, vec(flat.normal[two]), flat.layer[two])
    return dot(field, upright(up, last))
