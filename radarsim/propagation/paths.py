"""One-way paths between sensor and scatterer, straight and over one or two mirrors, and the two-way paths they make.

A one-way path over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. A two-way
path, an echo, goes out on one and back on another to the same scatterer. The amplitude of a one-way path holds the
antenna's gain, the mirrors' reflection coefficients with polarisation and apertures, the slabs it passes, and
1 / length; that of an echo

    a = lambda sqrt(sigma) / (4 pi)^(3/2) sqrt(cos_1 cos_2) path_1 path_2,

the radar equation |a|^2 = G^2 lambda^2 sigma / ((4 pi)^3 R^4) for a straight pair, with Lambert's cosine either way.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float, Int, UInt8
from numba import njit

from radarsim.propagation.candidates import Candidates
from radarsim.propagation.echoes import Provenance
from radarsim.propagation.fields import dot, facing, length, minus, unit
from radarsim.propagation.fields import vector as vec
from radarsim.propagation.observation import Observation
from radarsim.propagation.scatteringpattern import scattering
from radarsim.propagation.table import Table
from radarsim.propagation.targets import Targets

#: Mirrors over which an echo goes out and back, together.
MOST_BOUNCES = 2


@dataclass(frozen=True)
class OneWay(Table):
    """One-way paths of a observation.

    Attributes:
        candidate: row in the table of candidates: which scatterer in which frame.
        mirrors: in order from the sensor on, as indices of flat reflectors; -1: none.
        amplitude: see above, 1/m; phase as in the beat signal.
        virtual: the scatterer as seen through the mirrors, m.
        last: the last point before the scatterer: the sensor's, or a place of reflection, m.
        slab: whether it passes a slab.
    """

    candidate: Int[np.ndarray, "path"]
    mirrors: Int[np.ndarray, "path 2"]
    amplitude: Complex[np.ndarray, "path"]
    virtual: Float[np.ndarray, "path 3"]
    last: Float[np.ndarray, "path 3"]
    slab: Bool[np.ndarray, "path"]

    @property
    def bounces(self) -> Int[np.ndarray, "path"]:
        """Number of mirrors, 0 to 2."""
        return (self.mirrors >= 0).sum(axis=1)

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


@dataclass(frozen=True)
class TwoWay(Table):
    """Echoes as pairs of one-way paths to the same scatterer, in either order, sorted by candidate.

    Attributes:
        ways: out and back.
        amplitude: square root of received over transmitted power, with phase.
        cause: a `Provenance` each.
    """

    ways: Int[np.ndarray, "echo 2"]
    amplitude: Complex[np.ndarray, "echo"]
    cause: UInt8[np.ndarray, "echo"]

    @classmethod
    def of(cls, observation: Observation, targets: Targets, candidates: Candidates, one_way: OneWay) -> "TwoWay":
        """All pairs that make an echo within range and above the threshold."""
        first, order = _grouped(one_way.candidate, len(candidates))
        most = int(np.sum(np.diff(first) ** 2))
        found = cls(np.empty((most, 2), np.int64), np.empty(most, complex), np.empty(most, np.uint8))
        echoing = _Echoing(first, order, candidates.frame, candidates.scatterer, candidates.size, targets.cause,
                           targets.weights, one_way.bounces)  # fmt: skip
        return found[: _join(observation, echoing, targets.scatterers.columns, one_way.columns, found.columns)]


class _Echoing(NamedTuple):
    """Candidates, and the paths to each as a counting sort: order[first[c] : first[c + 1]]."""

    first: Int[np.ndarray, "candidate+1"]
    order: Int[np.ndarray, "path"]
    frame: Int[np.ndarray, "candidate"]
    scatterer: Int[np.ndarray, "candidate"]
    size: Float[np.ndarray, "candidate"]
    cause: UInt8[np.ndarray, "scatterer"]
    weights: Float[np.ndarray, "scatterer 3"]
    bounces: Int[np.ndarray, "path"]


@njit(cache=True)
def _grouped(group, groups):
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
def _join(observation, echoing, scatterers, path, found):
    """Fills `found`; returns how many there are."""
    n = 0
    for c in range(len(echoing.first) - 1):
        some = echoing.order[echoing.first[c] : echoing.first[c + 1]]
        if len(some) == 0:
            continue
        s, sensor = echoing.scatterer[c], vec(observation.position[echoing.frame[c]])
        p, face, two_sided = vec(scatterers.position[s]), scatterers.normal[s], scatterers.two_sided[s]
        turn = complex(np.cos(scatterers.phase[s]), np.sin(scatterers.phase[s]))
        for i in some:
            to_i = unit(minus(vec(path.last[i]), p))
            there = facing(face, to_i, two_sided)
            if there <= 0:
                continue
            way = length(minus(vec(path.virtual[i]), sensor))
            for j in some:
                mirrors, passes = echoing.bounces[i] + echoing.bounces[j], path.slab[i] or path.slab[j]
                if mirrors > MOST_BOUNCES:
                    continue
                to_j, back, way_back = to_i, there, way
                if j != i:
                    to_j = unit(minus(vec(path.last[j]), p))
                    back = facing(face, to_j, two_sided)
                    way_back = length(minus(vec(path.virtual[j]), sensor))
                weight = echoing.weights[s, min(mirrors + passes, 2)]
                if back <= 0 or way + way_back > 2 * observation.range or weight == 0:
                    continue
                strength = echoing.size[c] * np.sqrt(scattering(there, back, dot(to_i, to_j), scatterers.lobe[s]))
                value = strength * (path.amplitude[i] * path.amplitude[j])
                # what the weight adds stands for scatterers left out: it makes no echo worth keeping
                if abs(value) <= observation.threshold:
                    continue
                found.ways[n, 0], found.ways[n, 1] = i, j
                found.amplitude[n] = value * np.sqrt(weight) * turn
                found.cause[n] = echoing.cause[s]
                if echoing.cause[s] != _MOVING:
                    if passes:
                        found.cause[n] = _SLAB
                    elif mirrors > 0:
                        found.cause[n] = _GHOST - 1 + mirrors
                n += 1
    return n
