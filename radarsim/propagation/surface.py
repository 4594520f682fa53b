"""Diffuse surface of a scene: scatterers generated on demand, reproducibly.

The triangles are split until no edge is longer than a metre and grouped into tiles. A tile's scatterers are not stored:
position, phase and rank of the k-th one follow from the seed, the tile's index and k by hashing. So memory is that of
the triangles, whatever the density; the cost of a frame depends on the surfaces in the radar's reach, not on the size
of the building; and speckle is a property of the world. Within a tile, scatterers follow a low-discrepancy sequence
(R2, Roberts 2018) in the order of their ranks, so that any first few of them cover it evenly: see `detail`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from numba import njit, prange

from radarsim.propagation.clutter import Clutter, uncovered
from radarsim.propagation.hashgrid import Grid
from radarsim.propagation.level_of_detail import FULL_DETAIL
from radarsim.propagation.media import weights
from radarsim.propagation.reverberation import Detours
from radarsim.propagation.scatterers import BOUNCE_STRIDE, Scatterers
from radarsim.world.scene import Scene

#: Scatterers per square metre at full detail; with level of detail twelve or more remain in a range-azimuth cell of
#: the `radarize` preset in an office.
DENSITY = 300.0
#: Edge of the cells of tiles, and longest edge of a triangle, m.
TILE = 1.0
# Steps of the R2 sequence: powers of the inverse of the plastic number.
_R2 = (0.7548776662466927, 0.5698402909980532)


class Surface:
    """All scattering surfaces of a scene.

    Args:
        scene: the world; objects with sigma0 = 0 have no scatterers.
        rng: random generator of the seed.
        density: scatterers per square metre at full detail.
    """

    def __init__(self, scene: Scene, rng: np.random.Generator, density: float = DENSITY):
        self.density = density
        self.seed = rng.integers(2**63, dtype=np.uint64)
        used = [o for o in scene.objects if o.material.sigma0 > 0]
        parts = [_split(o.mesh.triangles) for o in used]
        triangles = np.concatenate([np.zeros((0, 3, 3)), *parts])
        owner = np.repeat(np.arange(len(used)), [len(p) for p in parts])
        # A tile: triangles of one object whose centres share a cell.
        key = np.column_stack([owner, np.floor(triangles.mean(axis=1) / TILE).astype(int)])
        _, tile = np.unique(key, axis=0, return_inverse=True)
        order = np.argsort(tile, kind="stable")
        self._triangles, owner, tile = triangles[order], owner[order], tile[order]
        self._first = np.flatnonzero(np.diff(tile, prepend=-1, append=-1))
        cross = np.cross(self._triangles[:, 1] - self._triangles[:, 0], self._triangles[:, 2] - self._triangles[:, 0])
        double = np.linalg.norm(cross, axis=1)
        self._normals = cross / np.maximum(double, 1e-300)[:, None]
        self._areas = np.cumsum(double / 2)
        self._tile_areas = np.add.reduceat(double / 2, self._first[:-1]) if len(tile) else np.zeros(0)
        self._horizontal = np.zeros(len(owner), bool)
        edges = np.searchsorted(owner, np.arange(len(used) + 1))  # tiles are in the order of objects
        for item, begin, end in zip(used, edges, edges[1:], strict=False):
            here = self._triangles[begin:end].mean(axis=1), self._normals[begin:end]
            self._horizontal[begin:end] = item.floors_and_ceilings(*here)
        corners = self._triangles.reshape(-1, 3)
        starts = 3 * self._first[:-1]
        low, high = (f.reduceat(corners, starts) if len(tile) else corners for f in (np.minimum, np.maximum))
        self._grid = Grid(low, high)
        self._owner = owner[self._first[:-1]]
        left = uncovered(scene, self._triangles.mean(axis=1), self._normals)
        self._sigma = (np.array([o.material.sigma0 for o in used]) / density)[owner] * left
        self._two_sided = np.array([o.two_sided for o in used], bool)
        self._lobe = np.array([weights(o.material) for o in used]).reshape(-1, 4)

    def __len__(self) -> int:
        """Mean number of all scatterers."""
        return int(self._tile_areas.sum() * self.density)

    def near(self, positions: Float[np.ndarray, "position 3"], reach: float) -> Scatterers:
        """Scatterers within `reach` (m) of any of the positions whose rank makes them visible from there."""
        tiles, distance = self._grid.near(positions, reach)
        return self._draw(tiles, np.minimum(2 * FULL_DETAIL / np.maximum(distance, 1e-3), 1.0))

    def all(self) -> Scatterers:
        """Every scatterer, at full weight at any distance."""
        drawn = self._draw(np.arange(len(self._owner)), np.ones(len(self._owner)))
        return replace(drawn, rank=np.full(len(drawn), -1.0))

    def _draw(self, tiles: Int[np.ndarray, "tile"], highest: Float[np.ndarray, "tile"]) -> Scatterers:
        """Generate the scatterers of some tiles up to a rank each."""
        totals, counts = _counts(self.seed, tiles, self._tile_areas * self.density, highest)
        ends = np.cumsum(counts)
        total = int(ends[-1]) if len(ends) else 0
        drawn, triangle = Scatterers.zeros(total), np.empty(total, np.int64)
        columns = drawn.position, triangle, drawn.phase, drawn.rank, drawn.bounces, drawn.bounces_twice
        _place(self.seed, tiles, totals, counts, ends, (self._first, self._areas, self._triangles), columns)
        owner = np.repeat(self._owner[tiles], counts)
        return replace(
            drawn, normal=self._normals.take(triangle, axis=0), sigma=self._sigma[triangle],
            two_sided=self._two_sided[owner], horizontal=self._horizontal[triangle],
            lobe=self._lobe.take(owner, axis=0),
        )  # fmt: skip


@dataclass(frozen=True)
class Cluttered:
    """A surface and the small objects on it, as one set of scatterers, with the diffuse multipath between them."""

    surface: Surface
    clutter: Clutter
    detours: Detours

    def __len__(self) -> int:
        return len(self.surface) + len(self.clutter)

    def near(self, positions: Float[np.ndarray, "position 3"], reach: float) -> Scatterers:
        """Scatterers within `reach` (m) of any of the positions, see `Surface.near`."""
        return Scatterers.joined([part.near(positions, reach) for part in (self.surface, self.clutter)])


Scattering = Surface | Cluttered | Scatterers  # sources of scatterers near some positions


def _split(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Split triangles across their longest edge until it is no longer than a tile."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        long = edges.max(axis=1) > TILE
        done.append(triangles[~long])
        triangles, edges = triangles[long], edges[long]
        turn = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[:, :, None], axis=1), 1, 0)
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else triangles


@njit(inline="always")
def _hash(a, b):
    """Hash two 64-bit words to one, mixed by the finaliser of splitmix64 (Steele, Lea, Flood, OOPSLA 2014)."""
    x = a + np.uint64(0x9E3779B97F4A7C15) * (b + np.uint64(1))
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@njit(inline="always")
def _uniform(word):
    """Number in 0...1 from a word's upper 53 bits."""
    return np.float64(word >> np.uint64(11)) * 1.1102230246251565e-16


