"""Flat reflectors visible to the radar, and pairs of them visible over each other."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.propagation.apertures import outlines
from radarsim.propagation.fields import along, dot, length, minus, vec, write
from radarsim.propagation.hashgrid import nearby_order
from radarsim.propagation.observation import Observation
from radarsim.propagation.obstacles import CLEARANCE, Obstacles
from radarsim.propagation.reflectors import Flat

#: Area per test point of a reflector, and smallest number of points; a reflector without a visible point is left out.
SPACING, FEWEST, MOST = 0.02, 4, 240
#: Distance from its edge at which an aperture still passes some power, m; `apertures.FAR` zones at 8 m.
MARGIN = 0.25
#: Number of neighbouring reflectors tested together before one by one.
RUN = 16
#: Height above its plane from which a reflector is in front of another, m: the faces of an outer edge are not visible
#: to one another, however close to the edge a wave passes.
BEFORE = 1e-3


class Mirrors(NamedTuple):
    """Flat reflectors of one frame, as indices.

    Attributes:
        seen: reflectors with a visible part.
        pairs: visible first reflector, and the second one that waves from the radar can reach over it. Waves return
            over (a, b) if both (a, b) and (b, a) are pairs, and over (a, b, c) if (a, b) and (c, b) are.
    """

    seen: Int[np.ndarray, "mirror"]
    pairs: Int[np.ndarray, "pair 2"]

    @classmethod
    def none(cls) -> "Mirrors":
        """Empty set of mirrors."""
        return cls(np.zeros(0, int), np.zeros((0, 2), int))


def find(observation: Observation, flat: Flat, obstacles: Obstacles) -> list[Mirrors]:
    """Find the visible mirrors of each frame."""
    order = nearby_order(flat.center)
    return [
        Mirrors(some, couples(observation, frame, flat, some, order))
        for frame, some in enumerate(_seen(observation, flat, obstacles))
    ]


def couples(
    observation: Observation,
    frame: int,
    flat: Flat,
    firsts: Int[np.ndarray, "n"],
    order: Int[np.ndarray, "mirror"] | None = None,
) -> Int[np.ndarray, "pair 2"]:
    """Pairs with the first reflector among some, over which waves can reach the second (`order`: `nearby_order`)."""
    order = nearby_order(flat.center) if order is None else order
    follows = np.zeros((len(firsts), len(flat)), bool)
    _couple(flat.columns, observation, frame, firsts, order, follows)
    first, second = np.divmod(np.flatnonzero(follows), len(flat))  # ten times as fast as with two axes
    return np.stack([firsts[first], second], axis=1)


def _seen(observation: Observation, flat: Flat, obstacles: Obstacles) -> list[Int[np.ndarray, "n"]]:
    """Reflectors per frame that are in range, turn a face to the radar and have a visible part, through at most as many
    slabs as waves are traced."""
    turned = np.zeros((observation.frames, len(flat)), np.bool_)
    _turned(flat.columns, observation, turned)
    index = [np.flatnonzero(some) for some in turned]
    scene, slabs = obstacles.scene, obstacles.transmission
    opaque = None if slabs is None else slabs.opaque
    if scene is None or slabs is None or opaque is None:
        return index
    frame, every = np.repeat(np.arange(len(index)), [len(i) for i in index]), np.concatenate(index)
    points, owner = _spread(flat, every, observation.position[frame], observation.range)
    begin, number = observation.position[frame[owner]], np.arange(len(owner)) - np.searchsorted(owner, owner)
    found, clear = np.zeros(len(every), bool), np.zeros(len(owner), bool)
    for some in (number < FEWEST, number >= FEWEST):  # a few points are enough for most
        rows = np.flatnonzero(some & ~found[owner])
        clear[rows] = ~opaque.occluded(begin[rows], points[rows], margin=CLEARANCE)
        found[owner[clear]] = True
    if opaque is not scene:
        rows = np.flatnonzero(clear)
        rows = rows[np.arange(len(rows)) - np.searchsorted(owner[rows], owner[rows]) < FEWEST]
        free = ~scene.occluded(begin[rows], points[rows], margin=CLEARANCE)
        found[:] = False
        found[owner[rows[free]]] = True
        up = observation.rotation[frame[owner], :, 2]
        for _ in range(FEWEST):  # one point per reflector at a time: counting slabs is slow
            left = rows[~found[owner[rows]]]
            _, first = np.unique(owner[left], return_index=True)
            left = left[first]
            passed = slabs.passage(begin[left], points[left], up[left])[0] != 0
            found[owner[left[passed]]] = True
            rows = np.setdiff1d(rows, left, assume_unique=True)
    return [every[(frame == k) & found] for k in range(observation.frames)]


@njit(parallel=True, cache=True)
def _turned(flat, observation, found):
    """Reflectors of each frame with a part within range and in front, and a face turned to the radar."""
    for frame in prange(len(observation.position)):
        p, rotation = vec(observation.position[frame]), observation.rotation[frame]
        forward = rotation[0, 0], rotation[1, 0], rotation[2, 0]
        for m in range(len(flat.center)):
            height = dot(minus(p, vec(flat.center[m])), vec(flat.normal[m]))
            if abs(height) <= 0.01 or (height < 0 and not flat.two_sided[m]) or 0 <= flat.frame[m] != frame:
                continue
            u, v, ahead = vec(flat.u[m]), vec(flat.v[m]), -np.inf
            low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
            for k in range(4):
                way = minus(vec(flat.corners[m, k]), p)
                x, y, ahead = dot(way, u), dot(way, v), max(ahead, dot(way, forward))
                low_u, high_u, low_v, high_v = min(low_u, x), max(high_u, x), min(low_v, y), max(high_v, y)
            aside, above = max(low_u, -high_u, 0.0), max(low_v, -high_v, 0.0)
            square = height * height + aside * aside + above * above
            found[frame, m] = ahead > 0 and square < observation.range**2


def _spread(
    flat: Flat, index: Int[np.ndarray, "n"], around: Float[np.ndarray, "n 3"], reach: float
) -> tuple[Float[np.ndarray, "point 3"], Int[np.ndarray, "point"]]:
    """Test points on reflectors, on the part within a square of +-`reach` around a position; and their reflectors."""
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
def _couple(flat, observation, frame, firsts, order, found):
    """Mark the reflectors (columns) that can follow the first ones (rows)."""
    edges, p = outlines(flat), vec(observation.position[frame])
    balls, runs = np.empty((len(flat.center), 5)), np.empty((-(-len(flat.center) // RUN), 5))
    for b in range(len(balls)):
        m = order[b]
        write(vec(flat.center[m]), balls[b])
        balls[b, 3] = 0.0
        for k in range(4):
            balls[b, 3] = max(balls[b, 3], length(minus(vec(flat.corners[m, k]), vec(balls[b]))))
    for run in range(len(runs)):
        some, ball = balls[RUN * run : RUN * (run + 1)], runs[run]
        for axis in range(3):
            ball[axis] = np.mean(some[:, axis])
        ball[3] = 0.0
        for each in some:
            ball[3] = max(ball[3], length(minus(vec(each), vec(ball))) + each[3])
    for each in (balls, runs):  # largest distance of their centres from an image of the radar
        for ball in each:
            ball[4] = 2 * (observation.range + ball[3]) - length(minus(vec(ball), p))
    for i in prange(len(firsts)):
        _follow(flat, (frame, p), (order, balls, runs), firsts[i], edges[firsts[i]], found[i])


@njit(cache=True)
def _follow(flat, radar, balls, a, window, found):
    """Reflectors that can follow one: each must be in front of the other, and, seen from the radar's image in the
    first, the second must overlap its window. A fast test of bounding balls, of groups and of each, leaves few for the
    exact test."""
    (frame, p), (order, each, runs) = radar, balls
    ca, na, ua, va = vec(flat.center[a]), vec(flat.normal[a]), vec(flat.u[a]), vec(flat.v[a])
    height = dot(minus(p, ca), na)
    image, side, height = along(p, -2 * height, na), 1.0 if height > 0 else -1.0, abs(height)
    before, foot = (side * na[0], side * na[1], side * na[2]), minus(image, ca)
    x, y = dot(foot, ua), dot(foot, va)
    borders = (
        _border(before, ua, height, window[0] - MARGIN - x), _border(before, ua, height, window[1] + MARGIN - x),
        _border(before, va, height, window[2] - MARGIN - y), _border(before, va, height, window[3] + MARGIN - y),
    )  # fmt: skip
    for run in range(len(runs)):
        if _beside(runs[run], image, before, height, borders):
            continue
        for k in range(RUN * run, min(RUN * (run + 1), len(each))):
            b = order[k]
            if b == a or _beside(each[k], image, before, height, borders) or 0 <= flat.frame[b] != frame:
                continue
            facing = dot(minus(vec(each[k]), image), vec(flat.normal[b]))
            if facing > -0.01 and (facing < 0.01 or not flat.two_sided[b]):
                continue
            found[b] = _overlap(flat, a, b, (image, before, height), facing, window)


@njit
def _beside(ball, image, before, height, borders):
    """Whether a ball (centre, radius, reach) is behind a mirror, beside its window from an image, or too far."""
    way, r, reach = minus(vec(ball), image), ball[3], ball[4]
    if dot(way, before) - height < -r or dot(way, way) > reach * abs(reach):
        return True
    low_u, high_u, low_v, high_v = borders
    return dot(way, high_u) > r or dot(way, low_u) < -r or dot(way, high_v) > r or dot(way, low_v) < -r


@njit
def _border(before, axis, height, aside):
    """Unit normal of the plane through the radar's image and a line across an axis at a given offset in the mirror."""
    size = np.hypot(height, aside)
    return along((-aside / size * before[0], -aside / size * before[1], -aside / size * before[2]), height / size, axis)


@njit(cache=True)
def _overlap(flat, a, b, radar, facing, window):
    """The exact test of one reflector, by its corners."""
    ca, ua, va, cb, nb = vec(flat.center[a]), vec(flat.u[a]), vec(flat.v[a]), vec(flat.center[b]), vec(flat.normal[b])
    image, before, height = radar
    highest, farthest = -1e9, -1e9
    for k in range(4):
        highest = max(highest, dot(minus(vec(flat.corners[b, k]), ca), before))
        over = dot(minus(vec(flat.corners[a, k]), cb), nb)
        farthest = max(farthest, over if facing < 0 else -over)
    if highest < BEFORE or farthest < BEFORE:
        return False
    low_u, high_u, low_v, high_v = 1e9, -1e9, 1e9, -1e9
    for k in range(4):
        corner, after = vec(flat.corners[b, k]), vec(flat.corners[b, (k + 1) % 4])
        up, then = dot(minus(corner, ca), before), dot(minus(after, ca), before)
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
    return (
        low_u < window[1] + MARGIN and high_u > window[0] - MARGIN
        and low_v < window[3] + MARGIN and high_v > window[2] - MARGIN
    )  # fmt: skip
