"""Legs: the ways between the sensor and a scatterer, straight and over one or two mirrors.

A leg over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. An echo is a pair of
legs to the same scatterer, out on one and back on the other. The amplitude of a leg holds the antenna's gain, the
mirrors' reflection coefficients with polarisation and edges, the slabs it passes, and 1 / length; that of an echo

    a = lambda sqrt(sigma) / (4 pi)^(3/2) sqrt(cos_1 cos_2) leg_1 leg_2,

the radar equation |a|^2 = G^2 lambda^2 sigma / ((4 pi)^3 R^4) for a straight pair, with Lambert's cosine either way.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from numba import njit, prange

from radarsim.physics.amplitudes import along, dot, facing, gain_towards, length, minus, ramp, reflected, unit, upright
from radarsim.physics.amplitudes import vector as vec
from radarsim.physics.detail import detail, share
from radarsim.physics.lobes import scattering
from radarsim.physics.mirrors import Mirrors

#: Mirrors over which both legs of an echo go, together.
MOST_BOUNCES = 2


@dataclass(frozen=True)
class Legs:
    """Legs of several frames.

    Attributes:
        frame, scatterer: indices.
        bounces: number of mirrors, 0 to 2.
        amplitude: see above, 1/m; phase as in the beat signal.
        virtual: the scatterer as seen through the mirrors, m.
        towards: unit vector from the scatterer back along the leg.
        slab: whether it passes a slab.
    """

    frame: Int[np.ndarray, "leg"]
    scatterer: Int[np.ndarray, "leg"]
    bounces: Int[np.ndarray, "leg"]
    amplitude: Complex[np.ndarray, "leg"]
    virtual: Float[np.ndarray, "leg 3"]
    towards: Float[np.ndarray, "leg 3"]
    slab: Bool[np.ndarray, "leg"]

    def __len__(self) -> int:
        return len(self.frame)

    def __getitem__(self, index) -> "Legs":
        return Legs(*(getattr(self, f.name)[index] for f in fields(self)))

    def turn(self, places: Float[np.ndarray, "leg 3"]) -> Float[np.ndarray, "leg 3 3"]:
        """How the virtual point moves when the scatterer does: the mirror's reflection, for legs over at most one.

        A mirror's normal is along the line from the scatterer to its image.
        """
        normal = (places - self.virtual) * (self.bounces == 1)[:, None]
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return np.eye(3) - 2 * normal[:, :, None] * normal[:, None]

    @classmethod
    def joined(cls, parts: list["Legs"]) -> "Legs":
        """All legs of several tables."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    @classmethod
    def straight(cls, frame: int, index: np.ndarray, amplitude: np.ndarray, place: np.ndarray, position) -> "Legs":
        """Straight legs to scatterers at places, not yet tested for what is in the way."""
        n = len(index)
        towards = position - place
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        return cls(
            np.full(n, frame), index, np.zeros(n, int), amplitude.astype(complex), place, towards, np.zeros(n, bool)
        )

    @classmethod
    def over_mirrors(
        cls, frame: int, mirrors: Mirrors, chains: Int[np.ndarray, "chain 2"], scatterers, index: np.ndarray,
        longest: np.ndarray, weakest: np.ndarray, position, rotation, wavelength: float, tables,
    ) -> tuple["Legs", Float[np.ndarray, "leg 3 3"]]:  # fmt: skip
        """Legs over chains of mirrors (m, -1) or (m, n) to scatterers, not yet tested for what is in the way.

        Args:
            frame: index for the table.
            mirrors, chains: which mirrors in which order, from the sensor on.
            scatterers, index: which of them the legs lead to.
            longest, weakest: bounds on a leg's length (m) and on its amplitude times the root of the cosine at the
                scatterer (1/m), for each of these.
            position, rotation: sensor pose.
            wavelength: m.
            tables: the antenna's gain tables.

        Returns:
            the legs, and the places of reflection on each in order, followed by the scatterer's (up to three), m.
        """
        place, normal, two_sided = (getattr(scatterers, n)[index] for n in ("position", "normal", "two_sided"))
        count, shape = np.zeros(len(chains), np.int64), (len(chains), len(index))
        target, strength = np.empty(shape, np.int32), np.empty(shape, complex)
        rectangles = (mirrors.center, mirrors.normal, mirrors.u, mirrors.v, mirrors.half, mirrors.two_sided)
        if strength.size:
            _strengths(
                chains, place, normal, two_sided, longest, weakest, *rectangles, mirrors.reflection, position, rotation,
                wavelength, *tables, count, target, strength,
            )  # fmt: skip
        n = int(count.sum())
        which, amplitude = np.empty(n, np.int64), np.empty(n, complex)
        stops, virtual, towards = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
        _courses(
            chains, place, *rectangles[:2], position, count, target, strength, which, amplitude, stops, virtual, towards
        )
        bounces = np.repeat(1 + (chains[:, 1] >= 0), count)
        legs = cls(np.full(n, frame), index[which], bounces, amplitude, virtual, towards, np.zeros(n, bool))
        return legs, stops


