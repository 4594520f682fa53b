"""Obstruction of a mirrored path within its first Fresnel zones, instead of on a single ray.

Behind a screen with openings the amplitude is Fresnel's integral over them, (1 / 2j) int exp(j pi r^2 / 2) dA in units
of sqrt(lambda d (L - d) / 2L), d along a path of length L. It is summed over the nodes of a Fibonacci lattice on a
square of these units with smooth borders; on such a lattice a thin pole covers the same number of nodes at any
orientation (Niederreiter, Random Number Generation and Quasi-Monte Carlo Methods, 1992, ch. 5). A few nodes show
whether a segment is partly clear, and only then more are tested. Diffraction by obstacles beyond the square is
neglected.

An echo meets an obstacle twice, on the way out at d_1 and on the way back at d_2. The losses of two screens on one path
multiply only if they are far apart; in general (Vogler, Radio Science 17(6), 1982, of knife edges) the field is the
double integral over both of

    exp(j pi (u_1^2 + u_2^2 - 2 rho u_1 . u_2) / (2 (1 - rho^2))),  rho = sqrt(d_1 (L - d_2) / (d_2 (L - d_1))),

a complex normal distribution of correlation rho: one screen for rho = 1, an obstacle at the mirror; two factors that
multiply for rho = 0, an obstacle at the radar. A half plane half way to a mirror whose edge touches the path leaves
1/4 + asin(1/3) / (2 pi) = -10.3 dB. A point scatterer has rho = 0 wherever the obstacle is, because it radiates a wave
of its own: the factors of both directions multiply; for an edge or a cylinder this holds across its line. For the same
reason the single rays to scatterers (`paths`), which count twice, have the correct mean power in the shadow of an edge.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from numba import njit
from numpy.typing import ArrayLike

from radarsim.propagation.apertures import SLIT
from radarsim.propagation.fields import cross, dot, minus, vec
from radarsim.propagation.lattice import FEW, HALF, MANY, Lattice, coupled, shares
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles, Passage
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.table import Table

#: Slabs on a path are tested for echoes that exceed the threshold at least by this factor.
LEAST_LOSS = 4.0
#: The same for Fresnel zones: some 16 dB over noise.
LEAST_SPLIT = 20.0
#: Echoes that exceed the threshold at least by this factor, some 40 dB over noise, are free of steps: zones of narrow
#: mirrors and points, and borders between nodes, are resolved.
LEAST_SMOOTH = 400.0
#: Distance between rays at the radar, relative to that at a mirror.
AT_RADAR = 0.5
#: Smallest number of nodes within a mirror; with fewer, the one ray through its middle is more accurate.
_FEWEST = 4
#: Openings of mirrors below this width are narrow, Fresnel units.
_NARROW = 2.0
#: Number of bisections that locate an obstacle on a segment, and a border on a link.
_HALVINGS = 4
#: Rays to a point are spread at most as for an obstacle at this fraction of the path, and by this factor.
_BESIDE = 0.7
_WIDEST = np.sqrt(2 * _BESIDE / (1 - _BESIDE))


@dataclass(frozen=True)
class PathSegments(Table):
    """Straight segments of mirrored paths, in their order.

    Attributes:
        path: index of the path, ascending.
        frame: index of the frame.
        begin, end: ends of the segment, m.
        before, after: shift of begin and end per Fresnel unit along either transverse axis, m.
        mirrors: mirrors of the whole path, in order, whose outlines bound its rays; -1: none.
        stops: points of reflection on these, m.
        apart: shift of the stops per Fresnel unit along either transverse axis, m.
        span: start and end on the whole path, as fractions of its length; if the segment ends in the middle, the path
            returns on it.
        mirroring: along either axis, 1 if its end is a mirror, 0 if a point scatterer.
    """

    path: Int[np.ndarray, "segment"]
    frame: Int[np.ndarray, "segment"]
    begin: Float[np.ndarray, "segment 3"]
    end: Float[np.ndarray, "segment 3"]
    before: Float[np.ndarray, "segment 2 3"]
    after: Float[np.ndarray, "segment 2 3"]
    mirrors: Int[np.ndarray, "segment 3"]
    stops: Float[np.ndarray, "segment 3 3"]
    apart: Float[np.ndarray, "segment 3 2 3"]
    span: Float[np.ndarray, "segment 2"]
    mirroring: Float[np.ndarray, "segment 2"]


def passage(
    observation: Observation, flat: Flat, obstacles: Obstacles, segments: PathSegments, size: Float[np.ndarray, "path"]
) -> Passage:
    """Factor on the amplitude of whole paths, out and back, by obstacles.

    Args:
        observation, flat, obstacles: the frames, the mirrors, and the obstacles.
        segments: segments of the paths. A path of one segment returns on it.
        size: amplitude of each path if it were clear. Slabs, and more than one ray, are tested only for paths far
            enough above the threshold.
    """
    path, strength = segments.path, size[segments.path]
    worth = strength > LEAST_LOSS * observation.threshold
    found = obstacles.passage(observation, segments.frame, segments.begin, segments.end, worth)
    rows, partly, place = _partly(observation, flat, obstacles, segments, strength, found.factor)
    smooth = strength[rows] > LEAST_SMOOTH * observation.threshold
    fans, some = _fans(observation, flat, obstacles, partly, place, smooth)
    for column, new in zip(found.columns, some.columns, strict=True):
        column[rows] = new
    returns = np.bincount(path, minlength=len(size)) == 1
    # Two screens: one that is met again on the way back, or, on several segments, the first and the last one.
    owner, first, count = np.unique(path[rows], return_index=True, return_counts=True)
    last = first + count - 1
    two = returns[owner] | (count > 1)
    owner, first, last = owner[two], first[two], last[two]
    near, far = place[first], np.where(returns[owner], 1 - place[last], place[last])
    rho = np.sqrt(near * (1 - far) / (far * (1 - near)))
    both = coupled(fans[first], fans[last], rho, partly.mirroring[first], MANY.couplings)
    single = some.factor[first] * some.factor[last]
    both = np.where(np.isnan(both), single, _bounded(both, SLIT**2))
    factor = found.factor ** (1 + returns[path])
    factor[rows[last]] = 1
    factor[rows[first]] = both
    whole, clear = np.ones(len(size), complex), np.ones(len(size))
    np.multiply.at(whole, path, factor)
    np.multiply.at(clear, path, 1 - found.blocked)
    delay = _sums(path, found.delay, len(size)) * (1 + returns)
    return Passage(whole, delay, _sums(path, found.through, len(size)) > 0, 1 - clear)


def _partly(
    observation: Observation, flat: Flat, obstacles: Obstacles, segments: PathSegments,
    strength: Float[np.ndarray, "segment"], factor: Complex[np.ndarray, "segment"],
) -> tuple[Int[np.ndarray, "partly"], PathSegments, Float[np.ndarray, "partly"]]:  # fmt: skip
    """Segments that are partly clear, fitted to their mirrors, and the position of the obstacle as a fraction of the
    whole path."""
    long = np.any(segments.begin != segments.end, axis=1)
    rows = np.flatnonzero(long & (strength > LEAST_SPLIT * observation.threshold))
    smooth = strength[rows] > LEAST_SMOOTH * observation.threshold
    fitted = _fitted(flat, segments[rows], smooth)
    few, begin, end, inside = _rays(flat, fitted, FEW, smooth * (_WIDEST - 1))
    clear = obstacles.clear(observation, fitted.frame[few], begin, end)
    # A segment is uniform if all rays equal the one in the middle, whose result then holds for the segment.
    unlike = _sums(few, clear != (factor[rows[few]] == 1), len(rows))
    partly = (unlike > 0) & (inside.sum(axis=1) >= _FEWEST)
    # Position up to which obstructed rays are clear; of each segment the first and last such.
    hidden = np.flatnonzero(~clear & partly[few])
    number = np.arange(len(hidden)) - np.searchsorted(few[hidden], few[hidden])
    hidden = hidden[(number == 0) | (np.append(number[1:], 0) == 0)]
    owner, begin, end = few[hidden], begin[hidden], end[hidden]
    reach = _reach(observation, obstacles, fitted.frame[owner], (begin, begin), (begin, end))
    met = np.bincount(owner, minlength=len(rows))
    share = (_sums(owner, reach, len(rows)) / np.maximum(met, 1))[partly]
    fitted = fitted[partly]
    low, high = fitted.span.T
    return rows[partly], fitted, low + share * (high - low)


def _reach(
    observation: Observation, obstacles: Obstacles, frame: Int[np.ndarray, "ray"],
    one: tuple[Float[np.ndarray, "ray 3"], Float[np.ndarray, "ray 3"]],
    two: tuple[Float[np.ndarray, "ray 3"], Float[np.ndarray, "ray 3"]],
    through: Bool[np.ndarray, "ray"] | None = None,
) -> Float[np.ndarray, "ray"]:  # fmt: skip
    """Distance by which clear rays can move towards hidden ones (begin and end of either, m) before they are hidden, as
    a fraction of the whole distance; `through` as in `Obstacles.clear`."""
    moved = np.zeros(len(frame))
    for step in 0.5 ** np.arange(1, _HALVINGS + 1):
        begin, end = (a + (moved + step)[:, None] * (b - a) for a, b in zip(one, two, strict=True))
        moved += step * obstacles.clear(observation, frame, begin, end, through)
    return moved + 0.5 ** (_HALVINGS + 1)


def _fitted(flat: Flat, segments: PathSegments, smooth: Bool[np.ndarray, "segment"]) -> PathSegments:
    """Segments, with nodes shifted for some (`smooth`) to the middle of the mirrors' opening if that is narrower than a
    zone.

    A small mirror scatters straight back like a point.
    """
    edges = np.empty((len(segments), 2, 2))
    _open(flat.corners, flat.normal, segments.columns, edges)
    low, high = edges[..., 0], edges[..., 1]
    narrow = (low < high) & (high - low < _NARROW) & smooth[:, None]
    share, middle = np.ones(narrow.shape), np.zeros(narrow.shape)
    share[narrow] = (high - low)[narrow] / _NARROW
    # Rays to all parts of a small plate end at one point, so that they meet the same obstacles.
    middle[narrow] = np.minimum(2 * (1 - share[narrow]), 1) * (low[narrow] + high[narrow]) / 2
    at_radar, back = segments.span[:, :1] == 0, segments.span[:, 1:] == 0.5
    mirroring = segments.mirroring * np.where(back, share, 1)
    spread = np.where(back, (1 - (1 - AT_RADAR) * mirroring) / (1 - (1 - AT_RADAR) * segments.mirroring), share)
    aside = np.where(at_radar, 0, middle), np.where(segments.span[:, 1:] == 1, 0, middle)
    return replace(
        segments,
        begin=segments.begin + np.einsum("sa,sad->sd", aside[0], segments.before),
        end=segments.end + np.einsum("sa,sad->sd", aside[1], segments.after),
        before=segments.before * spread[..., None], after=segments.after * share[..., None],
        stops=segments.stops + np.einsum("sa,sgad->sgd", middle, segments.apart),
        apart=segments.apart * share[:, None, :, None], mirroring=mirroring,
    )  # fmt: skip


def _fans(
    observation: Observation,
    flat: Flat,
    obstacles: Obstacles,
    segments: PathSegments,
    place: Float[np.ndarray, "segment"],
    smooth: Bool[np.ndarray, "segment"],
) -> tuple[Complex[np.ndarray, "segment 2 node"], Passage]:
    """Factors of many rays, zero beyond the mirrors' outlines; which rays are within; and delays, m. Borders between
    nodes are located for some segments (`smooth`).

    Rays are straight and zones are not: the rays are spread such that they are correct at the obstacle.
    """
    low, high = segments.span.T
    share = (place - low) / (high - low)
    wide = np.sqrt(segments.span * (1 - segments.span))
    wide = np.where(wide > 0, wide, AT_RADAR * wide[:, ::-1])
    mirror = np.sqrt(place * (1 - place)) / ((1 - share) * wide[:, 0] + share * wide[:, 1])
    point = np.sqrt(2 * share / (1 - np.minimum(share, _BESIDE)))
    spread = mirror[:, None] + (point - mirror)[:, None] * (1 - segments.mirroring)
    spread = np.maximum(spread, 0.25)[..., None]
    shown = replace(segments, before=segments.before * spread, after=segments.after * spread)
    many, begin, end, inside = _rays(flat, shown, MANY)
    passed = obstacles.passage(observation, segments.frame[many], begin, end, np.ones(len(many), bool))
    wavenumber, count = 2j * np.pi / observation.wavelength, len(share)
    power = np.abs(passed.factor) ** 2
    total = np.maximum(_sums(many, power, count), 1e-30)
    later = _sums(many, power * passed.delay, count) / total
    fans, clear = np.zeros((count, 2, inside.shape[1]), complex), np.zeros(inside.shape)
    fans[:, 0][inside] = passed.factor * np.exp(wavenumber * (passed.delay - later[many]))
    fans[:, 1][inside] = 1
    clear[inside] = passed.blocked == 0
    _soften(observation, obstacles, segments.frame, (begin, end, inside), passed, smooth, (fans[:, 0], clear))
    whole = fans[:, 1] @ MANY.weight
    factor = _bounded(fans[:, 0] @ MANY.weight / whole, SLIT)
    through = _sums(many, power * passed.through, count) > total / 2
    return fans, Passage(factor, later, through, 1 - np.minimum(np.abs(clear @ MANY.weight / whole), 1))


def _soften(
    observation: Observation, obstacles: Obstacles, frame: Int[np.ndarray, "segment"],
    rays: tuple[Float[np.ndarray, "ray 3"], Float[np.ndarray, "ray 3"], Bool[np.ndarray, "segment node"]],
    passed: Passage, smooth: Bool[np.ndarray, "segment"], values: tuple[np.ndarray, ...],
) -> None:  # fmt: skip
    """Distribute values of nodes on either side of borders according to the borders' position on the links between
    nodes.

    Args:
        observation, obstacles: the frames, and the obstacles.
        frame: frame of each segment.
        rays: rays of the nodes, begin and end, and the mask of nodes of each segment.
        passed: factors of the rays.
        smooth: mask of segments.
        values: values of the nodes (segment, node), modified in place.
    """
    begin, end, inside = rays
    state, number = np.full(inside.shape, -1, np.int8), np.zeros(inside.shape, int)
    state[inside], number[inside] = 2 - (passed.factor != 1) - (passed.factor == 0), np.arange(len(begin))
    some = np.flatnonzero(smooth)
    one, two = state[some[:, None], MANY.links[:, 0]], state[some[:, None], MANY.links[:, 1]]
    s, link = np.nonzero((one != two) & (one >= 0) & (two >= 0))
    first = (one > two)[s, link].astype(int)  # the more open node
    s = some[s]
    open_, other = MANY.links[link, 1 - first], MANY.links[link, first]
    here, there = number[s, open_], number[s, other]
    through = state[s, open_] == 1
    reach = _reach(observation, obstacles, frame[s], (begin[here], end[here]), (begin[there], end[there]), through)
    near, far = shares(reach)
    degree = MANY.degrees(inside)
    for value in values:
        step = value[s, other] - value[s, open_]
        np.add.at(value, (s, open_), (1 - near) * step / degree[s, open_])
        np.subtract.at(value, (s, other), far * step / degree[s, other])


def _sums(index: Int[np.ndarray, "n"], values: np.ndarray, count: int) -> Float[np.ndarray, "count"]:
    out = np.zeros(count)
    np.add.at(out, index, values)
    return out


def _bounded(value: Complex[np.ndarray, "n"], most: float) -> Complex[np.ndarray, "n"]:
    return value * np.minimum(1, most / np.maximum(np.abs(value), 1e-12))


def _rays(flat: Flat, segments: PathSegments, lattice: Lattice, wider: ArrayLike = 0.0) -> tuple[np.ndarray, ...]:
    """Rays within the mirrors' outlines: their segments, begin, end; and the mask of nodes of each segment.

    The outermost rays to points begin farther apart by a fraction `wider` (per segment): a zone is wider than the cone
    of rays to its tip.
    """
    inside = np.empty((len(segments), len(lattice.nodes)), np.bool_)
    _within(flat.corners, flat.normal, segments.columns, lattice.nodes, inside)
    owner, node = np.nonzero(inside)
    begin, end = np.empty((2, len(owner), 3))
    nodes = lattice.nodes[node]
    wide = np.broadcast_to(wider, len(segments))[:, None] * (1 - segments.mirroring)
    cone = nodes * (1 + wide[owner] * (nodes / HALF) ** 2)
    _spread(segments.columns, owner, cone, nodes, begin, end)
    return owner, begin, end, inside


@njit(cache=True)
def _spread(segments, owner, first, last, begin, end):
    """Write begin and end of rays from their nodes at either end."""
    for r in range(len(owner)):
        i = owner[r]
        for d in range(3):
            begin[r, d], end[r, d] = segments.begin[i, d], segments.end[i, d]
            for axis in range(2):
                begin[r, d] += first[r, axis] * segments.before[i, axis, d]
                end[r, d] += last[r, axis] * segments.after[i, axis, d]


@njit(cache=True)
def _within(corners, normal, segments, nodes, inside):
    """Mark the nodes within the mirrors of each segment."""
    bounds = np.empty((24, 3))
    for i in range(len(inside)):
        if i > 0 and segments.path[i] == segments.path[i - 1]:
            inside[i] = inside[i - 1]
            continue
        count = _bounds(corners, normal, segments, i, bounds)
        for k in range(len(nodes)):
            inside[i, k] = True
            for c in range(count):
                if bounds[c, 0] + nodes[k, 0] * bounds[c, 1] + nodes[k, 1] * bounds[c, 2] < -1e-9:
                    inside[i, k] = False
                    break


@njit(cache=True)
def _open(corners, normal, segments, edges):
    """Write the interval that mirrors leave open on both axes of each segment, Fresnel units."""
    bounds = np.empty((24, 3))
    for i in range(len(edges)):
        if i > 0 and segments.path[i] == segments.path[i - 1]:
            edges[i] = edges[i - 1]
            continue
        count = _bounds(corners, normal, segments, i, bounds)
        for axis in range(2):
            low, high = -np.inf, np.inf
            for c in range(count):
                slope = bounds[c, 1 + axis]
                if slope > 0:
                    low = max(low, -bounds[c, 0] / slope)
                elif slope < 0:
                    high = min(high, -bounds[c, 0] / slope)
            edges[i, axis] = low, high


@njit
def _bounds(corners, normal, segments, i, out):
    """Bounds of the rays that meet all mirrors of a path in their order; a mirror that extends behind another is used
    only up to the line where their planes meet. Writes linear functions of a node (1, x and y), not negative for such
    rays; returns their number."""
    count = 0
    for g in range(3):
        m = segments.mirrors[i, g]
        if m < 0:
            continue
        stop, n = vec(segments.stops[i, g]), vec(normal[m])
        x, y = vec(segments.apart[i, g, 0]), vec(segments.apart[i, g, 1])
        one, two = minus(vec(corners[m, 2]), vec(corners[m, 0])), minus(vec(corners[m, 3]), vec(corners[m, 1]))
        turn = np.sign(dot(cross(one, two), n))
        for k in range(4):
            one = vec(corners[m, k])
            inward = cross(n, minus(vec(corners[m, (k + 1) % 4]), one))
            count = _bound((turn, one, inward), (stop, x, y), out, count)
        for other in range(max(g - 1, 0), min(g + 2, 3)):
            b = segments.mirrors[i, other]
            if b >= 0 and other != g:
                corner, facing = vec(corners[b, 0]), vec(normal[b])
                side = np.sign(dot(minus(stop, corner), facing))
                count = _bound((side, corner, facing), (stop, x, y), out, count)
    return count


@njit
def _bound(plane, rays, out, count):
    """Write on which side of a plane (side, place, direction) rays are (stop, and dependence on a node's x and y)."""
    side, place, direction = plane
    stop, x, y = rays
    out[count] = side * dot(minus(stop, place), direction), side * dot(x, direction), side * dot(y, direction)
    return count + 1
