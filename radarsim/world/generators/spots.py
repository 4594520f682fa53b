"""Free places for objects on tops, walls and ceilings, found by ray tests of their surroundings."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from itertools import product

import numpy as np
import shapely
import trimesh
from jaxtyping import Bool, Float, Int

from radarsim.world.objects import SceneObject
from radarsim.world.shapes import loose, scattered, tested

#: Heights above the floor, m: of tops used as shelves, of ceilings, and the height from which a surface is a wall only.
TOPS, CEILINGS, WALLS = (0.6, 2.0), 2.0, 2.25
#: m: narrower walls are posts and the sides of openings; narrower gaps in walls are ignored.
NARROW, SEAM = 0.5, 0.02
#: Cosines for horizontal and for vertical surfaces.
LEVEL, UPRIGHT = 0.98, 0.05
#: Materials of buildings. At the height of tops their surfaces are steps, landings or sills of openings, on which
#: nothing is placed.
BUILT = {"concrete", "brick", "plasterboard", "ceiling board", "asphalt", "carpet", "floorboard"}
#: m: distance from which a ray looks back at a surface, and tolerance of its end.
LIFT, OFF = 0.01, 0.002
#: m: distance from a wall or ceiling at which a ray looks for the floor.
ASIDE = 0.08
DOWN = np.array([0.0, 0.0, -1.0])
#: m: higher than any ceiling.
_SKY = 1e3
#: Points of a back that rays test, as fractions of its half sides.
_GRID = np.array(list(product(np.linspace(-1, 1, 5), repeat=2)))
#: m: larger objects are tested by more rays.
_SMALL = 0.12
_THREE, _OUT = (-1.0, 0.0, 1.0), (0.15, 0.55, 1.0)


def _through(side: int) -> Float[np.ndarray, "ray 2 3"]:
    """Ends of rays through the space of an object, a grid of `side` by `side` rays: fractions of half its sides, and of
    its depth."""
    rows = np.linspace(-1, 1, side)
    return np.array(
        [[(x, y, 0.0), (x, y, 1.0)] for x, y in product(_THREE, repeat=2)]
        + [[(-1.0, y, z), (1.0, y, z)] for y, z in product(rows, _OUT)]
        + [[(x, -1.0, z), (x, 1.0, z)] for x, z in product(rows, _OUT)]
    )


_FEW, _MANY = _through(5), _through(25)
#: Points of a back from which rays test whether a body encloses everything; one alone may graze a face.
_EYES = np.array([(0.0, 0.0, 0.0), (0.31, 0.17, 0.0), (-0.23, 0.41, 0.0)])
#: Smallest distance between lamps, m.
UNLIT = np.arange(0.2, 1.6, 0.2)


@dataclass(frozen=True)
class Spots:
    """Boxes with their backs on a surface.

    Attributes:
        place: middle of the back, m.
        along: unit vector along the surface, horizontal.
        normal: unit vector off the surface.
        size: along, across (normal x along), and off the surface, m.
    """

    place: Float[np.ndarray, "spot 3"]
    along: Float[np.ndarray, "spot 3"]
    normal: Float[np.ndarray, "spot 3"]
    size: Float[np.ndarray, "spot 3"]

    def __len__(self) -> int:
        return len(self.place)

    def __getitem__(self, some: Bool[np.ndarray, "spot"] | Int[np.ndarray, "n"]) -> "Spots":
        return Spots(self.place[some], self.along[some], self.normal[some], self.size[some])

    @classmethod
    def joined(cls, parts: Sequence["Spots"]) -> "Spots":
        """Concatenate several sets of boxes."""
        columns = ("place", "along", "normal", "size")
        return cls(*(np.concatenate([np.zeros((0, 3)), *(getattr(p, name) for p in parts)]) for name in columns))

    @cached_property
    def axes(self) -> Float[np.ndarray, "spot 3 3"]:
        """Along, across and normal in rows: a frame of the right hand."""
        return np.stack([self.along, np.cross(self.normal, self.along), self.normal], axis=1)

    def points(
        self, shares: Float[np.ndarray, "point 3"], margin: tuple[float, float] = (0.0, 0.0)
    ) -> Float[np.ndarray, "spot point 3"]:
        """Points in the boxes, made larger by margins to all sides and in front, m.

        Args:
            shares: of half the sides, -1 ... 1, and of the distance from the surface, 0 ... 1.
            margin: m.
        """
        half = (self.size + np.array([2 * margin[0], 2 * margin[0], margin[1]])) * [0.5, 0.5, 1.0]
        return self.place[:, None] + np.einsum("pd,sd,sdx->spx", shares, half, self.axes)

    def apart(self) -> Bool[np.ndarray, "spot"]:
        """Mask of boxes that overlap no earlier box that is kept."""
        corners = self.points(np.array(list(product((-1, 1), (-1, 1), (0, 1))), float))
        low, high = corners[..., 2].min(axis=1), corners[..., 2].max(axis=1)
        outline = shapely.convex_hull(shapely.multipoints(corners[..., :2]))
        one, two = shapely.STRtree(outline).query(outline, predicate="intersects")
        meet = (two < one) & (low[one] < high[two]) & (low[two] < high[one])
        kept = np.ones(len(self), bool)
        for first, later in sorted(zip(two[meet], one[meet], strict=True), key=lambda pair: (pair[1], pair[0])):
            kept[later] &= not kept[first]
        return kept


class Surroundings:
    """Surfaces of a place, and rays between them.

    Args:
        objects: objects in the place.

    Attributes:
        floor: height of the floor, m.
    """

    def __init__(self, objects: Sequence[SceneObject]):
        counts = [len(o.mesh.faces) for o in objects]
        self._corners = np.concatenate([np.asarray(o.mesh.vertices)[o.mesh.faces] for o in objects])
        cross = np.cross(self._corners[:, 1] - self._corners[:, 0], self._corners[:, 2] - self._corners[:, 0])
        double = np.linalg.norm(cross, axis=1)
        self._normals, self._areas = cross / np.maximum(double, 1e-300)[:, None], double / 2
        self._clear = np.repeat([o.material.clear for o in objects], counts)
        self._built = np.repeat([o.material.name in BUILT for o in objects], counts)
        self._body = np.repeat([not o.two_sided for o in objects], counts)
        self._world, self._tensor = tested(self._corners)
        up, height = self._normals[:, 2], self._corners[:, :, 2].mean(axis=1)
        rising = np.flatnonzero(up > LEVEL)
        # floors are among the lowest upward faces, except for outliers in scans
        order = rising[np.argsort(height[rising], kind="stable")]
        total = np.cumsum(self._areas[order])
        low = height[order[np.searchsorted(total, 0.05 * total[-1])]] if len(order) else self._corners[..., 2].min()
        self.floor = float(low)

    @property
    def seed(self) -> int:
        """Seed from the surfaces: their corners, truncated to 0.1 mm at an offset that no drawing uses."""
        return int.from_bytes(sha256(np.floor(self._corners * 1e4 + 0.37).astype(np.int64).tobytes()).digest()[:8])

    @cached_property
    def tops(self) -> Int[np.ndarray, "triangle"]:
        """Indices of the triangles of tops."""
        height = self._corners[:, :, 2].mean(axis=1) - self.floor
        able = ~(self._clear | self._built) & (height > TOPS[0]) & (height < TOPS[1])
        return np.flatnonzero(able & (self._normals[:, 2] > LEVEL))

    @cached_property
    def ceilings(self) -> Int[np.ndarray, "triangle"]:
        """Indices of the triangles of ceilings."""
        above = self._corners[:, :, 2].mean(axis=1) - self.floor > CEILINGS
        return np.flatnonzero(~self._clear & above & (self._normals[:, 2] < -LEVEL))

    @cached_property
    def walls(self) -> tuple[Float[np.ndarray, "wall 3"], Float[np.ndarray, "wall 3"], Float[np.ndarray, "wall"]]:
        """Walls: start on the floor at the left as seen from the front, m; normal; length, m."""
        begin, normal, length = _straight(*self._lines)
        wide = length > NARROW
        return begin[wide], normal[wide], length[wide]

    @property
    def _lines(self) -> tuple[Float[np.ndarray, "line 2 3"], Float[np.ndarray, "line 3"]]:
        """Walls at that height: lines on the floor, left to right, one per triangle, m; and normals."""
        level = self.floor + WALLS
        rows = np.flatnonzero((np.abs(self._normals[:, 2]) < UPRIGHT) & ~self._clear)
        wall = loose(self._corners[rows])
        lines, faces = trimesh.intersections.mesh_plane(wall, [0, 0, 1], [0, 0, level], return_faces=True)
        lines, normals = np.reshape(lines, (-1, 2, 3)), self._normals[rows[np.asarray(faces, int)]] * [1, 1, 0]
        lines[:, :, 2] = self.floor
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        along = np.cross([0.0, 0.0, 1.0], normals)
        turned = np.einsum("wd,wd->w", lines[:, 1] - lines[:, 0], along) < 0
        lines[turned] = lines[turned, ::-1]
        return lines, normals

    def area(self, some: Int[np.ndarray, "triangle"]) -> float:
        """Total area of some triangles, m^2."""
        return float(self._areas[some].sum())

    def drawn(
        self, rng: np.random.Generator, some: Int[np.ndarray, "triangle"], count: int
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Random positions on some triangles, and the normals there."""
        total = np.cumsum(self._areas[some])
        which = rng.random(count)
        on = some[np.minimum(np.searchsorted(total, which * total[-1]), len(some) - 1)] if count else some[:0]
        return scattered(self._corners[on], rng), self._normals[on]

    def fits(self, spots: Spots, rim: float, front: float, sides: float = 0.005) -> Bool[np.ndarray, "spot"]:
        """Whether whole backs lie on surfaces, without an obstacle.

        Args:
            rim: margin of the surface around a back, m.
            front, sides: free space in front and to the sides, m.
        """
        back = spots.points(np.column_stack([_GRID, np.zeros(len(_GRID))]), (rim, 0.0))
        lifted = back + LIFT * spots.normal[:, None]
        away, on = self._hit(lifted, -spots.normal[:, None])
        lying = ((np.abs(away - LIFT) < OFF) & ~self._clear[on]).all(axis=1)
        small, clear = spots.size[:, :2].max(axis=1) < _SMALL, np.ones(len(spots), bool)
        for some, rays in ((small, _FEW), (~small, _MANY)):
            box = spots[some]
            ends = box.points(rays.reshape(-1, 3), (sides, front)).reshape(len(box), len(rays), 2, 3)
            ends += 0.003 * box.normal[:, None, None]
            way = ends[:, :, 1] - ends[:, :, 0]
            length = np.linalg.norm(way, axis=2)
            clear[some] = (self._hit(ends[:, :, 0], way / length[..., None])[0] > length).all(axis=1)
        away, on = self._hit(spots.points(_EYES) + LIFT * spots.normal[:, None], spots.normal[:, None])
        behind = np.isfinite(away) & self._body[on] & (np.einsum("npd,nd->np", self._normals[on], spots.normal) > 0)
        return lying & clear & ~behind.all(axis=1)

    def above_floor(self, spots: Spots) -> Bool[np.ndarray, "spot"]:
        """Whether there is a surface below, as everywhere inside a building."""
        return np.isfinite(self._hit(spots.place + ASIDE * spots.normal, DOWN)[0])

    def on_floor(self, spots: Spots) -> Bool[np.ndarray, "spot"]:
        """Whether the lower ends of objects on a wall have a floor below."""
        foot = spots.points(np.array([(x, -1.0, 1.0) for x in _THREE])) + [0, 0, LIFT]
        return np.all(np.abs(self._hit(foot, DOWN)[0] - LIFT) < OFF, axis=1)

    def headroom(self, spots: Spots) -> Float[np.ndarray, "spot"]:
        """Height of the surface above objects on a wall, m; very large if there is none."""
        return np.minimum(self._hit(spots.place + ASIDE * spots.normal, -DOWN)[0], _SKY)

    def unlit(self, spots: Spots) -> Bool[np.ndarray, "spot"]:
        """Whether no lamp hangs from the ceiling nearby."""
        turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        around = np.stack(np.broadcast_arrays(np.cos(turn)[:, None], np.sin(turn)[:, None], 0.0), axis=2)
        eye = spots.place - [0, 0, 0.3]
        seen = self._hit(eye[:, None], around[:, 0])[0][..., None] > UNLIT
        above, _ = self._hit(eye[:, None, None] + UNLIT[:, None] * around, -DOWN)
        return ~np.any(seen & (above < 0.27), axis=(1, 2))

    def _hit(
        self, origins: Float[np.ndarray, "*#n 3"], directions: Float[np.ndarray, "*#n 3"]
    ) -> tuple[Float[np.ndarray, "*#n"], Int[np.ndarray, "*#n"]]:
        """Distance to the first triangle (inf: none) and which it is (0 if none)."""
        rays = np.concatenate(np.broadcast_arrays(origins, directions), axis=-1).astype(np.float32)
        found = self._world.cast_rays(self._tensor(rays))
        triangle = found["primitive_ids"].numpy().astype(np.int64)
        return found["t_hit"].numpy().astype(float), np.where(triangle < len(self._corners), triangle, 0)


def _straight(
    lines: Float[np.ndarray, "line 2 3"], normals: Float[np.ndarray, "line 3"]
) -> tuple[Float[np.ndarray, "wall 3"], Float[np.ndarray, "wall 3"], Float[np.ndarray, "wall"]]:
    """Join collinear lines: start on the left, normal, length."""
    along = np.cross([0.0, 0.0, 1.0], normals)
    offset, low, high = (
        np.einsum("ld,ld->l", *pair) for pair in ((lines[:, 0], normals), (lines[:, 0], along), (lines[:, 1], along))
    )
    key = (np.column_stack([normals[:, :2], offset]) / 1e-3).round()
    order = np.lexsort((low, *key.T))
    found: list[list] = []
    for k in order:
        if found and np.array_equal(found[-1][0], key[k]) and low[k] < found[-1][2] + SEAM:
            found[-1][2] = max(found[-1][2], high[k])
        else:
            found.append([key[k], k, high[k]])
    first = np.array([k for _, k, _ in found], int)
    return lines[first, 0], normals[first], np.array([end for *_, end in found]) - low[first]
