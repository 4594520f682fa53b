"""One-way paths over one mirror and over two: which there are, how strong, and where they are reflected."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit, prange

from radarsim.physics.amplitudes import along, dot, facing, gain_towards, length, minus, reflected, unit, upright
from radarsim.physics.amplitudes import vector as vec
from radarsim.physics.apertures import STRIP_FAR, strip
from radarsim.physics.candidates import Candidates
from radarsim.physics.paths import OneWay
from radarsim.physics.reflectors import Flat
from radarsim.physics.search import Search
from radarsim.physics.targets import Targets

#: Candidates that are looked at together; neighbours in the table are neighbours in space.
BALL = 8


class _Chains(NamedTuple):
    """Mirrors in order from the sensor on, the second one -1 where there is none; the aims they may lead to, the first
    of the balls around them, and room for what is found."""

    mirrors: Int[np.ndarray, "chain 2"]
    frame: Int[np.ndarray, "chain"]
    aims: Int[np.ndarray, "chain 2"]
    balls: Int[np.ndarray, "chain"]
    slots: Int[np.ndarray, "chain+1"]


class _Aims(NamedTuple):
    """Candidates: where they are, and bounds on a path's length (m) and on its amplitude times the root of the cosine
    at the scatterer (1/m). Balls around every `BALL` of those that were added together, for a quick look."""

    candidate: Int[np.ndarray, "aim"]
    place: Float[np.ndarray, "aim 3"]
    scatterer: Int[np.ndarray, "aim"]
    longest: Float[np.ndarray, "aim"]
    weakest: Float[np.ndarray, "aim"]
    ball: Float[np.ndarray, "ball 3"]
    radius: Float[np.ndarray, "ball"]


class _Hits(NamedTuple):
    """Paths that there are: how many over each chain, and from its slot on, to which aims and how strong."""

    count: Int[np.ndarray, "chain"]
    aim: Int[np.ndarray, "slot"]
    amplitude: Complex[np.ndarray, "slot"]


class SpecularCandidates:
    """What paths over mirrors are tried: chains of mirrors for a frame, each with the candidates it may lead to.

    A chain is (m, -1) or (m, n), from the sensor on; many chains share their candidates.
    """

    def __init__(self):
        self._chains, self._frame, self._aims, self._rows, self._longest, self._weakest = [], [], [], [], [], []
        self._spans = []
        self._size = 0

    def add(
        self, frame: int, chains: Int[np.ndarray, "chain 2"], rows: Int[np.ndarray, "n"],
        longest: Float[np.ndarray, "n"], weakest: Float[np.ndarray, "n"],
    ) -> None:  # fmt: skip
        """Try chains to candidates.

        Args:
            frame: of all of them.
            chains: mirrors.
            rows: candidates.
            longest, weakest: bounds, see `_Aims`, for each candidate.
        """
        aims = self._size, self._size + len(rows)
        self._size += len(rows)
        self._spans.append(aims)
        self._chains.append(chains)
        self._frame.append(np.full(len(chains), frame))
        self._aims.append(np.broadcast_to(aims, (len(chains), 2)))
        for column, values in ((self._rows, rows), (self._longest, longest), (self._weakest, weakest)):
            column.append(values)

    def paths(
        self, search: Search, targets: Targets, candidates: Candidates, flat: Flat
    ) -> tuple[OneWay, Float[np.ndarray, "path 3 3"]]:
        """The paths there are, not yet tested for what is in the way.

        Returns:
            the paths, and the places of reflection on each in order, followed by the scatterer's (up to three), m.
        """
        if not self._size:
            return OneWay.straight(search, targets, candidates, np.zeros(0, int)), np.zeros((0, 3, 3))
        mirrors, frame, span = (np.concatenate(x) for x in (self._chains, self._frame, self._aims))
        rows, longest, weakest = (np.concatenate(x) for x in (self._rows, self._longest, self._weakest))
        scatterer = candidates.scatterer[rows]
        place = np.take(targets.scatterers.position, scatterer, axis=0)
        first = np.concatenate([np.arange(a, b, BALL) for a, b in self._spans])
        count = np.diff(first, append=len(rows))
        ball = np.add.reduceat(place, first) / count[:, None] if len(first) else place
        gap = np.linalg.norm(place - np.repeat(ball, count, axis=0), axis=1)
        radius = np.maximum.reduceat(gap, first) if len(first) else gap
        slots = np.concatenate([[0], np.cumsum(span[:, 1] - span[:, 0])])
        chains = _Chains(mirrors, frame, span, np.searchsorted(first, span[:, 0]), slots)
        size = chains.slots[-1]
        hits = _Hits(np.zeros(len(mirrors), np.int64), np.empty(size, np.int32), np.empty(size, complex))
        aims = _Aims(rows, place, scatterer, longest, weakest, ball, radius)
        _strengths(search, flat.columns, chains, aims, targets.scatterers.columns, hits)
        n = hits.count.sum()
        found = OneWay(
            np.empty(n, np.int64), np.repeat(1 + (mirrors[:, 1] >= 0), hits.count), np.empty(n, complex),
            np.empty((n, 3)), np.empty((n, 3)), np.zeros(n, bool),
        )  # fmt: skip
        stops = np.empty((n, 3, 3))
        _courses(search, flat.columns, chains, aims, hits, found.columns, stops)
        return found, stops


@njit(inline="always")
def _image(p, center, normal):
    """A point mirrored in a plane."""
    return along(p, -2 * dot(minus(p, center), normal), normal)


@njit(inline="always")
def _crossing(a, b, center, normal):
    """Where the line from a to b crosses a plane."""
    ha, hb = dot(minus(a, center), normal), dot(minus(b, center), normal)
    return along(a, ha / (ha - hb), minus(b, a))


@njit(inline="always")
def _share(stop, way, square, mirror):
    """What a mirror's aperture passes of a path in a direction over a stop on it.

    Args:
        stop: m.
        way: unit direction of travel.
        square: of the Fresnel unit across the path, m^2. In the mirror's plane it is longer along the plane of
            incidence: by 1 / across along u, by across / cosine along v, which keeps its area and neglects its slant.
        mirror: center, normal, u, v, half sides.
    """
    center, normal, u, v, half_u, half_v = mirror
    offset = minus(stop, center)
    aside, cosine = dot(way, u), abs(dot(way, normal))
    across, size = np.sqrt(max(1 - aside * aside, 1e-6)), np.sqrt(square) + 1e-12
    x, y = dot(offset, u) * across / size, dot(offset, v) * cosine / (across * size)
    half_x, half_y = half_u * across / size, half_v * cosine / (across * size)
    if abs(x) >= half_x + STRIP_FAR or abs(y) >= half_y + STRIP_FAR:
        return 0j
    return strip(-half_x - x, half_x - x) * strip(-half_y - y, half_y - y)


@njit(inline="always")
def _mirror(flat, m):
    """What `_share` needs of one."""
    return (
        vec(flat.center[m]), vec(flat.normal[m]), vec(flat.u[m]), vec(flat.v[m]), flat.half[m, 0], flat.half[m, 1]
    )  # fmt: skip


@njit(inline="always")
def _misses(image, h, center, radius, wavelength, mirror):
    """Whether no path from an image through its mirror, at height h over the image, can lead into a ball."""
    middle, normal, u, v, half_u, half_v = mirror
    way = minus(center, image)
    level = dot(minus(center, middle), normal) * (1.0 if h > 0 else -1.0)
    if level < -radius:
        return True
    if level <= radius:
        return False
    height = abs(h)
    steep = (height + level - radius) / (length(way) + radius)  # least cosine
    spread = radius * height / (height + level - radius) / steep
    spread += STRIP_FAR * np.sqrt(0.5 * wavelength * height / steep) / steep
    stop = minus(along(image, height / (height + level), way), middle)
    return abs(dot(stop, u)) > half_u + spread or abs(dot(stop, v)) > half_v + spread


@njit(parallel=True, cache=True)
def _strengths(search, flat, chains, aims, scatterers, hits):
    """Fills in the paths over every chain."""
    for k in prange(len(chains.frame)):
        _over(search, flat, chains, k, aims, scatterers, hits)


@njit(cache=True)
def _over(search, flat, chains, k, aims, scatterers, hits):
    """Fills in the paths over one chain."""
    frame = chains.frame[k]
    p, rotation = vec(search.position[frame]), search.rotation[frame]
    up = (rotation[0, 2], rotation[1, 2], rotation[2, 2])
    one, two = chains.mirrors[k]
    last = one if two < 0 else two
    c1, n1 = vec(flat.center[one]), vec(flat.normal[one])
    source = _image(p, c1, n1)  # the sensor as seen in the last mirror but one
    image = source
    cl, nl = vec(flat.center[last]), vec(flat.normal[last])
    if two >= 0:
        image = _image(source, cl, nl)
    h = -dot(minus(image, cl), nl)  # the source's height over the last mirror; its image is as far behind
    if abs(h) < 0.01 or (h < 0 and not flat.two_sided[last]):
        return
    mirror = _mirror(flat, last)
    before = _mirror(flat, one)
    n = chains.slots[k]
    begin, end = chains.aims[k]
    for ball in range(chains.balls[k], chains.balls[k] + (end - begin + BALL - 1) // BALL):
        if _misses(image, h, vec(aims.ball[ball]), aims.radius[ball], search.wavelength, mirror):
            continue
        start = begin + (ball - chains.balls[k]) * BALL
        for i in range(start, min(start + BALL, end)):
            s = vec(aims.place[i])
            hs = dot(minus(s, cl), nl)
            if hs * h < 0 or abs(hs) < 0.01:
                continue
            way = minus(s, image)
            full = length(way)
            if full > aims.longest[i] or full < 1e-2:
                continue
            part = h / (h + hs)  # of the way at which the last mirror lies
            stop = along(image, part, way)
            square = 0.5 * search.wavelength * full
            way = (way[0] / full, way[1] / full, way[2] / full)
            j = aims.scatterer[i]
            cosine = facing(scatterers.normal[j], (-way[0], -way[1], -way[2]), scatterers.two_sided[j])
            if cosine <= 0:
                continue
            passed = _share(stop, way, square * part * (1 - part), mirror)
            if passed == 0:
                continue
            bounce = stop
            if two >= 0:
                hb = dot(minus(stop, c1), n1)
                hp = dot(minus(p, c1), n1)
                if hb * hp <= 0 or abs(hb) < 0.005:
                    continue
                part *= hp / (hp + hb)
                bounce = _crossing(source, stop, c1, n1)
                passed *= _share(bounce, unit(minus(stop, source)), square * part * (1 - part), before)
                if passed == 0:
                    continue
            leaving = minus(bounce, p)
            size = gain_towards(leaving, rotation, search) / full
            least = aims.weakest[i] / np.sqrt(cosine)
            if abs(passed) * size <= least:
                continue
            now = unit(leaving)
            sent = upright(up, now)
            field = (sent[0] + 0j, sent[1] + 0j, sent[2] + 0j)
            if two >= 0:
                after = unit(minus(stop, bounce))
                field = reflected(field, now, after, n1, flat.reflection[one])
                now = after
            after = unit(minus(s, stop))
            field = reflected(field, now, after, nl, flat.reflection[last])
            value = size * passed * dot(field, upright(up, after))
            if abs(value) > least:
                hits.aim[n] = i
                hits.amplitude[n] = value
                n += 1
    hits.count[k] = n - chains.slots[k]


@njit(parallel=True, cache=True)
def _courses(search, flat, chains, aims, hits, found, stops):
    """The paths that exist, in a row."""
    ends = np.cumsum(hits.count)
    for k in prange(len(chains.frame)):
        _course(search, flat, chains, aims, hits, (k, ends[k] - hits.count[k]), found, stops)


@njit(cache=True)
def _course(search, flat, chains, aims, hits, where, found, stops):
    """Those over one chain, from a row on."""
    k, first = where
    p, one, two = vec(search.position[chains.frame[k]]), chains.mirrors[k, 0], chains.mirrors[k, 1]
    c1, n1 = vec(flat.center[one]), vec(flat.normal[one])
    source = _image(p, c1, n1)
    for i in range(hits.count[k]):
        e, j = first + i, chains.slots[k] + i
        found.candidate[e], found.amplitude[e] = aims.candidate[hits.aim[j]], hits.amplitude[j]
        s = vec(aims.place[hits.aim[j]])
        if two < 0:
            begin = _crossing(source, s, c1, n1)
            end, seen = begin, _image(s, c1, n1)
        else:
            c2, n2 = vec(flat.center[two]), vec(flat.normal[two])
            end = _crossing(_image(source, c2, n2), s, c2, n2)
            begin = _crossing(source, end, c1, n1)
            seen = _image(_image(s, c2, n2), c1, n1)
        for d in range(3):
            stops[e, 0, d] = begin[d]
            stops[e, 1, d] = end[d] if two >= 0 else s[d]
            stops[e, 2, d] = s[d]
            found.virtual[e, d] = seen[d]
            found.last[e, d] = end[d]
