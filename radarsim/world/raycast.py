"""Ray casting to the first surface, moving objects included."""

from functools import cached_property

import numpy as np
from jaxtyping import Float
from numba import njit, prange

from radarsim.world.crossing import crossing
from radarsim.world.movers import poses
from radarsim.world.scene import Scene


class RayCaster:
    """Casts rays into a scene at given times.

    Args:
        scene: scene with static objects and movers.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        parts = [part for mover in scene.movers for part in mover.parts()]
        self._half = np.array([part.half for part in parts]).reshape(-1, 3)
        self._capsule = np.array([part.capsule for part in parts], bool)
        self._clear = np.array([part.material is not None and part.material.clear for part in parts], bool)

    @cached_property
    def _behind_glass(self) -> Scene | None:
        """The scene without its clear panes; None if nothing else is left.

        One pass of rays through it is three times as fast as continuing from pane to pane.
        """
        solid = [o for o in self._scene.objects if not o.material.clear]
        if len(solid) == len(self._scene.objects):
            return self._scene
        return Scene(self._scene.name, solid) if solid else None

    def distance(
        self,
        origins: Float[np.ndarray, "frame 3"],
        directions: Float[np.ndarray, "frame ray 3"],
        times: Float[np.ndarray, "frame"],
        through_glass: bool = False,
    ) -> Float[np.ndarray, "frame ray"]:
        """Distance along rays to the first surface.

        Args:
            origins: of each frame's rays, world, m.
            directions: world, of unit length.
            times: times of the movers' positions, s.
            through_glass: ignore clear panes.

        Returns:
            Distance, m, inf without a surface.
        """
        frames, rays, _ = directions.shape
        starts = np.broadcast_to(origins[:, None], directions.shape).reshape(-1, 3)
        ways = directions.reshape(-1, 3)
        scene = self._behind_glass if through_glass else self._scene
        distance = np.full(len(ways), np.inf) if scene is None else scene.hit(starts, ways, coherent=True)[0]
        distance = distance.reshape(frames, rays)
        if len(self._half):
            # One time after another: sums over many at once have another order, and a frame must not depend on others.
            placed = [poses(self._scene.movers, np.array([t])) for t in times]
            turn, center = (np.concatenate(parts) for parts in zip(*placed, strict=True))
            met = ~self._clear if through_glass else np.ones(len(self._half), bool)
            parts = turn[:, met], center[:, met], self._half[met], self._capsule[met]
            _meet(np.asarray(origins, float), np.asarray(directions, float), *parts, distance)
        return distance


@njit(parallel=True, cache=True)
def _meet(origins, directions, turn, center, half, capsule, distance):
    """Shorten distances of rays that enter a moving part."""
    for f in range(len(origins)):
        for i in prange(directions.shape[1]):
            for p in range(len(half)):
                enters, _ = crossing(origins[f], directions[f, i], turn[f, p], center[f, p], half[p], capsule[p])
                if enters > 0:
                    distance[f, i] = min(distance[f, i], enters)
