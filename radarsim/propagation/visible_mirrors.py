"""Which flat reflectors the radar sees, and which of them see one another by their mirror images."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.propagation.apertures import outlines
from radarsim.propagation.fields import along, dot, length, minus, vec
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import CLEARANCE, Obstacles
from radarsim.propagation.reflectors import Flat

#: A reflector is looked at in points, one to this area and at least `FEWEST`; one of which none is seen is left out.
SPACING, FEWEST, MOST = 0.02, 4, 240
#: Apertures pass some light by their edges: this far from them a ray may lie, m.
MARGIN = 0.1
#: A reflector stands before another from this height over its plane on, m: the faces of an outer edge do not see one
#: another, however near light passes the edge.
BEFORE = 1e-3


class Mirrors(NamedTuple):
    """Flat reflectors of one frame, as indices.

    Attributes:
        seen: those of which the radar sees something.
        pairs: the first one seen; light from the radar may go on from it to the second. A ray comes back over (a, b) if
            both (a, b) and (b, a) are among them, and over (a, b, c) if (a, b) and (c, b) are.
    """

    seen: Int[np.ndarray, "mirror"]
    pairs: Int[np.ndarray, "pair 2"]

    @classmethod
    def none(cls) -> "Mirrors":
        """No mirror."""
        return cls(np.zeros(0, int), np.zeros((0, 2), int))


def find(observation: Observation, flat: Flat, obstacles: Obstacles) -> list[Mirrors]:
    """Those of each frame."""
    return [
        Mirrors(some, couples(observation, frame, flat, some))
        for frame, some in enumerate(_seen(observation, flat, obstacles))
    ]


def couples(
    observation: Observation, frame: int, flat: Flat, firsts: Int[np.ndarray, "n"]
) -> Int[np.ndarray, "pair 2"]:
    """Pairs with the first among some, of which light can go on to the second."""
    follows = np.zeros((len(firsts), len(flat)), bool)
    _couple(flat.columns, observation, frame, firsts, follows)
    follows &= flat.present(frame)
    first, second = np.nonzero(follows)
    return np.stack([firsts[first], second], axis=1)


def _seen(observation: Observation, flat: Flat, obstacles: Obstacles) -> list[Int[np.ndarray, "n"]]:
    """Per frame, the reflectors in range that turn a face to the radar and of which something can be seen: slabs are
    clear, here, what stands behind too many of them costs less than rays that count them."""
    index = [_turned(flat, observation, frame) for frame in range(observation.frames)]
    opaque = None if obstacles.transmission is None else obstacles.transmission.opaque
    if opaque is None:
        return index
    frame, every = np.repeat(np.arange(len(index)), [len(i) for i in index]), np.concatenate(index)
    points, owner = _spread(flat, every, observation.position[frame], observation.range)
    found, number = np.zeros(len(every), bool), np.arange(len(owner)) - np.searchsorted(owner, owner)
    for some in (number < FEWEST, number >= FEWEST):  # most show themselves in a few points
        rows = np.flatnonzero(some & ~found[owner])
        clear = ~opaque.occluded(observation.position[frame[owner[rows]]], points[rows], margin=CLEARANCE)
        found[owner[rows[clear]]] = True
    return [every[(frame == k) & found] for k in range(observation.frames)]


def _turned(flat: Flat, observation: Observation, frame: int) -> Int[np.ndarray, "n"]:
    """Those of a frame with a part within range and in front that turn their face to the radar."""
    position, forward = observation.position[frame], observation.rotation[frame, :, 0]
    height = np.einsum("md,md->m", position - flat.center, flat.normal)
    axes = np.stack([flat.u, flat.v], axis=1)
    at = np.einsum("mkd,mad->mka", flat.corners - position, axes)
    away = np.linalg.norm(np.maximum(np.maximum(at.min(axis=1), -at.max(axis=1)), 0), axis=1)
    faced = (np.abs(height) > 0.01) & (flat.two_sided | (height > 0))
    ahead = (flat.corners @ forward).max(axis=1) > position @ forward
    return np.flatnonzero(faced & ahead & (np.hypot(height, away) < observation.range) & flat.present(frame))


def _spread(
    flat: Flat, index: Int[np.ndarray, "n"], around: Float[np.ndarray, "n 3"], reach: float
) -> tuple[Float[np.ndarray, "point 3"], Int[np.ndarray, "point"]]:
    """Points on reflectors, on the part within a square of +-`reach` around a position each; and whose they are."""
    u, v, half, center = flat.u[index], flat.v[index], flat.half[index], flat.center[index]
    foot = np.stack([np.einsum("md,md->m", around - center, axis) for axis in (u, v)], axis=1)
    low, high = np.clip(foot - reach, -half, half), np.clip(foot + reach, -half, half)
    count = np.clip((high - low).prod(axis=1) / SPACING, FEWEST, MOST).astype(int)
    owner = np.repeat(np.arange(len(index)), count)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 1
    # The additive recurrence of the plastic number: low discrepancy for any count (Roberts 2018).
    share = np.modf(0.5 + k[:, None] * np.array([0.7548776662466927, 0.5698402909980532]))[0]
    at = low[owner] + share * (high - low)[owner]
    return center[owner] + at[:, :1] * u[owner] + at[:, 1:] * v[owner], owner


@njit(parallel=True, cache=True)
def _couple(flat, observation, frame, firsts, found):
    """Which reflectors (columns) can follow the first ones (rows)."""
    radius, edges = _radius(flat.corners, flat.center), outlines(flat)
    for i in prange(len(firsts)):
        _follow(flat, radius, observation, frame, firsts[i], edges[firsts[i]], found[i])


@njit(cache=True)
def _radius(corners, center):
    """Distance of each centre from its farthest corner."""
    out = np.zeros(len(center))
    for b in range(len(center)):
        for k in range(4):
            out[b] = max(out[b], length(minus(vec(corners[b, k]), vec(center[b]))))
    return out


@njit(cache=True)
def _follow(flat, radius, observation, frame, a, window, found):
    """Either must stand before the other, and seen from the radar's image in the first, the second must overlap it, as
    a window."""
    p, ca, na = vec(observation.position[frame]), vec(flat.center[a]), vec(flat.normal[a])
    ua, va = vec(flat.u[a]), vec(flat.v[a])
    height = dot(minus(p, ca), na)
    image = along(p, -2 * height, na)
    side = 1.0 if height > 0 else -1.0
    height = abs(height)
    for b in range(len(radius)):
        if b == a:
            continue
        cb = vec(flat.center[b])
        way = minus(cb, image)
        if side * dot(minus(cb, ca), na) < -radius[b]:
            continue
        facing = dot(way, vec(flat.normal[b]))
        if facing > -0.01 and (facing < 0.01 or not flat.two_sided[b]):
            continue
        if length(way) + length(minus(cb, p)) - 2 * radius[b] > 2 * observation.range:
            continue
        nb, highest, farthest = vec(flat.normal[b]), -1e9, -1e9
        for k in range(4):
            highest = max(highest, side * dot(minus(vec(flat.corners[b, k]), ca), na))
            over = dot(minus(vec(flat.corners[a, k]), cb), nb)
            farthest = max(farthest, over if facing < 0 else -over)
        if highest < BEFORE or farthest < BEFORE:
            continue
        low_u, high_u, low_v, high_v = 1e9, -1e9, 1e9, -1e9
        for k in range(4):
            corner, after = vec(flat.corners[b, k]), vec(flat.corners[b, (k + 1) % 4])
            up, then = side * dot(minus(corner, ca), na), side * dot(minus(after, ca), na)
            for end in range(2):
                # a corner before the first, and where an edge passes through its plane
                if end == 0 and up >= 0:
                    at = along(image, height / (height + up), minus(corner, image))
                elif end == 1 and up * then < 0:
                    at = along(corner, up / (up - then), minus(after, corner))
                else:
                    continue
                x, y = dot(minus(at, ca), ua), dot(minus(at, ca), va)
                low_u, high_u, low_v, high_v = min(low_u, x), max(high_u, x), min(low_v, y), max(high_v, y)
        found[b] = (
            low_u < window[1] + MARGIN and high_u > window[0] - MARGIN
            and low_v < window[3] + MARGIN and high_v > window[2] - MARGIN
        )  # fmt: skip
