"""What a radar looks for from where it is."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class View:
    """A sensor pose, and which echoes are of interest there.

    Attributes:
        position: m.
        rotation: from sensor to world.
        reach: half the longest path, m.
        wavelength: m.
        weakest: echoes below this amplitude are left out.
        tables: the antenna's gain tables, see `antenna.gain_tables`.
    """

    position: Float[np.ndarray, "3"]
    rotation: Float[np.ndarray, "3 3"]
    reach: float
    wavelength: float
    weakest: float
    tables: tuple[Float[np.ndarray, "angle"], Float[np.ndarray, "angle"]]
