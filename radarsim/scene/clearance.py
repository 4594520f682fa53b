"""Where there is floor to move on, and how far the nearest thing is."""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from PIL import Image, ImageDraw
from scipy import ndimage

from radarsim.scene.scene import Scene

RESOLUTION = 0.025  # m


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
        """Clearance for something that fills the heights `low` to `high` (m): all surfaces there, cast on the floor.

        Floor is what faces up below `low`; a scene without any is all floor.
        """
        origin = scene.bounds[0, :2] - 0.1
        shape = np.ceil((scene.bounds[1, :2] + 0.1 - origin) / RESOLUTION).astype(int) + 1

        def raster(triangles: Float[np.ndarray, "t 3 3"]) -> np.ndarray:
            image = Image.new("1", (int(shape[1]), int(shape[0])))
            draw = ImageDraw.Draw(image)
            for corners in (triangles[:, :, :2] - origin) / RESOLUTION:
                draw.polygon([(float(y), float(x)) for x, y in corners], fill=1, outline=1)
            return np.array(image, bool)

        lying = (scene.normals[:, 2] > 0.9) & (scene.triangles[:, :, 2].max(axis=1) < low)
        floor = raster(scene.triangles[lying])
        free = floor if floor.any() else np.ones(shape, bool)
        free &= ~raster(_between(scene.triangles, low, high))
        free[[0, -1]] = free[:, [0, -1]] = False
        # Drawing rounds to cells: what is drawn may lie up to one cell further out.
        distance = ndimage.distance_transform_edt(free) * RESOLUTION - RESOLUTION
        return cls(origin, np.maximum(distance, 0.0))

    def at(self, points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
        """Clearance at points in the world, m; zero off the grid."""
        cells = (np.asarray(points) - self.origin) / RESOLUTION
        return ndimage.map_coordinates(self.distance, cells.T, order=1, mode="constant")


def _between(triangles: Float[np.ndarray, "t 3 3"], low: float, high: float) -> Float[np.ndarray, "s 3 3"]:
    """The parts of triangles between two heights."""
    touching = (triangles[:, :, 2].max(axis=1) >= low) & (triangles[:, :, 2].min(axis=1) <= high)
    corners = triangles[touching].reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    for origin, normal in ((low, 1.0), (high, -1.0)):
        if len(faces):
            corners, faces, _ = trimesh.intersections.slice_faces_plane(
                corners, faces, plane_normal=[0, 0, normal], plane_origin=[0, 0, origin]
            )
    return corners[faces]
