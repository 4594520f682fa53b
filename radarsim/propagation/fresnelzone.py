"""How much of a stretch of a mirrored path is clear: obstacles over its first Fresnel zones, not on one ray.

What a screen with openings leaves of a wave is Fresnel's integral over them, (1 / 2j) int exp(j pi r^2 / 2) dA in units
of sqrt(lambda d (L - d) / 2L). It is summed over the nodes of a Fibonacci lattice on a square of these units that ends
smoothly; such a lattice shows a thin pole as many nodes whichever way it stands (Niederreiter, Random Number Generation
and Quasi-Monte Carlo Methods, 1992, ch. 5). A few nodes tell whether a stretch is partly clear, and only then more are
looked at. Against strips it is good to half a dB (RMS); what they diffract from beyond the square is left out.

The rays of a stretch are straight, from its begin to its end: half as far apart at the radar as at the first mirror.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit

from radarsim.propagation.fields import cross, dot, minus
from radarsim.propagation.fields import vector as vec
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import Obstacles, Passage
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.table import Table

#: Slabs are looked for in the way of echoes that are at least this much stronger than the threshold.
LEAST_LOSS = 4.0
#: The same for zones: some 16 dB over noise.
LEAST_SPLIT = 20.0
#: At the radar rays are so far apart, as a share of what they are at a mirror.
AT_RADAR = 0.5
#: Fewer nodes than this within a mirror say less than the one ray through its middle.
_FEWEST = 4
#: No slit passes more than this of an amplitude.
_MOST = 1.17


class Lattice(NamedTuple):
    """Nodes over the first Fresnel zones, Fresnel units, and their weights."""

    nodes: Float[np.ndarray, "node 2"]
    weight: Complex[np.ndarray, "node"]

    @classmethod
    def fibonacci(cls, count: int, before: int, half: float) -> "Lattice":
        """So many nodes, a Fibonacci number, and the one before; half the side of the square, Fresnel units."""
        k = np.arange(count)
        nodes = half * (2 * np.stack([(k + 0.5) / count, (k * before + 0.5) / count % 1], axis=1) - 1)
        weight = np.exp(0.5j * np.pi * np.sum(nodes**2, axis=1)) * np.sqrt(
            np.cos(np.pi * nodes / (2 * half)).prod(axis=1)
        )
        return cls(nodes, weight / weight.sum())


_FEW, _MANY = Lattice.fibonacci(21, 13, 1.5), Lattice.fibonacci(55, 34, 1.5)


@dataclass(frozen=True)
class Stretches(Table):
    """Straight stretches of mirrored paths.

    Attributes:
        frame: index.
        begin, end: m.
        before, after: how far a Fresnel unit along either transverse axis moves begin and end, m.
        mirrors: of the whole path, in order, within whose outlines its rays are reflected; -1: none.
        stops: where on these, m.
        apart: how far a Fresnel unit along either transverse axis moves the stops, m.
    """

    frame: Int[np.ndarray, "stretch"]
    begin: Float[np.ndarray, "stretch 3"]
    end: Float[np.ndarray, "stretch 3"]
    before: Float[np.ndarray, "stretch 2 3"]
    after: Float[np.ndarray, "stretch 2 3"]
    mirrors: Int[np.ndarray, "stretch 3"]
    stops: Float[np.ndarray, "stretch 3 3"]
    apart: Float[np.ndarray, "stretch 3 2 3"]


def passage(
    observation: Observation, flat: Flat, obstacles: Obstacles, stretches: Stretches, size: Float[np.ndarray, "stretch"]
) -> Passage:
    """What is left of waves along stretches.

    Args:
        observation, flat, obstacles: the frames, the mirrors, and what is in the way.
        stretches: of paths.
        size: amplitude of each path if all of it were clear. Slabs are looked for, and more than one ray, where it is
            so much above the threshold that it matters.
    """
    worth = size > LEAST_LOSS * observation.threshold
    found = obstacles.passage(observation, stretches.frame, stretches.begin, stretches.end, worth)
    rows = np.flatnonzero(size > LEAST_SPLIT * observation.threshold)
    few, begin, end, inside = _rays(flat, stretches[rows], _FEW)
    clear = obstacles.clear(observation, stretches.frame[rows[few]], begin, end)
    # Alike are all that are as the ray in the middle; then what that met is all there is.
    unlike = np.zeros(len(rows), int)
    np.add.at(unlike, few, clear != (found.factor[rows[few]] == 1))
    rows = rows[(unlike > 0) & (inside.sum(axis=1) >= _FEWEST)]
    many, begin, end, inside = _rays(flat, stretches[rows], _MANY)
    passed = obstacles.passage(observation, stretches.frame[rows[many]], begin, end, np.ones(len(many), bool))
    late, strength = passed.delay, np.abs(passed.factor) ** 2
    weight = np.where(inside, _MANY.weight, 0)
    weight /= weight.sum(axis=1, keepdims=True)
    wavenumber = 2j * np.pi / observation.wavelength
    field, clear = np.zeros(len(rows), complex), np.zeros(len(rows), complex)
    power, later, slabs = np.full(len(rows), 1e-30), np.zeros(len(rows)), np.zeros(len(rows))
    np.add.at(field, many, weight[inside] * passed.factor * np.exp(wavenumber * late))
    np.add.at(clear, many, weight[inside] * (passed.blocked == 0))
    np.add.at(power, many, strength)
    np.add.at(later, many, strength * late)
    np.add.at(slabs, many, strength * passed.through)
    later /= power
    field *= np.minimum(1, _MOST / np.maximum(np.abs(field), 1e-12)) * np.exp(-wavenumber * later)
    found.factor[rows], found.delay[rows], found.through[rows] = field, later, slabs > power / 2
    found.blocked[rows] = 1 - np.minimum(np.abs(clear), 1)
    return found


def _rays(flat: Flat, stretches: Stretches, lattice: Lattice) -> tuple[np.ndarray, ...]:
    """Rays within the mirrors' outlines: whose, from where, to where; and which nodes of which stretch these are."""
    shape = len(stretches), len(lattice.nodes)
    begin, end, inside = np.empty((*shape, 3)), np.empty((*shape, 3)), np.empty(shape, np.bool_)
    _spread(flat.corners, flat.normal, stretches.columns, lattice.nodes, begin, end, inside)
    return np.nonzero(inside)[0], begin[inside], end[inside], inside


