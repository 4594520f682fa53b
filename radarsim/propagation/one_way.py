"""One-way paths between sensor and scatterer, straight and over one or two mirrors.

A one-way path over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. Its amplitude
holds the antenna's gain, the mirrors' reflection coefficients with polarisation and apertures, the slabs it passes, and
1 / length.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Float32, Int
from numba import njit, prange

from radarsim.propagation.apertures import SLIT, STRIP_FAR, aperture, misses, passes
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
    vec,
    write,
)
from radarsim.propagation.media import mirror
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.scatterers import extended_factor
from radarsim.propagation.table import Table
from radarsim.propagation.targets import Targets

#: No rectangular aperture passes more than this.
_MOST = SLIT**2


@dataclass(frozen=True)
class OneWay(Table):
    """One-way paths of a batch.

    Attributes:
        candidate: row in the table of candidates: which scatterer in which frame.
        mirrors: in order from the sensor on, as indices of flat reflectors; -1: none.
        amplitude: see above, 1/m; phase as in the beat signal.
        virtual: the scatterer as seen through the mirrors, m.
        last: the last point before the scatterer: the sensor's, or a place of reflection, m.
        through: whether it passes a slab.
    """

    candidate: Int[np.ndarray, "path"]
    mirrors: Int[np.ndarray, "path 2"]
    amplitude: Complex[np.ndarray, "path"]
    virtual: Float[np.ndarray, "path 3"]
    last: Float[np.ndarray, "path 3"]
    through: Bool[np.ndarray, "path"]

    @property
    def bounces(self) -> Int[np.ndarray, "path"]:
        """Number of mirrors, 0 to 2."""
        return (self.mirrors[:, 0] >= 0) + (self.mirrors[:, 1] >= 0).astype(int)

    @classmethod
    def straight(
        cls, observation: Observation, targets: Targets, candidates: Candidates, rows: Int[np.ndarray, "path"]
    ) -> "OneWay":
        """Straight paths to some candidates, not yet tested for what is in the way."""
        n = len(rows)
        return cls(
            rows, np.full((n, 2), -1), candidates.straight[rows].astype(complex),
            np.take(targets.scatterers.position, candidates.scatterer[rows], axis=0),
            np.take(observation.position, candidates.frame[rows], axis=0), np.zeros(n, bool),
        )  # fmt: skip


class Trials(NamedTuple):
    """Paths over mirrors to try in one frame.

    Attributes:
        frame: index.
        chains: mirrors in order from the sensor on; the second one -1: there is none.
        candidates: rows of the scatterers that each chain may lead to.
        longest, weakest: bounds, by candidate, on a path's length (m) and on its amplitude times the root of the cosine
            at the scatterer (1/m).
    """

    frame: int
    chains: Int[np.ndarray, "chain 2"]
    candidates: Int[np.ndarray, "n"]
    longest: Float[np.ndarray, "n"]
    weakest: Float[np.ndarray, "n"]


class _Chains(NamedTuple):
    """Mirrors, frame, and the range of aims of each chain; which of these are within reach: `lit` from a place on, in
    eights."""

    mirrors: Int[np.ndarray, "chain 2"]
    frame: Int[np.ndarray, "chain"]
    aims: Int[np.ndarray, "chain 2"]
    begin: Int[np.ndarray, "chain+1"]
    lit: Bool[np.ndarray, "place"]


class _Aims(NamedTuple):
    """Candidates of all trials: where they are, and bounds as `Trials` has them."""

    candidate: Int[np.ndarray, "aim"]
    place: Float32[np.ndarray, "3 aim"]
    scatterer: Int[np.ndarray, "aim"]
    longest: Float32[np.ndarray, "aim"]
    weakest: Float32[np.ndarray, "aim"]


def over_mirrors(
    observation: Observation, targets: Targets, candidates: Candidates, flat: Flat, trials: list[Trials]
) -> tuple[OneWay, Float[np.ndarray, "path 3 3"]]:
    """The paths over one mirror and over two that there are, not yet tested for what is in the way.

    Returns:
        the paths, and the places of reflection on each in order, followed by the scatterer's (up to three), m.
    """
    rows, longest, weakest = (np.concatenate(column) for column in list(zip(*trials, strict=True))[2:])
    scatterer = candidates.scatterer[rows]
    place = np.ascontiguousarray(np.take(targets.scatterers.position, scatterer, axis=0).T, np.float32)
    aims = _Aims(rows, place, scatterer, longest.astype(np.float32), weakest.astype(np.float32))
    owner = np.repeat(np.arange(len(trials)), [len(each.chains) for each in trials])
    edges = _from_zero(np.array([len(each.candidates) for each in trials]))
    span = np.stack([edges[owner], edges[owner + 1]], axis=1)
    begin = 8 * _from_zero(-(-(span[:, 1] - span[:, 0]) // 8))
    mirrors, frame = np.concatenate([each.chains for each in trials]), np.array([each.frame for each in trials])[owner]
    chains, count = _Chains(mirrors, frame, span, begin, np.zeros(begin[-1], bool)), np.zeros(len(mirrors), np.int64)
    _reaches(observation, flat.columns, chains, aims, count)
    slots = _from_zero(count)
    found, stops = OneWay.zeros(slots[-1]), np.zeros((slots[-1], 3, 3))
    _paths(observation, flat.columns, chains, aims, targets.scatterers.columns, slots, found.columns, stops)
    kept = np.flatnonzero(found.amplitude)
    return replace(found, mirrors=np.repeat(mirrors, count, axis=0))[kept], stops[kept]


def _from_zero(counts: Int[np.ndarray, "n"]) -> Int[np.ndarray, "n+1"]:
    """Where each of some ranges of places begins, and where the last one ends."""
    return np.concatenate([[0], np.cumsum(counts)])


@njit
def _image(p, flat, mirrors):
    """The last of some mirrors; the sensor as seen in all but it, its image in all, and the former's height over it,
    zero where its back is turned."""
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
def _paths(observation, flat, chains, aims, scatterers, slots, found, stops):
    """Fills in the paths over every chain."""
    for k in prange(len(chains.frame)):
        _over(observation, flat, chains, k, aims, scatterers, (slots, found, stops))


@njit(cache=True)
def _over(observation, flat, chains, k, aims, scatterers, out):
    """Fills in the paths over one chain, from its slot on."""
    slots, found, stops = out
    frame = chains.frame[k]
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    up = upwards(rotation)
    one, two = chains.mirrors[k]
    last, source, image, h = _image(p, flat, chains.mirrors[k])
    c1, n1, cl, nl = vec(flat.center[one]), vec(flat.normal[one]), vec(flat.center[last]), vec(flat.normal[last])
    window = aperture(flat, last)
    before, h1 = aperture(flat, one), dot(minus(p, c1), n1)
    n, most = slots[k], 1.001 * (_MOST if two < 0 else _MOST**2)
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
            earlier, share = minus(stop, source), h1 / (h1 + hb)
            part *= share
            bounce, earlier = along(source, share, earlier), unit(earlier)
            wide = 0.5 * observation.wavelength * full * part * (1 - part)
            if misses(bounce, earlier, wide, before):
                continue
        j = aims.scatterer[i]
        cosine = facing(scatterers.normal[j], (-way[0], -way[1], -way[2]), scatterers.two_sided[j])
        if cosine <= 0:
            continue
        leaving = minus(bounce, p)
        size = gain_towards(leaving, rotation, observation) / full * extended_factor(scatterers.extended[j], full)
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
            found.candidate[n], found.amplitude[n] = aims.candidate[i], value
            seen = mirrored(s, cl, nl)
            write(mirrored(seen, c1, n1) if two >= 0 else seen, found.virtual[n])
            write(stop, found.last[n])
            write(bounce, stops[n, 0])
            write(stop if two >= 0 else s, stops[n, 1])
            write(s, stops[n, 2])
            n += 1
