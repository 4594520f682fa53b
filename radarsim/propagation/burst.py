"""Time axis of a burst, and path lengths as parabolas over it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit

from radarize.radar.config import RadarConfig

#: Instants (in half bursts from the middle) at which path lengths are evaluated: Chebyshev nodes.
NODES = np.array([-np.sqrt(3) / 2, 0.0, np.sqrt(3) / 2])


@dataclass(frozen=True)
class BurstClock:
    """Time axis of a burst: normalised time s = -1...1 over the centres of the chirps' ADC windows.

    Attributes:
        middle: centre of the burst after the frame's time stamp, s.
        half: half the duration, s.
    """

    middle: float
    half: float

    @classmethod
    def of(cls, config: RadarConfig) -> "BurstClock":
        """Clock of a configuration's frame."""
        times = config.chirp_times
        half = max((times.max() - times.min()) / 2, config.chirp_time / 2)
        return cls(config.burst_center, half)

    @property
    def nodes(self) -> Float[np.ndarray, "3"]:
        """Times of `NODES` after the frame's time stamp, s."""
        return self.middle + self.half * NODES


@njit(inline="always")
def parabola(low, mid, high):
    """Coefficients (s^0, s^1, s^2) of the parabola through values at `NODES`."""
    s = np.sqrt(3) / 2
    return mid, (high - low) / (2 * s), (high - 2 * mid + low) / (2 * s * s)
