"""Echoes of scatterers: direct, through slabs and over mirrors, with any combination of paths out and back.

Two one-way paths to the same scatterer (`one_way`) make an echo of amplitude

    a = lambda sqrt(sigma) / (4 pi)^(3/2) sqrt(cos_1 cos_2) path_1 path_2,

the radar equation |a|^2 = G^2 lambda^2 sigma / ((4 pi)^3 R^4) for a direct pair, with Lambert's cosine for each path.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

from radarsim.propagation.candidates import Candidates
from radarsim.propagation.environment import View
from radarsim.propagation.fields import dot, facing, length, minus, unit, vec
from radarsim.propagation.fresnelzone import LEAST_LOSS
from radarsim.propagation.media import scattering
from radarsim.propagation.mirror_reach import Trials
from radarsim.propagation.one_way import OneWay, over_mirrors
from radarsim.propagation.paths import Kind, Paths

#: Largest number of mirrors on the paths out and back together.
MOST_BOUNCES = 2
#: Smallest area of mirrors, m^2, for paths over two of them: at 2 m a Fresnel zone takes 0.02. Pairs of smaller ones
#: are much more numerous and contribute little.
LEAST_TWICE = 0.05


def find(view: View) -> Paths:
    """Find the echoes of all scatterers above the threshold."""
    straight = _straight(view)
    one_way = OneWay.joined([straight, _over_mirrors(view, straight)])
    return _two_way(view, one_way)


def _straight(view: View) -> OneWay:
    """Significant direct paths, those through slabs last."""
    candidates, targets, threshold = view.candidates, view.targets, view.observation.threshold
    rows = np.flatnonzero(candidates.echo > threshold)
    paths = OneWay.straight(view.observation, targets, candidates, rows)
    allowed = candidates.echo[paths.candidate] > LEAST_LOSS * threshold
    allowed &= targets.weights[candidates.scatterer[paths.candidate], 1] > 0
    paths = _unhindered(view, paths, paths.virtual[:, None], allowed)
    return OneWay.joined([paths[~paths.through], paths[paths.through]])


def _over_mirrors(view: View, straight: OneWay) -> OneWay:
    """Paths over one mirror and over two."""
    observation, targets, candidates, flat = view.observation, view.targets, view.candidates, view.flat
    trials, free = [], np.zeros(len(candidates), bool)
    free[straight.candidate[~straight.through]] = True
    once, twice = targets.weights[candidates.scatterer, 1:].T > 0
    # Hidden scatterers are visible only over mirrors out and back, a second-order echo: fewer of them suffice.
    rows = np.flatnonzero(np.where(free, once, twice))
    distance = candidates.distance[rows]
    # Upper bounds on length and attenuation, from the shortest and strongest path back.
    reached = np.zeros(len(candidates), bool)
    reached[straight.candidate] = True
    longest = np.where(reached[rows], 2 * observation.range - distance, observation.range)
    weakest = observation.threshold * distance / (observation.peak_gain * candidates.most[rows])
    # Tracks of virtual points exist for one mirror per path: moving targets have no paths over two.
    double = (reached & twice & (candidates.scatterer < targets.still))[rows]
    edges = np.searchsorted(candidates.frame[rows], np.arange(observation.frames + 1))
    for frame, (seen, pairs) in enumerate(view.mirrors):
        one = np.arange(edges[frame], edges[frame + 1])
        single = np.stack([seen, np.full(len(seen), -1)], axis=1)
        large = pairs[(flat.half[pairs].prod(axis=2) > LEAST_TWICE / 4).all(axis=1)]
        for chains, some in ((single, one), (large, one[double[one]])):
            trials.append(Trials(frame, chains, rows[some], longest[some], weakest[some]))
    paths, stops = over_mirrors(observation, targets, candidates, flat, trials)
    strength = _strongest_echoes(candidates, straight, paths)
    worth = strength > observation.threshold
    paths, stops, strength = paths[worth], stops[worth], strength[worth]
    allowed = twice[paths.candidate] & (strength > LEAST_LOSS * observation.threshold)
    return _unhindered(view, paths, stops, allowed)


def _unhindered(
    view: View, paths: OneWay, stops: Float[np.ndarray, "path stop 3"], allowed: Bool[np.ndarray, "path"]
) -> OneWay:
    """Paths that are clear from stop to stop, attenuated and delayed by slabs."""
    observation, frame = view.observation, view.candidates.frame[paths.candidate]
    passed = view.obstacles.way(observation, frame, stops, 1 + paths.bounces, allowed)
    clear = np.flatnonzero(passed.factor)
    paths, passed = paths[clear], passed[clear]
    paths = replace(paths, amplitude=paths.amplitude * passed.factor, through=passed.through)
    late = np.flatnonzero(paths.through)  # a delay shifts the virtual point away
    offset = paths.virtual[late] - observation.position[frame[clear[late]]]
    paths.virtual[late] += offset * (passed.delay[late] / np.linalg.norm(offset, axis=1))[:, None]
    return paths


def _strongest_echoes(candidates: Candidates, straight: OneWay, paths: OneWay) -> Float[np.ndarray, "path"]:
    """Upper bound of the amplitude of any echo that contains each path over mirrors."""
    size, best = np.abs(paths.amplitude), np.zeros(len(candidates))
    best[straight.candidate] = np.abs(straight.amplitude)
    np.maximum.at(best, paths.candidate, size)
    return candidates.most[paths.candidate] * size * best[paths.candidate]


def _two_way(view: View, one_way: OneWay) -> Paths:
    """All pairs of paths to the same scatterer whose echo is within range and above the threshold."""
    targets, candidates = view.targets, view.candidates
    first, order = _grouped(one_way.candidate, len(candidates))
    most = int(np.sum(np.diff(first) ** 2))
    pairs, amplitude = np.empty((most, 2), np.int64), np.empty(most, complex)
    grouped = _Grouped(first, order, candidates.frame, candidates.scatterer, candidates.size, targets.weights,
                       one_way.bounces)  # fmt: skip
    n = _join(view.observation, grouped, targets.scatterers.columns, one_way.columns, (pairs, amplitude))
    pairs, amplitude = pairs[:n], amplitude[:n]
    candidate = one_way.candidate[pairs[:, 0]]
    scatterer = candidates.scatterer[candidate]
    return Paths.of(
        Kind.POINT, np.take(one_way.virtual, pairs, axis=0), amplitude, frame=candidates.frame[candidate],
        bounces=one_way.bounces[pairs].sum(axis=1), through=one_way.through[pairs].any(axis=1),
        level=targets.scatterers.horizontal[scatterer], moving=scatterer >= targets.still,
        mirrors=np.take(one_way.mirrors, pairs, axis=0).reshape(-1, 4), scatterer=scatterer,
    )  # fmt: skip


class _Grouped(NamedTuple):
    """Candidates, and the paths to each as a counting sort: order[first[c] : first[c + 1]]."""

    first: Int[np.ndarray, "candidate+1"]
    order: Int[np.ndarray, "path"]
    frame: Int[np.ndarray, "candidate"]
    scatterer: Int[np.ndarray, "candidate"]
    size: Float[np.ndarray, "candidate"]
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


@njit(cache=True)
def _join(observation, grouped, scatterers, path, found):
    """Write pairs of paths and amplitudes of their echoes; return their number."""
    pairs, amplitude = found
    n = 0
    for c in range(len(grouped.first) - 1):
        some = grouped.order[grouped.first[c] : grouped.first[c + 1]]
        if len(some) == 0:
            continue
        s, sensor = grouped.scatterer[c], vec(observation.position[grouped.frame[c]])
        p, face, two_sided = vec(scatterers.position[s]), scatterers.normal[s], scatterers.two_sided[s]
        turn = complex(np.cos(scatterers.phase[s]), np.sin(scatterers.phase[s]))
        for i in some:
            to_i = unit(minus(vec(path.last[i]), p))
            there = facing(face, to_i, two_sided)
            if there <= 0:
                continue
            way = length(minus(vec(path.virtual[i]), sensor))
            for j in some:
                mirrors, passes = grouped.bounces[i] + grouped.bounces[j], path.through[i] or path.through[j]
                if mirrors > MOST_BOUNCES:
                    continue
                to_j, back, way_back = to_i, there, way
                if j != i:
                    to_j = unit(minus(vec(path.last[j]), p))
                    back = facing(face, to_j, two_sided)
                    way_back = length(minus(vec(path.virtual[j]), sensor))
                weight = grouped.weights[s, min(mirrors + passes, 2)]
                if back <= 0 or way + way_back > 2 * observation.range or weight == 0:
                    continue
                strength = grouped.size[c] * np.sqrt(scattering(there, back, dot(to_i, to_j), scatterers.lobe[s]))
                value = strength * (path.amplitude[i] * path.amplitude[j])
                # tested without the weight, which represents omitted scatterers
                if abs(value) <= observation.threshold:
                    continue
                pairs[n, 0], pairs[n, 1] = i, j
                amplitude[n] = value * np.sqrt(weight) * turn
                n += 1
    return n
