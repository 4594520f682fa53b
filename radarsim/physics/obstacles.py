"""What stands in the way of rays: opaque objects stop them, thin slabs weaken and delay them, movers stop them."""

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from radarsim.physics.batch import Batch
from radarsim.physics.crowd import Crowd
from radarsim.physics.slabs import Slabs
from radarsim.scene.scene import Scene

#: Visibility rays stop this far from both ends, m: surfaces are not obstacles to themselves.
CLEARANCE = 5e-3


class Obstacles:
    """The world as seen by a ray.

    Args:
        scene: None where nothing can stand in the way.
        slabs: what passes through its thin objects.
        crowd: what moves by itself.
    """

    def __init__(self, scene: Scene | None, slabs: Slabs | None, crowd: Crowd | None):
        self.scene, self.slabs, self.crowd = scene, slabs, crowd

    def between(
        self, batch: Batch, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"],
    ) -> Bool[np.ndarray, "ray"]:  # fmt: skip
        """Whether anything lies between points (m), in frames of a batch; slabs are as opaque as the rest."""
        hidden = np.zeros(len(frame), bool)
        if self.scene is not None and len(frame):
            hidden |= self.scene.occluded(begin, end, margin=CLEARANCE)
        return hidden | self._shadowed(batch, frame, begin, end)

    def _shadowed(self, batch: Batch, frame, begin, end) -> Bool[np.ndarray, "ray"]:
        """Whether a mover stands in the way."""
        hidden = np.zeros(len(frame), bool)
        if self.crowd is not None and len(self.crowd):
            for k in np.unique(frame):
                now = frame == k
                hidden[now] = self.crowd.occluded(begin[now], end[now], batch.time[k])
        return hidden

    def passage(
        self, batch: Batch, frame: Int[np.ndarray, "ray"], begin: Float[np.ndarray, "ray 3"],
        end: Float[np.ndarray, "ray 3"], allowed: Bool[np.ndarray, "ray"],
    ) -> tuple[Complex[np.ndarray, "ray"], Float[np.ndarray, "ray"]]:  # fmt: skip
        """What is left of waves between points, as an amplitude, and their delay (m).

        Args:
            batch, frame: which rays are for which frame.
            begin, end: m.
            allowed: slabs are looked for in the way of these, and are opaque to the others.
        """
        factor, delay = np.ones(len(frame), complex), np.zeros(len(frame))
        if self.scene is not None and len(frame):
            blocked = self.scene.occluded(begin, end, margin=CLEARANCE)
            factor[blocked] = 0
            through = np.flatnonzero(blocked & allowed)
            if len(through):
                up = batch.rotation[frame[through], :, 2]
                factor[through], delay[through] = self.slabs.passage(begin[through], end[through], up)
        factor[self._shadowed(batch, frame, begin, end)] = 0
        return factor, delay

    def way(
        self, batch: Batch, frame: Int[np.ndarray, "way"], stops: Float[np.ndarray, "way stop 3"],
        stretches: Int[np.ndarray, "way"], allowed: Bool[np.ndarray, "way"],
    ) -> tuple[Complex[np.ndarray, "way"], Float[np.ndarray, "way"]]:  # fmt: skip
        """The same for ways of several stretches from the sensor over stops.

        Args:
            stops: m; the last of a way may be followed by others that do not count.
            stretches: how many of each way's stops count.
        """
        factor, delay = np.ones(len(frame), complex), np.zeros(len(frame))
        left, begin = np.arange(len(frame)), batch.position[frame]
        for k in range(stretches.max(initial=0)):
            left = left[stretches[left] > k]
            passed, extra = self.passage(batch, frame[left], begin[left], stops[left, k], allowed[left])
            factor[left] *= passed
            delay[left] += extra
            left = left[passed != 0]
            begin = stops[:, k]
        return factor, delay