@njit(cache=True)
def _counts(seed, tiles, expected, highest):
    """Total number of scatterers per tile, and number to draw. Fractions are rounded up at random, so means are
    exact."""
    totals, counts = np.empty(len(tiles), np.int64), np.empty(len(tiles), np.int64)
    for i in range(len(tiles)):
        tile = tiles[i]
        totals[i] = int(np.floor(expected[tile] + _uniform(_hash(_hash(seed, np.uint64(tile)), np.uint64(0)))))
        counts[i] = min(int(np.ceil(totals[i] * highest[i])), totals[i])
    return totals, counts


@njit(parallel=True, cache=True)
def _place(seed, tiles, totals, counts, ends, ground, columns):
    """Generate the scatterers of some tiles.

    Args:
        seed, tiles, totals, counts: see `_counts`.
        ends: one after the last scatterer of each tile.
        ground: the first triangle of each tile, areas up to each triangle's end (m^2), corners (m).
        columns: places, triangles, phases, ranks, weights over one mirror and over two of scatterers: filled in.
    """
    first, areas, triangles = ground
    position, triangle, phase, rank, once, twice = columns
    for i in prange(len(tiles)):
        tile = tiles[i]
        key = _hash(seed, np.uint64(tile))
        shift, shift_across = _uniform(_hash(key, np.uint64(1))), _uniform(_hash(key, np.uint64(2)))
        bouncing = int(_hash(key, np.uint64(0)) % np.uint64(BOUNCE_STRIDE**2))
        low, high = first[tile], first[tile + 1]
        before = areas[low - 1] if low > 0 else 0.0
        for k in range(counts[i]):
            j = ends[i] - counts[i] + k
            word = _hash(key, np.uint64(k + 3))
            along = shift + (k + 1) * _R2[0]
            across = shift_across + (k + 1) * _R2[1]
            target = before + (along - np.floor(along)) * (areas[high - 1] - before)
            t = low + np.searchsorted(areas[low:high], target)
            t = min(t, high - 1)
            start = areas[t - 1] if t > 0 else 0.0
            r1 = np.sqrt(max(min((target - start) / (areas[t] - start), 1.0), 0.0))
            r2 = across - np.floor(across)
            for d in range(3):
                a, b, c = triangles[t, 0, d], triangles[t, 1, d], triangles[t, 2, d]
                position[j, d] = (1 - r1) * a + r1 * (1 - r2) * b + r1 * r2 * c
            triangle[j] = t
            phase[j] = 2 * np.pi * _uniform(word)
            rank[j] = (k + _uniform(_hash(word, np.uint64(1)))) / totals[i]
            once[j] = BOUNCE_STRIDE if (k + bouncing) % BOUNCE_STRIDE == 0 else 0.0
            twice[j] = BOUNCE_STRIDE**2 if (k + bouncing) % BOUNCE_STRIDE**2 == 0 else 0.0
