"""Deviation of buildings from right angles: walls that are neither quite square nor quite vertical.

DIN 18202, table 2, tolerates 6 mm over a metre and 8 mm over three for a right angle: 0.15 to 0.35 deg. A building with
unevenness is sheared as a whole, by random angles of that size: planes stay planes and meet at the same
edges, but the mirrors of a corner are no longer square, so that its two images of the radar separate (by 2 sin(2 a) of
the distance from the edge) and beat with one another as the radar moves.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from radarsim.world.objects import SceneObject

#: Smallest and largest angle at level 1, rad: between walls, and of walls from the vertical.
CORNER, LEAN = np.deg2rad((0.1, 0.5)), np.deg2rad((0.05, 0.2))


def shear(unevenness: float, seed: int) -> Float[np.ndarray, "3 3"]:
    """Matrix by which a building's coordinates are multiplied; floors stay horizontal."""
    rng = np.random.default_rng([seed, 18202])
    corner, *lean = np.tan(unevenness * rng.uniform(*np.transpose([CORNER, LEAN, LEAN])) * rng.choice([-1, 1], 3))
    return np.array([[1.0, corner, lean[0]], [0.0, 1.0, lean[1]], [0.0, 0.0, 1.0]])


def out_of_square(objects: list[SceneObject], unevenness: float, seed: int) -> list[SceneObject]:
    """Shear a building about the middle of its floor.

    Args:
        objects: objects as drawn.
        unevenness: see `SurfaceSettings`; 0: bit-identical to the drawing.
        seed: seed of the building.
    """
    if unevenness == 0:
        return objects
    low, high = np.min([o.mesh.bounds[0] for o in objects], axis=0), np.max([o.mesh.bounds[1] for o in objects], axis=0)
    middle, by, found = np.append((low + high)[:2] / 2, 0.0), shear(unevenness, seed), []
    for item in objects:
        mesh = item.mesh.copy()
        mesh.vertices = (mesh.vertices - middle) @ by.T + middle
        found.append(replace(item, mesh=mesh))
    return found
