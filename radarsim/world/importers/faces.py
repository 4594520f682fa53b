"""Straight wall faces in an occupancy grid: few, long, and orthogonal where the building is.

Faces are borders between occupied cells and free ground. Border points with similar directions are grown into straight
segments (as line segments in images: von Gioi et al., LSD, IEEE TPAMI 32(4), 2010), collinear segments are joined
across gaps too narrow to walk through, and each face is aligned to the building's main directions if that moves its
ends by no more than about a cell. Faces that meet share their corner.
"""

from dataclasses import dataclass

import contourpy
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage
from scipy.spatial import cKDTree

from radarsim.world.importers.occupancy import OccupancyGrid

#: Largest distance of a face's border points from its line, cells.
OFFSET = 1.5
#: Largest difference of their directions from the face's, cosine of 25 deg.
ASKEW = np.cos(np.deg2rad(25))
#: Gap below which collinear faces are joined, m: no door is narrower.
GAP = 0.4
#: The same for a gap without observed free ground, m: glass and dark surfaces give no lidar echo.
BLIND_GAP = 3.0
#: Smallest length of a face, m.
SHORTEST = 0.25
#: Largest shift of a face's ends by alignment to a main direction, cells.
SNAP = 1.5
#: Radius of the disk that must fit into rooms, m; excludes rays through a window and gaps behind cupboards.
_DISK = 0.2
#: Smallest area of a room, m^2.
_ROOM = 1.0
#: Distance from the crossing of their lines within which faces end in a common corner, m.
_CORNER = 0.35


@dataclass
class Face:
    """A straight piece of wall as seen from free ground.

    Attributes:
        center: a point on it, m along the grid's sides.
        angle: of its direction, rad; free ground is to the left.
        low, high: where it starts and ends along its direction, m from `center`.
        points: (n, 2) border points of the face.
    """

    center: Float[np.ndarray, "2"]
    angle: float
    low: float
    high: float
    points: Float[np.ndarray, "n 2"]

    @property
    def direction(self) -> Float[np.ndarray, "2"]:
        """Unit vector along it."""
        return np.array([np.cos(self.angle), np.sin(self.angle)])

    @property
    def normal(self) -> Float[np.ndarray, "2"]:
        """Unit vector to free ground."""
        return np.array([-np.sin(self.angle), np.cos(self.angle)])

    @property
    def length(self) -> float:
        """Length of the face, m."""
        return self.high - self.low

    @property
    def ends(self) -> Float[np.ndarray, "2 2"]:
        """Start and end, m."""
        return self.center + np.array([[self.low], [self.high]]) * self.direction

    @classmethod
    def through(cls, points: Float[np.ndarray, "n 2"], normal: Float[np.ndarray, "2"]) -> "Face":
        """Fit the least-squares line through points, with free ground on the side of `normal`."""
        center = points.mean(axis=0)
        across = np.linalg.eigh(np.cov((points - center).T))[1][:, 0]
        across = across if across @ normal > 0 else -across
        along = (points - center) @ [across[1], -across[0]]
        return cls(center, float(np.arctan2(-across[0], across[1])), float(along.min()), float(along.max()), points)


def rooms(grid: OccupancyGrid) -> Bool[np.ndarray, "x y"]:
    """Free ground that belongs to rooms: reachable by a disk, without rays seen through windows."""
    cells = _DISK / grid.resolution
    solid = ndimage.binary_closing(np.pad(grid.free, 1), np.ones((2, 2)))[1:-1, 1:-1] & ~grid.occupied
    inner = ndimage.distance_transform_edt(np.pad(solid, 1))[1:-1, 1:-1] > cells
    labels, count = ndimage.label(inner)
    large = np.bincount(labels.ravel(), minlength=count + 1) * grid.resolution**2 >= _ROOM
    large[0] = False
    kept = large[labels]
    reach = ndimage.distance_transform_edt(~kept) if kept.any() else np.full(kept.shape, np.inf)
    return solid & (reach <= cells + 1.5)


def faces(grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]) -> list[Face]:
    """Wall faces around the ground `inside`, longest first."""
    points, normals = _border(grid, inside)
    if not len(points):
        return []
    found = [
        Face.through(points[group], normals[group].mean(axis=0)) for group in _grown(points, normals, grid.resolution)
    ]
    found = _joined(found, grid, inside)
    found = [face for face in found if face.length >= SHORTEST]
    _square(found, SNAP * grid.resolution)
    _meet(found)
    return found


def _border(
    grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]:
    """Points about a cell apart on the border of free ground to occupied cells, and unit normals towards free
    ground."""
    # Occupied cells are dilated by one so that smoothing does not remove thin walls; the border is moved back
    # afterwards.
    near = ndimage.distance_transform_edt(~grid.occupied)
    field = ndimage.gaussian_filter((inside & (near > 1.0)).astype(float), 1.2)
    lines = contourpy.contour_generator(z=field.T).lines(0.5)
    if not lines:
        return np.zeros((0, 2)), np.zeros((0, 2))
    cells = np.concatenate([np.asarray(line) for line in lines])
    slope = np.stack([ndimage.map_coordinates(g, cells.T, order=1) for g in np.gradient(field)], axis=1)
    normals = slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    real = ndimage.map_coordinates(near, cells.T, order=1) < 2.5
    points = (cells - normals + 0.5) * grid.resolution
    return points[real], normals[real]


