"""The scatterers that may matter to any of some frames, those of moving targets where they are in each."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from radarsim.propagation.movingtargets import MovingTargets
from radarsim.propagation.observation import Observation
from radarsim.propagation.scatterers import Scatterers
from radarsim.propagation.surface import Scattering


@dataclass(frozen=True)
class Targets:
    """Scatterers of a batch.

    Attributes:
        scatterers: the surface's, then those of moving targets where they are in the first frame, in the second, and so
            on.
        still: how many are the surface's.
        owner: the frame that a scatterer is for; -1: all.
        weights: of a scatterer's power in echoes with 0, 1, and 2 or more mirrors on the way; slabs, however many, are
            one more.
    """

    scatterers: Scatterers
    still: int
    owner: Int[np.ndarray, "scatterer"]
    weights: Float[np.ndarray, "scatterer 3"]

    @classmethod
    def of(cls, observation: Observation, surface: Scattering, moving: MovingTargets | None) -> "Targets":
        """The surface's scatterers within range of any pose, and all moving targets'."""
        found = surface.near(observation.position, observation.range)
        still = len(found)
        owner = np.full(still, -1)
        if moving is not None and len(moving):
            owner = np.concatenate([owner, np.repeat(np.arange(observation.frames), len(moving))])
            found = Scatterers.joined([found, *(moving.scatterers(t) for t in observation.time)])
        weights = np.stack([np.ones(len(found)), found.bounces, found.bounces_twice], axis=1)
        return cls(found, still, owner, weights)
