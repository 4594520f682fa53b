"""Echoes over two or three mirrors without a scatterer: images of the radar itself, including corner reflectors.

A chain m_1 ... m_k maps the receiver to M rx, M = R_1 ... R_k the product of the reflections, and the echo's path
length is |tx - M rx|, straight through the mirrors unfolded along it. Two mirrors at right angles make M a half turn
about their edge, and three an inversion in their corner; the path passes the edge or corner itself for every position
of the radar, and each order of the mirrors has its own part of the wave.

The mirrors are apertures on the unfolded path. One at distance d from an end of a path of length L diffracts according
to its offset x over sqrt(lambda d (L - d) / (2 L)) (Fresnel), so in these units the apertures of a chain overlap to one
polygon W (a mirror that extends behind the next one ends where their planes meet: no ray gets there), and the amplitude
lambda / (4 pi L) of an infinite mirror is multiplied by F,

    F = (1 / 2j) int_W exp(j pi r^2 / 2) dA = (1 / 2 pi) closed int (1 - exp(j pi r^2 / 2)) dphi,

the Kirchhoff integral, here along the edges (Stokes, as Maggi and Rubinowicz did): 1 in the middle of large apertures,
1/2 on an edge, area over lambda times distance for small ones. So a dihedral of plates a x b has
8 pi a^2 b^2 / lambda^2, and a trihedral of triangles 4 pi a^4 / (3 lambda^2).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float, Int
from numba import njit

from radarsim.propagation import fresnelzone
from radarsim.propagation.apertures import FAR, kirchhoff, outlines, overlap
from radarsim.propagation.chain_aperture import GRAZING, inside, scratch, window
from radarsim.propagation.environment import View
from radarsim.propagation.fields import (
    along,
    dot,
    gain_towards,
    minus,
    mirrored,
    reflected,
    sent,
    unit,
    upright,
    upwards,
    vec,
    write,
)  # fmt: skip
from radarsim.propagation.fresnelzone import AT_RADAR, PathSegments
from radarsim.propagation.isometry import inverse
from radarsim.propagation.observation import Observation
from radarsim.propagation.paths import Kind, Paths
from radarsim.propagation.reflectors import Flat
from radarsim.propagation.table import Table, filled

#: Largest amplitude factor of an aperture: two slits of 1.17 (Cornu's spiral).
_MOST = 1.4


@dataclass(frozen=True)
class Chains(Table):
    """Chains of mirrors that lead from the sensor back to it, each in one of its two directions.

    The other direction has the same amplitude and the inverse isometry (`isometry.inverse`); a chain with the same
    mirror at both ends is its own reverse.

    Attributes:
        mirrors: indices; for two mirrors, the second one twice.
        isometry: of the receiver.
        amplitude: square root of received over transmitted power, with phase.
        stops: points of reflection of a ray along the chain (the last one repeated up to three), m.
    """

    mirrors: Int[np.ndarray, "chain 3"]
    isometry: Float[np.ndarray, "chain 3 4"]
    amplitude: Complex[np.ndarray, "chain"]
    stops: Float[np.ndarray, "chain 3 3"]


def find(view: View) -> Paths:
    """Find chains of two and three mirrors above the threshold, in both directions."""
    observation, flat = view.observation, view.flat
    found = [chains(flat, some.pairs, observation, k) for k, some in enumerate(view.mirrors)]
    frame, every = np.repeat(np.arange(len(found)), [len(f) for f in found]), Chains.joined(found)
    two = every.mirrors[:, 1] == every.mirrors[:, 2]
    segments = _segments(observation, flat, frame, every)
    passed = fresnelzone.passage(observation, flat, view.obstacles, segments, np.abs(every.amplitude))
    directions = []
    for reverse, rows in (
        (False, np.arange(len(every))),
        (True, np.flatnonzero(every.mirrors[:, 0] != every.mirrors[:, 2])),
    ):
        order = every.mirrors[rows, ::-1] if reverse else every.mirrors[rows]
        mirrors = np.full((len(rows), 4), -1)
        mirrors[:, :3] = np.where(two[rows, None], order[:, [1, 2, 0]] if reverse else order, order)
        mirrors[two[rows], 2] = -1
        isometry = inverse(every.isometry[rows]) if reverse else every.isometry[rows]
        paths = Paths.of(
            Kind.IMAGE, isometry, every.amplitude[rows], frame=frame[rows], bounces=3 - two[rows], mirrors=mirrors
        )
        directions.append(paths.behind(observation, passed[rows]))
    return Paths.joined(directions)


def _segments(observation: Observation, flat: Flat, frame: Int[np.ndarray, "chain"], chains: Chains) -> PathSegments:
    """The four path segments of each chain; for two mirrors, one has zero length."""
    here = observation.position[frame, None]
    stops = np.concatenate([here, chains.stops, here], axis=1)
    way = np.diff(stops, axis=1)
    size = np.linalg.norm(way, axis=2)
    there, whole = np.cumsum(size, axis=1)[:, :3], size.sum(axis=1)[:, None]
    unit = np.sqrt(observation.wavelength * there * (whole - there) / (2 * whole))
    now = way[:, 0] / size[:, 0, None]
    aside = np.cross(now, observation.rotation[frame, :, 2])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    axes = np.stack([aside, np.cross(now, aside)], axis=1)
    apart = np.empty((len(frame), 5, 2, 3))  # shift per unit, by stop
    apart[:, 0] = AT_RADAR * unit[:, 0, None, None] * axes
    for k in range(3):
        normal = flat.normal[chains.mirrors[:, k]]
        lift = np.einsum("cad,cd->ca", axes, normal)[..., None]
        slope = np.einsum("cd,cd->c", now, normal)[:, None]
        apart[:, k + 1] = unit[:, k, None, None] * (axes - lift * (now / slope)[:, None])  # in the mirror's plane
        last = (chains.mirrors[:, k] == chains.mirrors[:, min(k + 1, 2)]) & (k < 2)  # repeated: it reflects once
        axes = np.where(last[:, None, None], axes, axes - 2 * lift * normal[:, None])
        now = np.where(last[:, None], now, now - 2 * slope * normal)
    apart[:, 4] = AT_RADAR * unit[:, 2, None, None] * axes
    two = chains.mirrors[:, 1] == chains.mirrors[:, 2]
    mirrors = np.where(two[:, None] & (np.arange(3) == 2), -1, chains.mirrors)
    along = np.concatenate([np.zeros_like(whole), there, whole], axis=1) / whole
    mirrors, reflections, aside = (np.repeat(each, 4, axis=0) for each in (mirrors, chains.stops, apart[:, 1:4]))
    return PathSegments(
        path=np.repeat(np.arange(len(frame)), 4), frame=np.repeat(frame, 4),
        begin=stops[:, :-1].reshape(-1, 3), end=stops[:, 1:].reshape(-1, 3),
        before=apart[:, :-1].reshape(-1, 2, 3), after=apart[:, 1:].reshape(-1, 2, 3),
        mirrors=mirrors, stops=reflections, apart=aside,
        span=np.stack([along[:, :-1], along[:, 1:]], axis=2).reshape(-1, 2), mirroring=np.ones((4 * len(frame), 2)),
    )  # fmt: skip


class _Orders(NamedTuple):
    """Successors of mirrors: firsts[start[b] : start[b + 1]] are the mirrors that can be before b, and after it."""

    start: Int[np.ndarray, "mirror+1"]
    firsts: Int[np.ndarray, "pair"]


def chains(flat: Flat, pairs: Int[np.ndarray, "pair 2"], observation: Observation, frame: int) -> Chains:
    """Find chains of two and three mirrors above the threshold.

    Args:
        flat: mirrors.
        pairs: possible first and second mirrors (see `visible_mirrors.Mirrors`).
        observation, frame: sensor poses, and index of the frame.
    """
    pairs = pairs[np.lexsort(pairs.T)]
    orders = _Orders(np.searchsorted(pairs[:, 1], np.arange(len(flat) + 1)), np.ascontiguousarray(pairs[:, 0]))
    return filled(Chains, lambda found: _search(observation, frame, flat.columns, orders, found.columns))


@njit(cache=True)
def _search(observation, frame, flat, orders, found):
    """Try all possible chains; return the number that lead back, of which as many as fit are written."""
    p, rotation = vec(observation.position[frame]), observation.rotation[frame]
    up, wavelength, threshold = upwards(rotation), observation.wavelength, observation.threshold
    room, edges = scratch(), outlines(flat)
    images, way = np.empty((len(flat.center), 3)), np.empty(3, np.int64)
    for m in range(len(images)):
        write(mirrored(p, vec(flat.center[m]), vec(flat.normal[m])), images[m])
    count = 0
    for b in range(len(flat.center)):
        firsts = orders.firsts[orders.start[b] : orders.start[b + 1]]
        for i in range(len(firsts)):
            a = firsts[i]
            image_a = vec(images[a])
            image_b = mirrored(image_a, vec(flat.center[b]), vec(flat.normal[b]))
            for j in range(i - 1, len(firsts)):
                order = 2 if j < i else 3
                c = b if order == 2 else firsts[j]
                if order == 2 and (b < a or not _after(orders, b, a)):  # the reverse direction is not searched
                    continue
                # From the sensor's image in the first two mirrors straight to that in the last one, or to itself.
                middle = minus(p if order == 2 else vec(images[c]), image_b)
                path = dot(middle, middle)
                if path > 4 * observation.range**2 or path < 0.05**2:
                    continue
                path = np.sqrt(path)
                middle = (middle[0] / path, middle[1] / path, middle[2] / path)
                # The last mirror is met by that ray, the others by its reflections before them.
                if order == 3 and not _meets(image_b, middle, -1.0, path, wavelength, flat, edges, c):
                    continue
                if not _meets(image_b, middle, 1.0, path, wavelength, flat, edges, b):
                    continue
                ray = _turned(middle, flat, b)
                if not _meets(image_a, ray, 1.0, path, wavelength, flat, edges, a):
                    continue
                ray = _turned(ray, flat, a)
                back = middle if order == 2 else _turned(middle, flat, c)
                taken = gain_towards((-back[0], -back[1], -back[2]), rotation, observation)
                strength = wavelength / (4 * np.pi * path) * taken * gain_towards(ray, rotation, observation)
                if _MOST * strength <= threshold:
                    continue
                way[0], way[1], way[2] = a, b, c
                bounds, e1, e2, left = window(way[:order], p, path, ray, wavelength, flat, room)
                corners = overlap(room.planes, bounds, room.polygon, room.spare) if bounds >= 0 else 0
                if corners < 3:
                    continue
                share = left * kirchhoff(room.polygon, corners)
                if 1.001 * abs(share) * strength <= threshold:  # reflection coefficients last: they cost the most
                    continue
                value = _reflected(way[:order], up, ray, flat) * share * strength
                if abs(value) <= threshold:
                    continue
                if count < len(found.amplitude):
                    for k in range(3):
                        found.mirrors[count, k] = way[min(k, order - 1)]
                    _isometry(way[:order], flat, found.isometry[count])
                    found.amplitude[count] = value
                    # A ray through the polygon, which avoids the exact edge of corners.
                    zone, (x, y) = np.sqrt(wavelength * path / 8), inside(room, bounds, corners)
                    aim = along(along(along(p, path / 2, ray), zone * x, e1), zone * y, e2)
                    _course(way[:order], p, aim, flat, found.stops[count])
                count += 1
    return count


@njit
def _after(orders, a, b):
    """Whether b can follow mirror a."""
    some = orders.firsts[orders.start[b] : orders.start[b + 1]]
    at = np.searchsorted(some, a)
    return at < len(some) and some[at] == a


@njit
def _turned(ray, flat, m):
    """Direction of propagation after reflection in a mirror, or before it."""
    n = vec(flat.normal[m])
    return along(ray, -2 * dot(ray, n), n)


@njit
def _meets(image, ray, side, path, wavelength, flat, edges, m):
    """Whether a straight path from an image of the radar passes near a mirror: a fast test before `window`.

    Args:
        image: m.
        ray, side: direction after the mirror, and 1, or before it, and -1.
        path: length of the whole path, m.
        edges: of all mirrors (`apertures.outlines`).
        m: index of the mirror.
    """
    n = vec(flat.normal[m])
    slope = dot(ray, n)
    if side * slope <= GRAZING and (abs(slope) <= GRAZING or not flat.two_sided[m]):
        return False
    center = vec(flat.center[m])
    t = dot(minus(center, image), n) / slope
    if t <= 0.005 or t >= path - 0.005:
        return False
    low_u, high_u, low_v, high_v = edges[m]
    offset = minus(along(image, t, ray), center)
    x, y = dot(offset, vec(flat.u[m])), dot(offset, vec(flat.v[m]))
    # The zone is widest half way: an edge that is nearer to that than to the path in the mirror's plane counts.
    size = high_u - low_u + high_v - low_v
    widest = min(max(path / 2, t - size), t + size)
    margin = FAR * np.sqrt(wavelength * widest * (path - widest) / (2 * path)) / abs(slope)
    return low_u - margin < x < high_u + margin and low_v - margin < y < high_v + margin


@njit(cache=True)
def _reflected(way, up, ray, flat):
    """Product of the reflection coefficients of a chain along a ray, for vertical polarisation at both ends."""
    field, now = sent(up, ray), ray
    for m in way:
        after = _turned(now, flat, m)
        field = reflected(field, now, after, vec(flat.normal[m]), flat.layer[m])
        now = after
    return dot(field, upright(up, now))


@njit(cache=True)
def _isometry(way, flat, out):
    """R_1 ... R_k as matrix | offset."""
    for column in range(4):
        x = 1.0 * (column == 0), 1.0 * (column == 1), 1.0 * (column == 2)  # of the offset, the origin
        for k in range(len(way) - 1, -1, -1):
            n = vec(flat.normal[way[k]])
            height = dot(x, n) if column < 3 else dot(minus(x, vec(flat.center[way[k]])), n)
            x = along(x, -2 * height, n)
        out[0, column], out[1, column], out[2, column] = x


@njit(cache=True)
def _course(way, p, aim, flat, stops):
    """Points where a ray from p through a point meets the mirrors of a chain."""
    start, now = p, unit(minus(aim, p))
    for k in range(3):
        if k < len(way):
            n = vec(flat.normal[way[k]])
            t = dot(minus(vec(flat.center[way[k]]), start), n) / dot(now, n)
            start, now = along(start, t, now), _turned(now, flat, way[k])
        write(start, stops[k])
