"""Clearance maps: free floor, distance to the nearest obstacle, and its name."""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw
from scipy import ndimage

from radarsim.world.scene import Scene
from radarsim.world.shapes import closest

RESOLUTION = 0.025  # m
#: Height above the ground, m, below which objects are no obstacles: carpets, thresholds, unevenness.
LOWEST = 0.03
_DEEPEST = 0.5  # m, largest height of the floor above the lowest surface (a slab's underside, a pit)
_LYING = 0.9  # cosine of the steepest floor's slope


@dataclass(frozen=True)
class Clearance:
    """Horizontal distance to the nearest obstacle over a grid; zero where there is an obstacle or no floor.

    Attributes:
        origin: centre of cell (0, 0), m.
        distance: (ix, iy), m.
    """

    origin: Float[np.ndarray, "2"]
    distance: Float[np.ndarray, "x y"]

    @classmethod
    def of(cls, scene: Scene, low: float, high: float) -> "Clearance":
        """Compute the clearance of a body that occupies the heights `low` to `high` (m) above the ground.

        Floor is any surface that faces up below `low`; a scene without one is all floor.
        """
        level = ground_level(scene)
        low, high = level + low, level + high
        origin = scene.bounds[0, :2] - 0.1
        shape = np.ceil((scene.bounds[1, :2] + 0.1 - origin) / RESOLUTION).astype(int) + 1

        def raster(triangles: Float[np.ndarray, "t 3 3"]) -> np.ndarray:
            image = Image.new("1", (int(shape[1]), int(shape[0])))
            draw = ImageDraw.Draw(image)
            for corners in ((triangles[:, :, 1::-1] - origin[::-1]) / RESOLUTION).reshape(-1, 6).tolist():
                draw.polygon(corners, fill=1, outline=1)
            return np.array(image, bool)

        floor = raster(scene.triangles[_floor(scene, low)])
        free = floor if floor.any() else np.ones(shape, bool)
        free &= ~raster(between(scene.triangles, low, high))
        free[[0, -1]] = free[:, [0, -1]] = False
        # Rasterising rounds to cells: an obstacle may appear up to one cell larger.
        distance = ndimage.distance_transform_edt(free) * RESOLUTION - RESOLUTION
        return cls(origin, np.maximum(distance, 0.0))

    def at(self, points: ArrayLike) -> Float[np.ndarray, "n"]:
        """Clearance at (n, 2) points in the world, m; zero off the grid."""
        cells = (np.asarray(points) - self.origin) / RESOLUTION
        return ndimage.map_coordinates(self.distance, cells.T, order=1, mode="constant")

    def uphill(self, points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Gradient of the clearance: the direction away from the nearest obstacle, of length 1 or less between
        obstacles."""
        step = 2 * RESOLUTION
        offsets = step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
        east, west, north, south = (self.at(points + offset) for offset in offsets)
        return np.column_stack([east - west, north - south]) / (2 * step)


def ground_level(scene: Scene) -> float:
    """Height of the lowest wide floor, m; 0 in a scene without any."""
    corners = scene.triangles
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    # The floor is among the lowest surfaces, except for outliers in scans; other upward faces are tops of furniture.
    lowest = _quantile(corners[:, :, 2].min(axis=1), areas, 0.01)
    floor = _floor(scene, lowest + _DEEPEST)
    if not floor.any():
        return 0.0
    return lowest_level(corners[floor, :, 2].mean(axis=1), areas[floor])


def lowest_level(heights: Float[np.ndarray, "n"], areas: Float[np.ndarray, "n"]) -> float:
    """Height of the lowest wide floor among level surfaces, m."""
    bins = ((heights - heights.min()) / 0.05).astype(int)
    wide = np.bincount(bins, areas)
    # A floor at the edge of a bin lies in two bins.
    near = np.abs(bins - np.flatnonzero(wide >= 0.2 * wide.max())[0]) <= 1
    return _quantile(heights[near], areas[near], 0.5)


def _quantile(values: Float[np.ndarray, "n"], weights: Float[np.ndarray, "n"], share: float) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, share * total[-1])])


def nearest(scene: Scene, points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
    """Distance from points to the nearest object other than the ground, m, and its index in the scene's objects.

    Triangles less than `LOWEST` above the ground do not count. Without any other object: inf and -1.
    """
    high = scene.triangles[:, :, 2].max(axis=1) > ground_level(scene) + LOWEST
    if not high.any():
        return np.full(len(points), np.inf), np.full(len(points), -1)
    distance, triangle = closest(scene.triangles[high], points)
    return distance, scene.triangle_object[high][triangle]


def _floor(scene: Scene, below: float) -> Bool[np.ndarray, "t"]:
    """Mask of triangles below a height that face up; sheets, which have no inside, count on either side."""
    sheet = np.array([item.two_sided for item in scene.objects])[scene.triangle_object]
    up = np.where(sheet, np.abs(scene.normals[:, 2]), scene.normals[:, 2])
    return (up > _LYING) & (scene.triangles[:, :, 2].max(axis=1) < below)


def between(triangles: Float[np.ndarray, "t 3 3"], low: float, high: float) -> Float[np.ndarray, "s 3 3"]:
    """Clip triangles to the interval between two heights."""
    touching = (triangles[:, :, 2].max(axis=1) >= low) & (triangles[:, :, 2].min(axis=1) <= high)
    corners = triangles[touching].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    for origin, normal in ((low, 1.0), (high, -1.0)):
        if len(faces):
            corners, faces, _ = trimesh.intersections.slice_faces_plane(
                corners, faces, plane_normal=[0, 0, normal], plane_origin=[0, 0, origin]
            )
    return corners[faces]
