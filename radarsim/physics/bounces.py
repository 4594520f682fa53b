"""Legs over one mirror and over two: which there are, how strong, and where they are reflected."""

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.physics.amplitudes import along, dot, facing, gain_towards, length, minus, ramp, reflected, unit, upright
from radarsim.physics.amplitudes import vector as vec
from radarsim.physics.batch import Batch
from radarsim.physics.candidates import Candidates
from radarsim.physics.legs import Legs
from radarsim.physics.mirrors import Mirrors


class Ways:
    """What legs over mirrors are tried: chains of mirrors for a frame, each with the candidates it may lead to.

    A chain is (m, -1) or (m, n), from the sensor on; many chains share their candidates.
    """

    def __init__(self):
        self._chains, self._frame, self._range, self._rows, self._longest, self._weakest = [], [], [], [], [], []
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
            longest, weakest: bounds on a leg's length (m) and on its amplitude times the root of the cosine at the
                scatterer (1/m), for each candidate.
        """
        span = self._size, self._size + len(rows)
        self._size += len(rows)
        self._chains.append(chains)
        self._frame.append(np.full(len(chains), frame))
        self._range.append(np.tile(span, (len(chains), 1)))
        for column, values in ((self._rows, rows), (self._longest, longest), (self._weakest, weakest)):
            column.append(values)

    def legs(
        self, batch: Batch, candidates: Candidates, mirrors: Mirrors, wavelength: float, tables
    ) -> tuple[Legs, Float[np.ndarray, "leg 3 3"]]:
        """The legs there are, not yet tested for what is in the way.

        Returns:
            the legs, and the places of reflection on each in order, followed by the scatterer's (up to three), m.
        """
        if not self._size:
            return Legs.straight(batch, candidates, np.zeros(0, int)), np.zeros((0, 3, 3))
        chains, frame, span = (np.concatenate(x) for x in (self._chains, self._frame, self._range))
        rows, longest, weakest = (np.concatenate(x) for x in (self._rows, self._longest, self._weakest))
        s, scatterer = batch.scatterers, candidates.scatterer[rows]
        place = np.take(s.position, scatterer, axis=0)
        slots = np.concatenate([[0], np.cumsum(span[:, 1] - span[:, 0])])
        count = np.zeros(len(chains), np.int64)
        target, strength = np.empty(slots[-1], np.int32), np.empty(slots[-1], complex)
        planes = (mirrors.center, mirrors.normal)
        _strengths(
            chains, frame, span, slots, place, scatterer, s.normal, s.two_sided, longest, weakest, *planes, mirrors.u,
            mirrors.v, mirrors.half, mirrors.two_sided, mirrors.reflection, batch.position, batch.rotation, wavelength,
            *tables, count, target, strength,
        )  # fmt: skip
        first = np.concatenate([[0], np.cumsum(count)])
        n = first[-1]
        which, amplitude = np.empty(n, np.int64), np.empty(n, complex)
        stops, virtual, last = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
        _courses(
            chains, frame, slots, first, place, *planes, batch.position, target, strength, which, amplitude, stops,
            virtual, last,
        )  # fmt: skip
        bounces = np.repeat(1 + (chains[:, 1] >= 0), count)
        return Legs(rows[which], bounces, amplitude, virtual, last, np.zeros(n, bool)), stops


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
    chains, frame, span, slots, place, scatterer, face, open_face, longest, weakest, center, normal, u, v, half,
    two_sided, reflection, position, rotations, wavelength, azimuth_table, elevation_table, count, target, out,
):  # fmt: skip
    """Legs over every chain: their number, which places they lead to, and their amplitudes, from slots[chain] on."""
    for k in prange(len(chains)):
        p, rotation = vec(position[frame[k]]), rotations[frame[k]]
        up = (rotation[0, 2], rotation[1, 2], rotation[2, 2])
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
        n = slots[k]
        for i in range(span[k, 0], span[k, 1]):
            s = vec(place[i])
            hs = dot(minus(s, cl), nl)
            if hs * h < 0 or abs(hs) < 0.01 or abs(h) < 0.01:
                continue
            way = minus(s, image)
            full = length(way)
            if full > longest[i] or full < 1e-2:
                continue
            cosine = facing(
                face[scatterer[i]], (-way[0] / full, -way[1] / full, -way[2] / full), open_face[scatterer[i]]
            )
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
                target[n] = i
                out[n] = value
                n += 1
        count[k] = n - slots[k]


@njit(parallel=True, cache=True)
def _courses(
    chains, frame, slots, first, place, center, normal, position, target, strength, which, amplitude, stops, virtual,
    last,
):  # fmt: skip
    """The legs that exist, in a row: place, amplitude, places of reflection, virtual point and last reflection."""
    for k in prange(len(chains)):
        p, one, two = vec(position[frame[k]]), chains[k, 0], chains[k, 1]
        c1, n1 = vec(center[one]), vec(normal[one])
        source = _image(p, c1, n1)
        for e in range(first[k], first[k + 1]):
            j = slots[k] + e - first[k]
            which[e], amplitude[e] = target[j], strength[j]
            s = vec(place[target[j]])
            if two < 0:
                begin = _crossing(source, s, c1, n1)
                end, seen = begin, _image(s, c1, n1)
            else:
                c2, n2 = vec(center[two]), vec(normal[two])
                end = _crossing(_image(source, c2, n2), s, c2, n2)
                begin = _crossing(source, end, c1, n1)
                seen = _image(_image(s, c2, n2), c1, n1)
            for d in range(3):
                stops[e, 0, d] = begin[d]
                stops[e, 1, d] = end[d] if two >= 0 else s[d]
                stops[e, 2, d] = s[d]
                virtual[e, d] = seen[d]
                last[e, d] = end[d]
