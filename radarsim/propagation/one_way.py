"""One-way paths between sensor and scatterer, straight and over one or two mirrors.

A one-way path over mirrors is a straight line to the scatterer's virtual point, its image in the mirrors. Its amplitude
holds the antenna's gain, the mirrors' reflection coefficients with polarisation and apertures, the slabs it passes, and
1 / length.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Complex, Float, Int

from radarsim.propagation.candidates import Candidates
from radarsim.propagation.observation import Observation
from radarsim.propagation.table import Table
from radarsim.propagation.targets import Targets


@dataclass(frozen=True)
class OneWay(Table):
    """One-way paths of a batch.

    Attributes:
        candidate: row in the table of candidates: which scatterer in which frame.
        mirrors: in order from the sensor on, as indices of flat reflectors; -1: none.
        amplitude: see above, 1/m; phase as in the beat signal.
        virtual: the scatterer as seen through the mirrors, m.
        last: the last point before the scatterer: the sensor's, or a place of reflection, m.
        through: whether it passes a slab.
    """

    candidate: Int[np.ndarray, "path"]
    mirrors: Int[np.ndarray, "path 2"]
    amplitude: Complex[np.ndarray, "path"]
    virtual: Float[np.ndarray, "path 3"]
    last: Float[np.ndarray, "path 3"]
    through: Bool[np.ndarray, "path"]

    @property
    def bounces(self) -> Int[np.ndarray, "path"]:
        """Number of mirrors, 0 to 2."""
        return (self.mirrors[:, 0] >= 0) + (self.mirrors[:, 1] >= 0).astype(int)

    @classmethod
    def straight(
        cls, observation: Observation, targets: Targets, candidates: Candidates, rows: Int[np.ndarray, "path"]
    ) -> "OneWay":
        """Straight paths to some candidates, not yet tested for what is in the way."""
        n = len(rows)
        return cls(
            rows, np.full((n, 2), -1), candidates.straight[rows].astype(complex),
            np.take(targets.scatterers.position, candidates.scatterer[rows], axis=0),
            np.take(observation.position, candidates.frame[rows], axis=0), np.zeros(n, bool),
        )  # fmt: skip
