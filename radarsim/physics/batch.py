"""Frames that are simulated together: where the sensor is in each, and the scatterers that may matter to any."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from radarsim.physics.crowd import Crowd
from radarsim.physics.echoes import Provenance
from radarsim.physics.scatterers import Scatterers
from radarsim.physics.surface import Surface


@dataclass(frozen=True)
class Batch:
    """Sensor poses in the middle of each burst, and scatterers.

    Attributes:
        position, rotation, time: m, sensor to world, s.
        scatterers: the surface's, then those of the movers where they are in the first frame, in the second, and so on.
        still: how many are the surface's.
        owner: the frame that a scatterer is for; -1: all.
        weights: of a scatterer's power in echoes with 0, 1, and 2 or more mirrors on the way; slabs, however many, are
            one more.
        cause: `Provenance` of the straight echo.
    """

    position: Float[np.ndarray, "frame 3"]
    rotation: Float[np.ndarray, "frame 3 3"]
    time: Float[np.ndarray, "frame"]
    scatterers: Scatterers
    still: int
    owner: Int[np.ndarray, "scatterer"]
    weights: Float[np.ndarray, "scatterer 3"]
    cause: UInt8[np.ndarray, "scatterer"]

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def of(
        cls,
        position: Float[np.ndarray, "frame 3"],
        rotation: Float[np.ndarray, "frame 3 3"],
        time: Float[np.ndarray, "frame"],
        surface: Surface | Scatterers,
        crowd: Crowd | None,
        reach: float,
    ) -> "Batch":
        """A batch with the surface's scatterers within `reach` (m) of any position, and all movers'."""
        found = surface.near(position, reach)
        still = len(found)
        owner = np.full(still, -1)
        if crowd is not None and len(crowd):
            owner = np.concatenate([owner, np.repeat(np.arange(len(time)), len(crowd))])
            found = Scatterers.joined([found, *(crowd.scatterers(t) for t in time)])
        cause = np.where(found.horizontal, Provenance.FLOOR_CEILING, Provenance.DIRECT).astype(np.uint8)
        cause[still:] = Provenance.MOVING
        weights = np.stack([np.ones(len(found)), found.bounces, found.bounces_twice], axis=1)
        return cls(position, rotation, time, found, still, owner, weights, cause)
