"""Which flat reflectors the radar sees, and which of them see one another by their mirror images."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit, prange

from radarsim.propagation.apertures import outlines
from radarsim.propagation.fields import along, dot, length, minus
from radarsim.propagation.fields import vector as vec
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
    turned = np.zeros((observation.frames, len(flat)), np.bool_)
    _turned(flat.columns, observation, turned)
    index = [np.flatnonzero(some) for some in turned]
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


@njit(parallel=True, cache=True)
def _turned(flat, observation, found):
    """Which reflectors of each frame have a part within range and in front, and turn their face to the radar."""
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
    edges = outlines(flat)
    balls = _Balls(flat.center.T.copy(), flat.normal.T.copy(), _radius(flat.corners, flat.center), flat.two_sided)
    for i in prange(len(firsts)):
        _before(flat, balls, observation, frame, firsts[i], found[i])
        for b in range(len(found[i])):
            if found[i, b]:
                found[i, b] = _overlap(flat, vec(observation.position[frame]), firsts[i], edges[firsts[i]], b)


class _Balls(NamedTuple):
    """Balls around reflectors, by coordinate."""

    center: Float[np.ndarray, "3 mirror"]
    normal: Float[np.ndarray, "3 mirror"]
    radius: Float[np.ndarray, "mirror"]
    two_sided: Bool[np.ndarray, "mirror"]


@njit(cache=True)
def _radius(corners, center):
    """Distance of each centre from its farthest corner."""
    out = np.zeros(len(center))
    for b in range(len(center)):
        for k in range(4):
            out[b] = max(out[b], length(minus(vec(corners[b, k]), vec(center[b]))))
    return out


@njit
def _image(flat, p, a):
    """The radar's image in a mirror, which side of it the radar is on, and how far from its plane."""
    center, normal = vec(flat.center[a]), vec(flat.normal[a])
    height = dot(minus(p, center), normal)
    return along(p, -2 * height, normal), (1.0 if height > 0 else -1.0), abs(height)


@njit(cache=True, error_model="numpy")
def _before(flat, balls, observation, frame, a, found):
    """A quick look at all in whole arrays: which stand before the first one, at least in part, turn a face to the
    radar's image in it, and are within range."""
    p, (cx, cy, cz), (nx, ny, nz) = vec(observation.position[frame]), vec(flat.center[a]), vec(flat.normal[a])
    (ix, iy, iz), side, _ = _image(flat, p, a)
    x, y, z = balls.center
    u, v, w = balls.normal
    for b in range(len(found)):
        dx, dy, dz = x[b] - ix, y[b] - iy, z[b] - iz
        facing = dx * u[b] + dy * v[b] + dz * w[b]
        way = np.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = x[b] - p[0], y[b] - p[1], z[b] - p[2]
        way += np.sqrt(dx * dx + dy * dy + dz * dz)
        above = side * ((x[b] - cx) * nx + (y[b] - cy) * ny + (z[b] - cz) * nz)
        found[b] = (
            (above >= -balls.radius[b]) & ((facing <= -0.01) | ((facing >= 0.01) & balls.two_sided[b]))
            & (way - 2 * balls.radius[b] <= 2 * observation.range)
        )  # fmt: skip
    found[a] = False


@njit(cache=True)
def _overlap(flat, p, a, window, b):
    """Whether either stands before the other, and seen from the radar's image in the first, the second overlaps it, as
    a window."""
    ca, na, cb, nb = vec(flat.center[a]), vec(flat.normal[a]), vec(flat.center[b]), vec(flat.normal[b])
    image, side, height = _image(flat, p, a)
    turn = 1.0 if dot(minus(cb, image), nb) < 0 else -1.0
    highest, farthest = -1e9, -1e9
    for k in range(4):
        highest = max(highest, side * dot(minus(vec(flat.corners[b, k]), ca), na))
        farthest = max(farthest, turn * dot(minus(vec(flat.corners[a, k]), cb), nb))
    if highest < BEFORE or farthest < BEFORE:
        return False
    ua, va = vec(flat.u[a]), vec(flat.v[a])
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
    return (
        low_u < window[1] + MARGIN and high_u > window[0] - MARGIN
        and low_v < window[3] + MARGIN and high_v > window[2] - MARGIN
    )  # fmt: skip
