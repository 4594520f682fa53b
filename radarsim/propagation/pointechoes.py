"""Echoes of points, of scatterers and round bodies: seen at one place on the way out, at another on the way back."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float, Int, UInt8

from radarsim.propagation.candidates import Candidates
from radarsim.propagation.paths import OneWay, TwoWay
from radarsim.propagation.table import Table


@dataclass(frozen=True)
class PointEchoes(Table):
    """Echoes by points of some frames.

    Attributes:
        frame: index.
        points: as seen through the mirrors of the ways out and back, m.
        mirrors: of either way, from the sensor on, as indices of flat reflectors; -1: none.
        scatterer: index; -1: a round body's.
        amplitude: square root of received over transmitted power, with phase.
        cause: a `Provenance` each.
    """

    frame: Int[np.ndarray, "echo"]
    points: Float[np.ndarray, "echo 2 3"]
    mirrors: Int[np.ndarray, "echo 2 2"]
    scatterer: Int[np.ndarray, "echo"]
    amplitude: Complex[np.ndarray, "echo"]
    cause: UInt8[np.ndarray, "echo"]

    @classmethod
    def of(cls, candidates: Candidates, one_way: OneWay, two_way: TwoWay) -> "PointEchoes":
        """Two-way paths."""
        candidate = one_way.candidate[two_way.ways[:, 0]]
        return cls(
            candidates.frame[candidate], np.take(one_way.virtual, two_way.ways, axis=0),
            np.take(one_way.mirrors, two_way.ways, axis=0), candidates.scatterer[candidate], two_way.amplitude,
            two_way.cause,
        )  # fmt: skip
