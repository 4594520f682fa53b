"""Observation: poses of the frames that are simulated together, and limits on the echoes to find."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Observation(NamedTuple):
    """Poses at the centre of each burst, and limits.

    Attributes:
        position, rotation, time: m, sensor to world, s.
        range: half the length of the longest path, m.
        wavelength: m.
        threshold: echoes below this amplitude are left out.
        azimuth_gain, elevation_gain, peak_gain: gain of the antenna (`antenna.GainPattern`).
    """

    position: Float[np.ndarray, "frame 3"]
    rotation: Float[np.ndarray, "frame 3 3"]
    time: Float[np.ndarray, "frame"]
    range: float
    wavelength: float
    threshold: float
    azimuth_gain: Float[np.ndarray, "181"]
    elevation_gain: Float[np.ndarray, "181"]
    peak_gain: float

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.position)
