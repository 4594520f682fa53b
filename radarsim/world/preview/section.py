"""Horizontal sections of a scene: intersection lines, and the areas inside of bodies."""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float, Int
from shapely.geometry import Polygon

from radarsim.world.scene import Scene


@dataclass(frozen=True)
class Section:
    """Intersection of a scene with a plane of constant height.

    Attributes:
        lines: ends of the segments, m.
        normals: of the surfaces cut, horizontal part.
        owner: index into the scene's objects.
    """

    lines: Float[np.ndarray, "n 2 2"]
    normals: Float[np.ndarray, "n 2"]
    owner: Int[np.ndarray, "n"]

    @classmethod
    def of(cls, scene: Scene, height: float) -> "Section":
        """Compute the section at a height, m."""
        lines, faces = scene.cut(height)
        return cls(lines, scene.normals[faces, :2], scene.triangle_object[faces])

    def areas(self, scene: Scene) -> list[tuple[Polygon, int]]:
        """Areas inside of bodies, each with the index of an object at its edge. Sheets have no inside."""
        body = np.array([not o.two_sided for o in scene.objects])[self.owner]
        lines, normals, owner = self.lines[body], self.normals[body], self.owner[body]
        if not len(lines):
            return []
        parts = shapely.get_parts(shapely.polygonize([shapely.union_all(shapely.linestrings(lines))]))
        found = []
        (x0, y0), (x1, y1) = lines[:, 0].T, lines[:, 1].T
        for part in parts:
            # Eastward from inside, the first surface is seen from behind.
            x, y = part.representative_point().coords[0]
            crossed = np.flatnonzero((y0 > y) != (y1 > y))
            at = x0[crossed] + (y - y0[crossed]) / (y1[crossed] - y0[crossed]) * (x1 - x0)[crossed]
            ahead = at > x
            if ahead.any():
                first = crossed[ahead][at[ahead].argmin()]
                if normals[first, 0] > 0:
                    found.append((part, int(owner[first])))
        return found
