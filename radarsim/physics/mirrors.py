"""The mirrors of a scene: large flat facets, which of them the sensor sees, and which see one another."""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Complex, Float, Int

from radarsim.physics.facets import Facets
from radarsim.scene.scene import Scene

#: Points spread over the part of a mirror within reach; a mirror of which none is seen is left out.
SAMPLES = 24
#: Facets this close are joined, m: two of them at right angles form a corner.
SEAM = 0.01


@dataclass(frozen=True)
class Mirrors:
    """Mirrors, and the smaller plates that form corners.

    Attributes:
        corners, center, normal, u, v, half, two_sided, horizontal, reflection: as in `Facets`.
        large: a mirror for scatterers as well, not only part of a corner.
        first, following: what can be the next mirror after mirror m on a ray's way:
            following[first[m] : first[m + 1]].
    """

    corners: Float[np.ndarray, "mirror 4 3"]
    center: Float[np.ndarray, "mirror 3"]
    normal: Float[np.ndarray, "mirror 3"]
    u: Float[np.ndarray, "mirror 3"]
    v: Float[np.ndarray, "mirror 3"]
    half: Float[np.ndarray, "mirror 2"]
    two_sided: Bool[np.ndarray, "mirror"]
    horizontal: Bool[np.ndarray, "mirror"]
    reflection: Complex[np.ndarray, "mirror 2 cosine"]
    large: Bool[np.ndarray, "mirror"]
    first: Int[np.ndarray, "mirror+1"]
    following: Int[np.ndarray, "pair"]

    def __len__(self) -> int:
        return len(self.center)

    @classmethod
    def of(cls, facets: Facets, scene: Scene | None, reach: float) -> "Mirrors":
        """The mirrors and corners among facets; no ray is longer than `reach` (m) between two of them."""
        pairs = np.concatenate([_in_sight(facets, scene, reach), _corners(facets)])
        pairs = np.unique(pairs, axis=0)
        member = facets.mirror.copy()
        member[pairs] = True
        index = np.flatnonzero(member)
        number = np.cumsum(member) - 1
        names = "corners", "center", "normal", "u", "v", "half", "two_sided", "horizontal", "reflection"
        return cls(
            *(getattr(facets, name)[index] for name in names),
            facets.mirror[index],
            np.searchsorted(number[pairs[:, 0]], np.arange(len(index) + 1)),
            number[pairs[:, 1]],
        )

    def near(
        self, position: Float[np.ndarray, "3"], forward: Float[np.ndarray, "3"], reach: float
    ) -> Int[np.ndarray, "n"]:
        """Mirrors with a part within reach and in front that turn their face to a position."""
        height = np.einsum("md,md->m", position - self.center, self.normal)
        away = np.linalg.norm(self._beyond(position), axis=1)
        faced = (np.abs(height) > 0.01) & (self.two_sided | (height > 0))
        ahead = (self.corners @ forward).max(axis=1) > position @ forward
        return np.flatnonzero(faced & ahead & (np.hypot(height, away) < reach))

    def pairs(self, firsts: Int[np.ndarray, "n"], position: Float[np.ndarray, "3"]) -> Int[np.ndarray, "pair 2"]:
        """Pairs of large mirrors, the first one of `firsts`, of which light from a position can reach the second."""
        size = self.first[firsts + 1] - self.first[firsts]
        one = np.repeat(firsts, size)
        two = self.following[np.arange(len(one)) + np.repeat(self.first[firsts] - np.cumsum(size) + size, size)]
        one, two = one[self.large[two]], two[self.large[two]]
        # Seen from the first image, the second mirror must overlap the first, as a window.
        normal, center = self.normal[one], self.center[one]
        height = np.einsum("pd,pd->p", position - center, normal)[:, None]
        image = (position - 2 * height * normal)[:, None]
        level = np.einsum("pkd,pd->pk", self.corners[two] - center[:, None], normal) * np.sign(height)
        share = np.abs(height) / (np.abs(height) + np.maximum(level, 0))
        seen = image + share[..., None] * (self.corners[two] - image) - center[:, None]
        ok = np.ones(len(one), bool)
        for axis, half in ((self.u[one], self.half[one, 0]), (self.v[one], self.half[one, 1])):
            at = np.einsum("pkd,pd->pk", seen, axis)
            ok &= (at.min(axis=1) < half + 0.1) & (at.max(axis=1) > -half - 0.1)
        ok |= level.min(axis=1) < -1e-3  # partly behind the first mirror: not bounded by its corners
        return np.stack([one[ok], two[ok]], axis=1)

    def _beyond(self, position: np.ndarray) -> Float[np.ndarray, "mirror 2"]:
        """How far the foot of a position lies outside each, along u and v; 0 inside of what they span."""
        axes = np.stack([self.u, self.v], axis=1)
        at = np.einsum("mkd,mad->mka", self.corners - position, axes)
        return np.maximum(np.maximum(at.min(axis=1), -at.max(axis=1)), 0)

    def spread(self, mirrors: Int[np.ndarray, "n"], around: Float[np.ndarray, "3"], reach: float) -> np.ndarray:
        """`SAMPLES` points on each of some mirrors, on the part within a square of +-`reach` around a position, m."""
        return _spread(self, mirrors, np.broadcast_to(around, (len(mirrors), 3)), reach)