def _grown(
    points: Float[np.ndarray, "n 2"], normals: Float[np.ndarray, "n 2"], cell: float
) -> list[Int[np.ndarray, "m"]]:
    """Groups of neighbouring points near one line, by index; each point is in one group."""
    around = cKDTree(points).query_ball_point(points, 3 * cell)
    coherence = np.array([np.linalg.norm(normals[near].mean(axis=0)) for near in around])
    taken, groups = np.zeros(len(points), bool), []
    for seed in np.argsort(-coherence, kind="stable"):
        if taken[seed]:
            continue
        group, queue, refit = [seed], [seed], 8
        taken[seed] = True
        center, normal = points[seed], normals[np.array(around[seed])].mean(axis=0)
        normal = normal / max(np.linalg.norm(normal), 1e-9)
        while queue:
            for other in around[queue.pop(0)]:
                if taken[other] or normals[other] @ normal < ASKEW:
                    continue
                if abs((points[other] - center) @ normal) > OFFSET * cell:
                    continue
                taken[other] = True
                group.append(other)
                queue.append(other)
            if len(group) >= refit:
                refit = int(1.2 * len(group)) + 1
                face = Face.through(points[group], normal)
                if face.length > 6 * cell:
                    center, normal = face.center, face.normal
        if len(group) >= 3:
            groups.append(np.array(group))
    return groups


def _joined(found: list[Face], grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]) -> list[Face]:
    """Join collinear faces, longest first."""
    pending = sorted(found, key=lambda face: -face.length)
    done: list[Face] = []
    while pending:
        face = pending.pop(0)
        while True:
            mates = [other for other in pending if _on_one_line(face, other, grid, inside)]
            if not mates:
                break
            pending = [other for other in pending if not any(other is mate for mate in mates)]
            face = Face.through(np.concatenate([face.points, *(mate.points for mate in mates)]), face.normal)
        done.append(face)
    return sorted(done, key=lambda face: -face.length)


def _on_one_line(face: Face, other: Face, grid: OccupancyGrid, inside: Bool[np.ndarray, "x y"]) -> bool:
    if face.normal @ other.normal < np.cos(np.deg2rad(30)):
        return False
    ends = other.ends - face.center
    if np.abs(ends @ face.normal).max() > OFFSET * grid.resolution:
        return False
    along = ends @ face.direction
    start, end = (face.high, along.min()) if along.min() > face.low else (along.max(), face.low)
    if end - start < GAP:
        return True
    if end - start > min(BLIND_GAP, 2 * (face.length + other.length)):
        return False
    at = face.center + np.arange(start, end, grid.resolution)[:, None] * face.direction
    behind = [inside[grid.cells(at - k * grid.resolution * face.normal)] for k in (1, 2, 3)]
    return bool(np.mean(behind) < 0.1)


def _square(found: list[Face], offset: float) -> None:
    """Align faces to the building's main directions, in place, and nearly coplanar faces to a common line."""
    if not found:
        return
    lengths = np.array([face.length for face in found])
    angles = np.array([face.angle for face in found])
    # The mode of the angles modulo 90 deg, weighted by length: the circular mean around the largest bin.
    quarter = np.pi / 2
    share = np.bincount((angles % quarter / quarter * 90).astype(int) % 90, lengths, 90)
    share = ndimage.gaussian_filter1d(share, 1.0, mode="wrap")
    peak = (share.argmax() + 0.5) / 90 * quarter
    apart = (angles - peak + quarter / 2) % quarter - quarter / 2
    close = np.abs(apart) < np.deg2rad(4)
    if close.any():
        main = peak + np.average(apart[close], weights=lengths[close])
        for face in found:
            turn = (face.angle - main + quarter / 2) % quarter - quarter / 2
            if abs(np.sin(turn)) * face.length / 2 <= offset:
                face.angle -= float(turn)
                along = (face.points - face.center) @ face.direction
                face.low, face.high = float(along.min()), float(along.max())


def _meet(found: list[Face]) -> None:
    """Extend faces that nearly meet to the crossing of their lines, in place."""
    ends = np.array([face.ends for face in found]).reshape(-1, 2)
    for number, face in enumerate(found):
        apart = np.linalg.norm(ends[:, None] - face.ends, axis=2).min(axis=1)
        near = np.unique(np.flatnonzero(apart < 2 * _CORNER) // 2)
        best = {0: _CORNER, 1: _CORNER}
        low, high = face.low, face.high
        for other in near:
            crossing = _crossing(face, found[other])
            if other == number or crossing is None:
                continue
            along, beyond = crossing
            if beyond > _CORNER:
                continue
            for side, end in ((0, face.low), (1, face.high)):
                if abs(along - end) < best[side]:
                    best[side] = abs(along - end)
                    low, high = (along, high) if side == 0 else (low, along)
        if high - low > SHORTEST / 2:
            face.low, face.high = float(low), float(high)


def _crossing(face: Face, other: Face) -> tuple[float, float] | None:
    """Position along `face` where the line of `other` crosses, and its distance beyond the other's ends, m."""
    sine = face.direction @ other.normal
    if abs(sine) < np.sin(np.deg2rad(6)):
        return None
    along = ((other.center - face.center) @ other.normal) / sine
    at = (face.center + along * face.direction - other.center) @ other.direction
    return along, max(other.low - at, at - other.high, 0.0)
