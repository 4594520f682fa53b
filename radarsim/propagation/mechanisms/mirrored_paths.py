"""One-way paths over one mirror and over two: which there are, how strong, and where they are reflected."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int
from numba import njit, prange

from radarsim.propagation.apertures import STRIP_FAR, aperture, misses, passes
from radarsim.propagation.candidates import Candidates
from radarsim.propagation.fields import (
    along,
    dot,
    facing,
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
from radarsim.propagation.media import mirror
from radarsim.propagation.observation import Observation
from radarsim.propagation.one_way import OneWay
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.targets import Targets

#: No rectangular aperture passes more than this: Fresnel's integral over a slit is below 1.17.
_MOST = 1.17**2


class _Chains(NamedTuple):
    """Mirrors in order from the sensor on, the second one -1 where there is none; the aims they may lead to, from one
    on to before another; and which of these are within reach: `lit` from a place on, in eights."""

    mirrors: Int[np.ndarray, "chain 2"]
    frame: Int[np.ndarray, "chain"]
    aims: Int[np.ndarray, "chain 2"]
    begin: Int[np.ndarray, "chain+1"]
    lit: Bool[np.ndarray, "place"]


class _Aims(NamedTuple):
    """Candidates: where they are, and bounds on a path's length (m) and on its amplitude times the root of the cosine
    at the scatterer (1/m)."""

    candidate: Int[np.ndarray, "aim"]
    place: Float32[np.ndarray, "3 aim"]
    scatterer: Int[np.ndarray, "aim"]
    longest: Float32[np.ndarray, "aim"]
    weakest: Float32[np.ndarray, "aim"]


class _Hits(NamedTuple):
    """Paths that there are: how many over each chain, and from its slot on, to which aims and how strong."""

    slots: Int[np.ndarray, "chain+1"]
    counts: Int[np.ndarray, "chain"]
    aim: Int[np.ndarray, "slot"]
    amplitude: Complex[np.ndarray, "slot"]


class SpecularCandidates:
    """What paths over mirrors are tried: chains of mirrors for a frame, each with the candidates it may lead to.

    A chain is (m, -1) or (m, n), from the sensor on; many chains share their candidates.
    """

    def __init__(self):
        self._chains, self._frame, self._aims, self._rows, self._longest, self._weakest = [], [], [], [], [], []
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
        self._chains.append(chains)
        self._frame.append(np.full(len(chains), frame))
        self._aims.append(np.tile(aims, (len(chains), 1)))
        for column, values in ((self._rows, rows), (self._longest, longest), (self._weakest, weakest)):
            column.append(values)

    def paths(
        self, observation: Observation, targets: Targets, candidates: Candidates, flat: Flat
    ) -> tuple[OneWay, Float[np.ndarray, "path 3 3"]]:
        """The paths there are, not yet tested for what is in the way.

        Returns:
            the paths, and the places of reflection on each in order, followed by the scatterer's (up to three), m.
        """
        if not self._size:
            return OneWay.straight(observation, targets, candidates, np.zeros(0, int)), np.zeros((0, 3, 3))
        mirrors, frame, span = (np.concatenate(x) for x in (self._chains, self._frame, self._aims))
        rows = np.concatenate(self._rows)
        longest, weakest = (np.concatenate(x).astype(np.float32) for x in (self._longest, self._weakest))
        scatterer = candidates.scatterer[rows]
        place = np.ascontiguousarray(np.take(targets.scatterers.position, scatterer, axis=0).T, np.float32)
        aims = _Aims(rows, place, scatterer, longest, weakest)
        eights = _from_nought(-(-(span[:, 1] - span[:, 0]) // 8))
        chains = _Chains(mirrors, frame, span, 8 * eights, np.zeros(8 * eights[-1], np.bool_))
        count = np.zeros(len(mirrors), np.int64)
        _reaches(observation, flat.columns, chains, aims, count)
        slots = _from_nought(count)
        hits = _Hits(slots, np.zeros_like(count), np.empty(slots[-1], np.int32), np.empty(slots[-1], complex))
        _strengths(observation, flat.columns, chains, aims, targets.scatterers.columns, hits)
        n = hits.counts.sum()
        found = OneWay(
            np.empty(n, np.int64), np.repeat(mirrors, hits.counts, axis=0), np.empty(n, complex),
            np.empty((n, 3)), np.empty((n, 3)), np.zeros(n, bool),
        )  # fmt: skip
        stops = np.empty((n, 3, 3))
        _courses(observation, flat.columns, chains, aims, targets.scatterers.columns, hits, found.columns, stops)
        return found, stops


@njit
def _crossing(a, b, center, normal):
    """Where the line from a to b crosses a plane."""
    ha, hb = dot(minus(a, center), normal), dot(minus(b, center), normal)
    return along(a, ha / (ha - hb), minus(b, a))


def _from_nought(counts: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n+1"]:
    """Where each of some stretches of places begins, and where the last one ends."""
    return np.concatenate([[0], np.cumsum(counts)])


@njit
def _image(p, flat, mirrors):
    """The last of some mirrors; the sensor as seen in all but it, its image in all, and the former's height over it,
    nought where its back is turned."""
    one, two = mirrors
    last = one if two < 0 else two
    source = mirrored(p, vec(flat.center[one]), vec(flat.normal[one]))
    image = source
    if two >= 0:
        image = mirrored(source, vec(flat.center[last]), vec(flat.normal[last]))
    h = -dot(minus(image, vec(flat.center[last])), vec(flat.normal[last]))
    if h < 0 and not flat.two_sided[last]:
        h = 0.0
    return last, source, image, h


@njit(parallel=True, cache=True)
def _reaches(observation, flat, chains, aims, count):
    """Fills in what is lit, and how many."""
    for k in prange(len(count)):
        last, _, image, h = _image(vec(observation.position[chains.frame[k]]), flat, chains.mirrors[k])
        if abs(h) >= 0.01:
            lit = chains.lit[chains.begin[k] : chains.begin[k + 1]]
            most = observation.peak_gain * (_MOST if chains.mirrors[k, 1] < 0 else _MOST**2)
            _reach(observation, image, h, most, aperture(flat, last), aims, chains.aims[k], lit)
            count[k] = len(_lit(lit))


@njit(cache=True)
def _lit(lit):
    """Which are."""
    found, n = np.empty(len(lit), np.int64), 0
    for eight, some in enumerate(lit.view(np.uint64)):
        if some != 0:  # few are
            for i in range(8 * eight, 8 * eight + 8):
                if lit[i]:
                    found[n] = i
                    n += 1
    return found[:n]


@njit(cache=True, error_model="numpy")
def _reach(observation, image, h, most, window, aims, which, lit):
    """Which aims light may reach from an image through its mirror, at height h over the image, `most` over distance.

    A quick look at all of them, in arrays of single precision: it leaves out what `misses` does, what is too far, and
    what is too weak.
    """
    begin, end = which
    f = np.float32
    center, normal, u, v, half_u, half_v = window
    x, y, z = aims.place[0][begin:end], aims.place[1][begin:end], aims.place[2][begin:end]
    longest, weakest = aims.longest[begin:end], aims.weakest[begin:end]
    side, height = (f(1.0), f(h)) if h > 0 else (f(-1.0), f(-h))
    ox, oy, oz = f(image[0]), f(image[1]), f(image[2])
    nx, ny, nz = side * f(normal[0]), side * f(normal[1]), side * f(normal[2])
    ux, uy, uz, vx, vy, vz = f(u[0]), f(u[1]), f(u[2]), f(v[0]), f(v[1]), f(v[2])
    begin_u, begin_v = f(dot(minus(image, center), u)), f(dot(minus(image, center), v))
    half_u, half_v = f(half_u), f(half_v)
    zone = f(STRIP_FAR * STRIP_FAR * 0.5 * observation.wavelength)
    most = f(most)
    for i in range(len(x)):
        dx, dy, dz = x[i] - ox, y[i] - oy, z[i] - oz
        square = dx * dx + dy * dy + dz * dz
        full = np.sqrt(square)
        rise = dx * nx + dy * ny + dz * nz
        part = height / rise
        aside = dx * ux + dy * uy + dz * uz
        off_u = abs(begin_u + part * aside) - half_u
        off_v = abs(begin_v + part * (dx * vx + dy * vy + dz * vz)) - half_v
        across, farthest = square - aside * aside, zone * full * part * (f(1) - part)
        lit[i] = (
            (rise > height + f(0.01))
            & (full < longest[i])
            & (weakest[i] * full < most)
            & ((off_u <= f(0)) | (off_u * off_u * across < farthest * square))
            & ((off_v <= f(0)) | (off_v * off_v * rise * rise < farthest * across))
        )


@njit(parallel=True, cache=True)
def _strengths(observation, flat, chains, aims, scatterers, hits):
    """Fills in the paths over every chain."""
    for k in prange(len(chains.frame)):
        _over(observation, flat, chains, k, aims, scatterers, hits)


@njit(cache=True)
def _over(observation, flat, chains, k, aims, scatterers, hits):
    """Fills in the paths over one chain."""
    frame = chains.frame[k]
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    up = upwards(rotation)
    one, two = chains.mirrors[k]
    last, source, image, h = _image(p, flat, chains.mirrors[k])
    c1, n1, cl, nl = vec(flat.center[one]), vec(flat.normal[one]), vec(flat.center[last]), vec(flat.normal[last])
    window = aperture(flat, last)
    before, h1 = aperture(flat, one), dot(minus(p, c1), n1)
    n, most = hits.slots[k], 1.001 * (_MOST if two < 0 else _MOST**2)
    for i in chains.aims[k, 0] + _lit(chains.lit[chains.begin[k] : chains.begin[k + 1]]):
        s = vec(scatterers.position[aims.scatterer[i]])
        way = minus(s, image)
        full = length(way)
        hs = dot(minus(s, cl), nl)
        part = h / (h + hs)  # of the way at which the last mirror lies
        stop = along(image, part, way)
        way = (way[0] / full, way[1] / full, way[2] / full)
        square = 0.5 * observation.wavelength * full * part * (1 - part)
        bounce, earlier, wide = stop, way, square
        if two >= 0:
            hb = dot(minus(stop, c1), n1)
            if hb * h1 <= 0 or abs(hb) < 0.005:
                continue
            part *= h1 / (h1 + hb)
            bounce, earlier = _crossing(source, stop, c1, n1), unit(minus(stop, source))
            wide = 0.5 * observation.wavelength * full * part * (1 - part)
            if misses(bounce, earlier, wide, before):
                continue
        j = aims.scatterer[i]
        cosine = facing(scatterers.normal[j], (-way[0], -way[1], -way[2]), scatterers.two_sided[j])
        if cosine <= 0:
            continue
        leaving = minus(bounce, p)
        size = gain_towards(leaving, rotation, observation) / full
        least = aims.weakest[i] / np.sqrt(cosine)
        te, tm = mirror(flat.layer[last], min(abs(dot(way, nl)), 1.0))
        if most * size * max(abs(te), abs(tm)) <= least:
            continue
        passed = passes(stop, way, square, window)
        if two >= 0:
            passed *= passes(bounce, earlier, wide, before)
        if abs(passed) * size <= least:
            continue
        now = unit(leaving)
        field = sent(up, now)
        if two >= 0:
            after = unit(minus(stop, bounce))
            field = reflected(field, now, after, n1, flat.layer[one])
            now = after
        after = unit(minus(s, stop))
        field = reflected(field, now, after, nl, flat.layer[last])
        value = size * passed * dot(field, upright(up, after))
        if abs(value) > least:
            hits.aim[n] = i
            hits.amplitude[n] = value
            n += 1
    hits.counts[k] = n - hits.slots[k]


@njit(parallel=True, cache=True)
def _courses(observation, flat, chains, aims, scatterers, hits, found, stops):
    """The paths that exist, in a row."""
    ends = np.cumsum(hits.counts)
    for k in prange(len(chains.frame)):
        _course(observation, flat, chains, aims, scatterers, hits, (k, ends[k] - hits.counts[k]), (found, stops))


@njit(cache=True)
def _course(observation, flat, chains, aims, scatterers, hits, where, rows):
    """Those over one chain, from a row on."""
    (k, first), (found, stops) = where, rows
    p, one, two = vec(observation.position[chains.frame[k]]), chains.mirrors[k, 0], chains.mirrors[k, 1]
    c1, n1 = vec(flat.center[one]), vec(flat.normal[one])
    source = mirrored(p, c1, n1)
    for i in range(hits.counts[k]):
        e, j = first + i, hits.slots[k] + i
        found.candidate[e], found.amplitude[e] = aims.candidate[hits.aim[j]], hits.amplitude[j]
        s = vec(scatterers.position[aims.scatterer[hits.aim[j]]])
        if two < 0:
            begin = _crossing(source, s, c1, n1)
            end, seen = begin, mirrored(s, c1, n1)
        else:
            c2, n2 = vec(flat.center[two]), vec(flat.normal[two])
            end = _crossing(mirrored(source, c2, n2), s, c2, n2)
            begin = _crossing(source, end, c1, n1)
            seen = mirrored(mirrored(s, c2, n2), c1, n1)
        write(begin, stops[e, 0])
        write(end if two >= 0 else s, stops[e, 1])
        write(s, stops[e, 2])
        write(seen, found.virtual[e])
        write(end, found.last[e])
