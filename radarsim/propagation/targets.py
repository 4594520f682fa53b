"""Scatterers in reach of a batch of frames, those of moving targets at their position in each frame."""

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
        scatterers: those of the surface, followed by those of moving targets in the first frame, in the second, and so
            on.
        still: number of the surface's scatterers.
        owner: frame of a scatterer; -1: all.
        weights: weight of a scatterer's power in echoes with 0, 1, and 2 or more mirrors on the path; slabs, however
            many, count as one more.
    """

    scatterers: Scatterers
    still: int
    owner: Int[np.ndarray, "scatterer"]
    weights: Float[np.ndarray, "scatterer 3"]

    @classmethod
    def of(cls, observation: Observation, surface: Scattering, moving: MovingTargets | None) -> "Targets":
        """Scatterers of the surface within range of any pose, and of all moving targets."""
        found = surface.near(observation.position, observation.range)
        still = len(found)
        owner = np.full(still, -1)
        if moving is not None and len(moving):
            owner = np.concatenate([owner, np.repeat(np.arange(observation.frames), len(moving))])
            found = Scatterers.joined([found, *(moving.scatterers(t) for t in observation.time)])
        weights = np.stack([np.ones(len(found)), found.bounces, found.bounces_twice], axis=1)
        return cls(found, still, owner, weights)
