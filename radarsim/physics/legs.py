"""Legs: the ways between the sensor and a scatterer, straight and over one or two mirrors, and the echoes they make.

A leg over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. An echo is a pair of
legs to the same scatterer, out on one and back on the other. The amplitude of a leg holds the antenna's gain, the
mirrors' reflection coefficients with polarisation and edges, the slabs it passes, and 1 / length; that of an echo

    a = lambda sqrt(sigma) / (4 pi)^(3/2) sqrt(cos_1 cos_2) leg_1 leg_2,

the radar equation |a|^2 = G^2 lambda^2 sigma / ((4 pi)^3 R^4) for a straight pair, with Lambert's cosine either way.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt8
from numba import njit

from radarsim.physics.amplitudes import dot, facing, length, minus, unit
from radarsim.physics.amplitudes import vector as vec
from radarsim.physics.batch import Batch
from radarsim.physics.candidates import Candidates
from radarsim.physics.echoes import Provenance
from radarsim.physics.lobes import scattering

#: Mirrors over which both legs of an echo go, together.
MOST_BOUNCES = 2


@dataclass(frozen=True)
class Legs:
    """Legs of a batch of frames.

    Attributes:
        candidate: row in the table of candidates: which scatterer in which frame.
        bounces: number of mirrors, 0 to 2.
        amplitude: see above, 1/m; phase as in the beat signal.
        virtual: the scatterer as seen through the mirrors, m.
        last: the last point before the scatterer: the sensor's, or a place of reflection, m.
        slab: whether it passes a slab.
    """

    candidate: Int[np.ndarray, "leg"]
    bounces: Int[np.ndarray, "leg"]
    amplitude: Complex[np.ndarray, "leg"]
    virtual: Float[np.ndarray, "leg 3"]
    last: Float[np.ndarray, "leg 3"]
    slab: Bool[np.ndarray, "leg"]

    def __len__(self) -> int:
        return len(self.candidate)

    def __getitem__(self, index) -> "Legs":
        return Legs(*(getattr(self, f.name)[index] for f in fields(self)))

    @classmethod
    def joined(cls, parts: list["Legs"]) -> "Legs":
        """All legs of several tables."""
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    @classmethod
    def straight(cls, batch: Batch, candidates: Candidates, rows: Int[np.ndarray, "leg"]) -> "Legs":
        """Straight legs to some candidates, not yet tested for what is in the way."""
        n = len(rows)
        return cls(
            rows, np.zeros(n, int), candidates.leg[rows].astype(complex),
            np.take(batch.scatterers.position, candidates.scatterer[rows], axis=0),
            np.take(batch.position, candidates.frame[rows], axis=0), np.zeros(n, bool),
        )  # fmt: skip

    def turn(self, places: Float[np.ndarray, "leg 3"]) -> Float[np.ndarray, "leg 3 3"]:
        """How the virtual point moves when the scatterer does: the mirror's reflection, for legs over at most one.

        A mirror's normal is along the line from the scatterer to its image.
        """
        normal = (places - self.virtual) * (self.bounces == 1)[:, None]
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        return np.eye(3) - 2 * normal[:, :, None] * normal[:, None]


@dataclass(frozen=True)
class Pairs:
    """Echoes as pairs of legs to the same scatterer, in either order, sorted by candidate.

    Attributes:
        legs: out and back.
        amplitude: square root of received over transmitted power, with phase.
        cause: a `Provenance` each.
    """

    legs: Int[np.ndarray, "echo 2"]
    amplitude: Complex[np.ndarray, "echo"]
    cause: UInt8[np.ndarray, "echo"]

    @classmethod
    def of(cls, batch: Batch, candidates: Candidates, legs: Legs, reach: float, weakest: float) -> "Pairs":
        """All pairs of legs that make an echo.

        Args:
            batch, candidates, legs: what they are made of.
            reach: half the longest path, m.
            weakest: echoes below are left out.
        """
        first, order = _grouped(legs.candidate, len(candidates))
        most = int(np.sum(np.diff(first) ** 2))
        ends, amplitude, cause = np.empty((most, 2), np.int64), np.empty(most, complex), np.empty(most, np.uint8)
        s = batch.scatterers
        n = _pairs(
            first, order, candidates.frame, candidates.scatterer, candidates.size, batch.position, legs.bounces,
            legs.amplitude, legs.virtual, legs.last, legs.slab, s.position, s.normal, s.two_sided, s.lobe, s.phase,
            batch.cause, batch.weights, reach, weakest, ends, amplitude, cause,
        )  # fmt: skip
        return cls(ends[:n], amplitude[:n], cause[:n])


@njit(cache=True)
def _grouped(group, groups):
    """Members of each group, in their order, as a counting sort: order[first[g] : first[g + 1]]."""
    first = np.zeros(groups + 1, np.int64)
    for g in group:
        first[g + 1] += 1
    for g in range(groups):
        first[g + 1] += first[g]
    order, at = np.empty(len(group), np.int64), first[:-1].copy()
    for i in range(len(group)):
        order[at[group[i]]] = i
        at[group[i]] += 1
    return first, order


_GHOST, _SLAB, _MOVING = int(Provenance.GHOST_1), int(Provenance.THROUGH_SLAB), int(Provenance.MOVING)


@njit(cache=True)
def _pairs(
    first, order, frame, scatterer, size, position, bounces, amplitude, virtual, last, slab, place, normal, two_sided,
    lobe, phase, cause, weights, reach, weakest, ends, out, why,
):  # fmt: skip
    n = 0
    for c in range(len(first) - 1):
        if first[c] == first[c + 1]:
            continue
        s, sensor = scatterer[c], vec(position[frame[c]])
        p, face = vec(place[s]), normal[s]
        turn = complex(np.cos(phase[s]), np.sin(phase[s]))
        for i in order[first[c] : first[c + 1]]:
            to_i = unit(minus(vec(last[i]), p))
            there = facing(face, to_i, two_sided[s])
            if there <= 0:
                continue
            way = length(minus(vec(virtual[i]), sensor))
            for j in order[first[c] : first[c + 1]]:
                if bounces[i] + bounces[j] > MOST_BOUNCES:
                    continue
                to_j, back, way_back = to_i, there, way
                if j != i:
                    to_j = unit(minus(vec(last[j]), p))
                    back = facing(face, to_j, two_sided[s])
                    way_back = length(minus(vec(virtual[j]), sensor))
                mirrors, passes = bounces[i] + bounces[j], slab[i] or slab[j]
                weight = weights[s, min(mirrors + passes, 2)]
                if back <= 0 or way + way_back > 2 * reach or weight == 0:
                    continue
                strength = size[c] * np.sqrt(scattering(there, back, dot(to_i, to_j), lobe[s]))
                value = strength * (amplitude[i] * amplitude[j])
                # what the weight adds stands for scatterers left out: it makes no echo worth keeping
                if abs(value) <= weakest:
                    continue
                ends[n, 0], ends[n, 1] = i, j
                out[n] = value * np.sqrt(weight) * turn
                why[n] = cause[s]
                if cause[s] != _MOVING:
                    if passes:
                        why[n] = _SLAB
                    elif mirrors > 0:
                        why[n] = _GHOST - 1 + mirrors
                n += 1
    return n