@njit(parallel=True, cache=True)
def straight_amplitudes(
    place, normal, sigma, two_sided, lobe, rank, position, rotation, reach, wavelength, azimuth_table, elevation_table,
    legs, echoes, distances, shown,
):  # fmt: skip
    """Amplitude of the straight leg to every scatterer and of the echo there and back by it, 0 out of reach; distance;
    amplitude factor by level of detail."""
    scale = wavelength / (4 * np.pi) ** 1.5
    for i in prange(len(place)):
        d = minus(vec(place[i]), vec(position))
        square = dot(d, d)
        legs[i] = 0.0
        echoes[i] = 0.0
        shown[i] = 0.0
        distances[i] = np.sqrt(square)
        if square > reach * reach or square < 1e-4:
            continue
        away = distances[i]
        gain = gain_towards(d, rotation, azimuth_table, elevation_table)
        shown[i] = detail(rank[i], share(gain, away))
        cosine = facing(normal[i], (-d[0] / away, -d[1] / away, -d[2] / away), two_sided[i])
        if cosine <= 0:
            continue
        leg = gain / away
        legs[i] = leg
        echoes[i] = scale * leg * leg * shown[i] * np.sqrt(sigma[i] * scattering(cosine, cosine, 1.0, lobe[i]))


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
def _cover(stop, center, u, v, half, zone):
    """Share of a mirror's reflection at a stop: its edges act over about half a Fresnel zone, not at a point."""
    offset = minus(stop, center)
    inside = ramp(half[0] - abs(dot(offset, u)), zone)
    if inside == 0:
        return 0.0
    return inside * ramp(half[1] - abs(dot(offset, v)), zone)


@njit(parallel=True, cache=True)
def _strengths(
    chains, place, face, open_face, longest, weakest, center, normal, u, v, half, two_sided, reflection, position,
    rotation, wavelength, azimuth_table, elevation_table, count, target, out,
):  # fmt: skip
    """Legs over every chain: their number, which places they lead to, and their amplitudes."""
    p = vec(position)
    up = (rotation[0, 2], rotation[1, 2], rotation[2, 2])
    for k in prange(len(chains)):
        one, two = chains[k]
        last = one if two < 0 else two
        c1, n1 = vec(center[one]), vec(normal[one])
        source = _image(p, c1, n1)  # the sensor as seen in the last mirror but one
        image = source
        cl, nl = vec(center[last]), vec(normal[last])
        if two >= 0:
            image = _image(source, cl, nl)
        h = -dot(minus(image, cl), nl)  # the source's height over the last mirror; its image is as far behind
        if h < 0 and not two_sided[last]:
            continue
        for i in range(len(place)):
            s = vec(place[i])
            hs = dot(minus(s, cl), nl)
            if hs * h < 0 or abs(hs) < 0.01 or abs(h) < 0.01:
                continue
            way = minus(s, image)
            full = length(way)
            if full > longest[i] or full < 1e-2:
                continue
            cosine = facing(face[i], (-way[0] / full, -way[1] / full, -way[2] / full), open_face[i])
            if cosine <= 0:
                continue
            share = h / (h + hs)  # of the way at which the last mirror lies
            stop = along(image, share, way)
            zone = 0.5 * np.sqrt(wavelength * full * share * (1 - share))
            cover = _cover(stop, cl, vec(u[last]), vec(v[last]), half[last], zone)
            if cover == 0:
                continue
            begin = stop
            if two >= 0:
                hb = dot(minus(stop, c1), n1)
                hp = dot(minus(p, c1), n1)
                if hb * hp <= 0 or abs(hb) < 0.005:
                    continue
                part = share * hp / (hp + hb)
                begin = _crossing(source, stop, c1, n1)
                zone = 0.5 * np.sqrt(wavelength * full * part * (1 - part))
                cover *= _cover(begin, c1, vec(u[one]), vec(v[one]), half[one], zone)
                if cover == 0:
                    continue
            leaving = minus(begin, p)
            size = cover * gain_towards(leaving, rotation, azimuth_table, elevation_table) / full
            least = weakest[i] / np.sqrt(cosine)
            if size <= least:
                continue
            now = unit(leaving)
            sent = upright(up, now)
            field = (sent[0] + 0j, sent[1] + 0j, sent[2] + 0j)
            if two >= 0:
                after = unit(minus(stop, begin))
                field = reflected(field, now, after, n1, reflection[one])
                now = after
            after = unit(minus(s, stop))
            field = reflected(field, now, after, nl, reflection[last])
            value = size * dot(field, upright(up, after))
            if abs(value) > least:
                target[k, count[k]] = i
                out[k, count[k]] = value
                count[k] += 1


