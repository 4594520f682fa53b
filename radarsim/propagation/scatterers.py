"""Point scatterers fixed in the world, which represent the diffuse echo of every surface.

Each has a position, normal, cross section and random phase in the world, so speckle is coherent while the sensor
moves, as on a real wall. `Surface` generates those of a scene.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import ArrayLike

from radarsim.propagation.media import LAMBERT
from radarsim.propagation.table import Table

#: Every n-th scatterer of a sampled surface has paths over mirrors, and every n-th of those over two mirrors.
BOUNCE_STRIDE = 4


@dataclass(frozen=True)
class Scatterers(Table):
    """Point scatterers in the world.

    Attributes:
        position: m.
        normal: unit outward normal, or zero for an isotropic scatterer.
        sigma: sigma0 times the area represented, m^2; radar cross section of an isotropic scatterer.
        phase: rad, uniformly random.
        two_sided: whether it scatters from behind as well (sheets without a volume).
        horizontal: whether it belongs to a floor or ceiling.
        bounces: weight of its power in paths over one mirror. Ghosts are many and weak, so of a sampled surface only
            every fourth scatterer has them, with four times the power.
        bounces_twice: the same for paths over two mirrors or more: every sixteenth, with sixteen times the power.
        lobe: its scattering pattern, see `media.weights`.
        rank: 0...1, determines up to which distance it is used, see `detail`; negative: at any distance.
    """

    position: Float[np.ndarray, "scatterer 3"]
    normal: Float[np.ndarray, "scatterer 3"]
    sigma: Float[np.ndarray, "scatterer"]
    phase: Float[np.ndarray, "scatterer"]
    two_sided: Bool[np.ndarray, "scatterer"]
    horizontal: Bool[np.ndarray, "scatterer"]
    bounces: Float[np.ndarray, "scatterer"]
    bounces_twice: Float[np.ndarray, "scatterer"]
    lobe: Float[np.ndarray, "scatterer 4"]
    rank: Float[np.ndarray, "scatterer"]

    @classmethod
    def points(cls, position: ArrayLike, sigma: ArrayLike, phase: Float[np.ndarray, "n"] | None = None) -> "Scatterers":
        """Isotropic scatterers at (n, 3) or (3,) positions, m, with given cross sections, m^2."""
        position = np.atleast_2d(np.asarray(position, float))
        n, one = len(position), np.ones(len(position))
        return replace(
            cls.zeros(n), position=position, sigma=one * np.asarray(sigma), phase=0 * one if phase is None else phase,
            bounces=one, bounces_twice=one, lobe=np.tile(LAMBERT, (n, 1)), rank=-one,
        )  # fmt: skip

    def near(self, positions: Float[np.ndarray, "position 3"], reach: float) -> "Scatterers":
        """All scatterers: a given set is used as it is, a `Surface` generates those in reach."""
        return self