@njit(cache=True)
def _spread(corners, normal, stretches, nodes, begin, end, inside):
    bounds = np.empty((24, 3))
    for i in range(len(begin)):
        count = _bounds(corners, normal, stretches, i, bounds)
        for k in range(len(nodes)):
            x, y = nodes[k]
            for d in range(3):
                begin[i, k, d] = stretches.begin[i, d] + x * stretches.before[i, 0, d] + y * stretches.before[i, 1, d]
                end[i, k, d] = stretches.end[i, d] + x * stretches.after[i, 0, d] + y * stretches.after[i, 1, d]
            inside[i, k] = True
            for c in range(count):
                if bounds[c, 0] + x * bounds[c, 1] + y * bounds[c, 2] < -1e-9:
                    inside[i, k] = False
                    break


@njit
def _bounds(corners, normal, stretches, i, out):
    """Which rays of a path meet all of its mirrors, and each before the next: one that runs on behind another is lit
    and seen up to where their planes meet. Writes functions of a node, 1, x and y, not negative for these; returns how
    many."""
    count = 0
    for g in range(3):
        m = stretches.mirrors[i, g]
        if m < 0:
            continue
        stop, n = vec(stretches.stops[i, g]), vec(normal[m])
        x, y = vec(stretches.apart[i, g, 0]), vec(stretches.apart[i, g, 1])
        one, two = minus(vec(corners[m, 2]), vec(corners[m, 0])), minus(vec(corners[m, 3]), vec(corners[m, 1]))
        turn = np.sign(dot(cross(one, two), n))
        for k in range(4):
            one = vec(corners[m, k])
            inward = cross(n, minus(vec(corners[m, (k + 1) % 4]), one))
            count = _bound((turn, one, inward), (stop, x, y), out, count)
        for other in range(max(g - 1, 0), min(g + 2, 3)):
            b = stretches.mirrors[i, other]
            if b >= 0 and other != g:
                corner, facing = vec(corners[b, 0]), vec(normal[b])
                side = np.sign(dot(minus(stop, corner), facing))
                count = _bound((side, corner, facing), (stop, x, y), out, count)
    return count


@njit
def _bound(plane, rays, out, count):
    """Writes on which side of a plane (side, place, direction) rays are (stop, and by a node's x and y)."""
    side, place, direction = plane
    stop, x, y = rays
    out[count] = side * dot(minus(stop, place), direction), side * dot(x, direction), side * dot(y, direction)
    return count + 1