def _spread(rectangles, index, around, reach) -> Float[np.ndarray, "n samples 3"]:
    # The additive recurrence of the plastic number: low discrepancy for any count (Roberts 2018).
    k = np.arange(1, SAMPLES + 1)[:, None]
    share = 2 * np.modf(0.5 + k * np.array([0.7548776662466927, 0.5698402909980532]))[0] - 1
    u, v, half, center = (getattr(rectangles, name)[index] for name in ("u", "v", "half", "center"))
    foot = np.stack([np.einsum("md,md->m", around - center, u), np.einsum("md,md->m", around - center, v)], axis=1)
    low, high = np.clip(foot - reach, -half, half), np.clip(foot + reach, -half, half)
    at = (low + high)[:, None] / 2 + share * (high - low)[:, None] / 2
    return center[:, None] + at[..., :1] * u[:, None] + at[..., 1:] * v[:, None]


def _touching(facets: Facets, index: np.ndarray, distance: float) -> Int[np.ndarray, "pair 2"]:
    """Ordered pairs of facets whose bounding boxes come within a distance, m."""
    low, high = facets.corners[index].min(axis=1), facets.corners[index].max(axis=1)
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    grown = shapely.box(*(low[:, :2] - distance).T, *(high[:, :2] + distance).T)
    a, b = tree.query(grown)
    near = (a != b) & (low[a, 2] - distance < high[b, 2]) & (low[b, 2] - distance < high[a, 2])
    return np.stack([index[a[near]], index[b[near]]], axis=1)


def _facing(facets: Facets, pairs: np.ndarray) -> np.ndarray:
    """Those pairs of which either has a part in front of the other."""
    ok = np.ones(len(pairs), bool)
    for a, b in (pairs.T, pairs.T[::-1]):
        height = np.einsum("pkd,pd->pk", facets.corners[b] - facets.corners[a, :1], facets.normal[a])
        ok &= (height.max(axis=1) > SEAM) | (facets.two_sided[a] & (height.min(axis=1) < -SEAM))
    return pairs[ok]


def _in_sight(facets: Facets, scene: Scene | None, reach: float) -> Int[np.ndarray, "pair 2"]:
    """Ordered pairs of mirrors that see one another, by rays between points spread over both."""
    pairs = _facing(facets, _touching(facets, np.flatnonzero(facets.mirror), reach))
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    seen = np.ones(len(pairs), bool)
    if scene is not None:
        for part in np.array_split(np.arange(len(pairs)), len(pairs) // 20000 + 1):
            a, b = pairs[part].T
            # of the larger one only what lies around the smaller
            swap = facets.half[a].max(axis=1) > facets.half[b].max(axis=1)
            a, b = np.where(swap, b, a), np.where(swap, a, b)
            start = _spread(facets, a, facets.center[b], np.inf)
            end = _spread(facets, b, facets.center[a], reach)[:, (7 * np.arange(SAMPLES)) % SAMPLES]
            blocked = scene.occluded(start.reshape(-1, 3), end.reshape(-1, 3), margin=5e-3)
            seen[part] = ~blocked.reshape(-1, SAMPLES).all(axis=1)
    pairs = pairs[seen]
    return np.concatenate([pairs, pairs[:, ::-1]])


def _corners(facets: Facets) -> Int[np.ndarray, "pair 2"]:
    """Ordered pairs of facets, small ones too, that meet at a right angle with their faces towards each other."""
    pairs = _facing(facets, _touching(facets, np.arange(len(facets)), SEAM))
    square = np.abs(np.einsum("pd,pd->p", facets.normal[pairs[:, 0]], facets.normal[pairs[:, 1]])) < 1e-3
    return pairs[square]