@njit(cache=True)
def _courses(
    chains, place, center, normal, position, count, target, strength, which, amplitude, stops, virtual, towards
):  # fmt: skip
    """The legs that exist, in a row: place, amplitude, places of reflection, virtual point and direction."""
    e = 0
    for k in range(len(chains)):
        for j in range(count[k]):
            which[e], amplitude[e] = target[k, j], strength[k, j]
            s, one, two = vec(place[target[k, j]]), chains[k, 0], chains[k, 1]
            _course(one, two, vec(position), s, center, normal, stops[e], virtual[e], towards[e])
            e += 1


@njit(inline="always")
def _course(one, two, p, s, center, normal, stops, virtual, towards):
    c1, n1 = vec(center[one]), vec(normal[one])
    source = _image(p, c1, n1)
    if two < 0:
        begin = _crossing(source, s, c1, n1)
        last, seen = begin, _image(s, c1, n1)
    else:
        c2, n2 = vec(center[two]), vec(normal[two])
        last = _crossing(_image(source, c2, n2), s, c2, n2)
        begin = _crossing(source, last, c1, n1)
        seen = _image(_image(s, c2, n2), c1, n1)
    back = unit(minus(last, s))
    for d in range(3):
        stops[0, d] = begin[d]
        stops[1, d] = last[d] if two >= 0 else s[d]
        stops[2, d] = s[d]
        virtual[d] = seen[d]
        towards[d] = back[d]


def pairs(
    legs: Legs, lengths: Float[np.ndarray, "leg"], shown: Float[np.ndarray, "leg"], scatterers,
    weights: Float[np.ndarray, "scatterer 3"], reach: float, wavelength: float, weakest: float,
) -> tuple[Int[np.ndarray, "echo 2"], Complex[np.ndarray, "echo"]]:  # fmt: skip
    """Echoes: pairs of legs to the same scatterer, in either order, and their amplitudes without the scatterer's phase.

    Args:
        legs: sorted by frame, then scatterer.
        lengths: of the legs, m.
        shown: amplitude factor of the leg's scatterer by level of detail.
        scatterers: what they lead to.
        weights: of a scatterer's power in echoes with 0, 1, and 2 or more mirrors on the way; slabs are one more.
        reach: half the longest path, m.
        wavelength: m.
        weakest: echoes below are left out.
    """
    key = legs.frame * np.int64(len(scatterers)) + legs.scatterer
    first = np.flatnonzero(np.diff(key, prepend=-1))
    sizes = np.diff(np.append(first, len(key)))
    index, amplitude = np.empty((int(np.sum(sizes**2)), 2), np.int64), np.empty(int(np.sum(sizes**2)), complex)
    s = scatterers
    n = _pairs(
        np.append(first, len(key)), legs.scatterer, legs.bounces, legs.amplitude, legs.towards, legs.slab, lengths,
        shown, s.normal, s.sigma, s.two_sided, s.lobe, weights, reach, wavelength / (4 * np.pi) ** 1.5, weakest,
        index, amplitude,
    )  # fmt: skip
    return index[:n], amplitude[:n]


@njit(cache=True)
def _pairs(
    first, scatterer, bounces, amplitude, towards, slab, lengths, shown, normal, sigma, two_sided, lobe,
    weights, reach, scale, weakest, index, out,
):  # fmt: skip
    n = 0
    for group in range(len(first) - 1):
        s = scatterer[first[group]]
        size = scale * shown[first[group]] * np.sqrt(sigma[s])
        for i in range(first[group], first[group + 1]):
            there = facing(normal[s], vec(towards[i]), two_sided[s])
            if there <= 0:
                continue
            for j in range(first[group], first[group + 1]):
                if bounces[i] + bounces[j] > MOST_BOUNCES or lengths[i] + lengths[j] > 2 * reach:
                    continue
                back = facing(normal[s], vec(towards[j]), two_sided[s])
                if back <= 0:
                    continue
                order = min(bounces[i] + bounces[j] + (slab[i] or slab[j]), 2)
                between = dot(vec(towards[i]), vec(towards[j]))
                value = size * np.sqrt(scattering(there, back, between, lobe[s])) * (amplitude[i] * amplitude[j])
                # what the weight adds stands for scatterers left out: it makes no echo worth keeping
                if weights[s, order] > 0 and abs(value) > weakest:
                    index[n, 0] = i
                    index[n, 1] = j
                    out[n] = value * np.sqrt(weights[s, order])
                    n += 1
    return n
