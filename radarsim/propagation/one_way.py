"""One-way paths between sensor and scatterer, direct and over one or two mirrors.

A one-way path over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. Its amplitude
includes the antenna's gain, the mirrors' reflection coefficients with polarisation and apertures, slabs, and 1 /
length.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Complex, Float, Int
from numba import njit, prange

from radarsim.propagation.apertures import aperture, aperture_diffraction, outside_aperture
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
from radarsim.propagation.media import UNCOVERED, mirror
from radarsim.propagation.mirror_reach import MOST, Trials, from_zero, image_in, lit, lit_ones
from radarsim.propagation.observation import Observation
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.table import Table
from radarsim.propagation.targets import Targets


@dataclass(frozen=True)
class OneWay(Table):
    """One-way paths of a batch.

    Attributes:
        candidate: row in the table of candidates, for scatterer and frame.
        mirrors: in order from the sensor on, as indices of flat reflectors; -1: none.
        amplitude: one-way amplitude, 1/m; phase as in the beat signal.
        virtual: image of the scatterer in the mirrors, m.
        last: last point before the scatterer: the sensor, or a point of reflection, m.
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
        """Direct paths to some candidates, before visibility tests."""
        n = len(rows)
        return cls(
            rows, np.full((n, 2), -1), candidates.straight[rows].astype(complex),
            np.take(targets.scatterers.position, candidates.scatterer[rows], axis=0),
            np.take(observation.position, candidates.frame[rows], axis=0), np.zeros(n, bool),
        )  # fmt: skip


def over_mirrors(
    observation: Observation, targets: Targets, candidates: Candidates, flat: Flat, trials: list[Trials]
) -> tuple[OneWay, Float[np.ndarray, "path 3 3"]]:
    """Find the paths over one mirror and over two, before visibility tests.

    Returns:
        The paths, and the points of reflection of each in order, followed by the scatterer (up to three), m.
    """
    chains, aims, count = lit(observation, targets, candidates, flat, trials)
    slots = from_zero(count)
    found, stops = OneWay.zeros(slots[-1]), np.zeros((slots[-1], 3, 3))
    _paths(observation, flat.columns, chains, aims, targets.scatterers.columns, slots, found.columns, stops)
    kept = np.flatnonzero(found.amplitude)
    return replace(found, mirrors=np.repeat(chains.mirrors, count, axis=0))[kept], stops[kept]


@njit(parallel=True, cache=True)
def _paths(observation, flat, chains, aims, scatterers, slots, found, stops):
    """Write the paths over every chain."""
    for k in prange(len(chains.frame)):
        _over(observation, flat, chains, k, aims, scatterers, (slots, found, stops))


@njit(cache=True)
def _over(observation, flat, chains, k, aims, scatterers, out):
    """Write the paths over one chain, from its slot on."""
    slots, found, stops = out
    frame = chains.frame[k]
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    up = upwards(rotation)
    one, two = chains.mirrors[k]
    last, source, image, h = image_in(p, flat, chains.mirrors[k])
    c1, n1, cl, nl = vec(flat.center[one]), vec(flat.normal[one]), vec(flat.center[last]), vec(flat.normal[last])
    window = aperture(flat, last)
    before, h1 = aperture(flat, one), dot(minus(p, c1), n1)
    n, most = slots[k], 1.001 * (MOST if two < 0 else MOST**2 * flat.layer[one, UNCOVERED].real)
    for i in chains.aims[k, 0] + lit_ones(chains.lit[chains.begin[k] : chains.begin[k + 1]]):
        s = vec(scatterers.position[aims.scatterer[i]])
        way = minus(s, image)
        full = length(way)
        hs = dot(minus(s, cl), nl)
        part = h / (h + hs)  # position of the last mirror as a fraction of the path
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
            if outside_aperture(bounce, earlier, wide, before):
                continue
        j = aims.scatterer[i]
        cosine = facing(scatterers.normal[j], (-way[0], -way[1], -way[2]), scatterers.two_sided[j])
        if cosine <= 0:
            continue
        leaving = minus(bounce, p)
        size = gain_towards(leaving, rotation, observation) / full
        least = aims.weakest[i] / np.sqrt(cosine)
        if most * size <= least:
            continue
        te, tm = mirror(flat.layer[last], min(abs(dot(way, nl)), 1.0))
        if most * size * max(abs(te), abs(tm)) <= least:
            continue
        passed = aperture_diffraction(stop, way, square, window)
        if two >= 0:
            passed *= aperture_diffraction(bounce, earlier, wide, before)
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
