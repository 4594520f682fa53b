"""References for `tests/propagation/test_plates.py` and the gallery."""

import numpy as np

from radarize.radar.presets import PRESETS

CONFIG = PRESETS["radarize"]

LAMBDA = CONFIG.wavelength


def physical_optics(half, position, across=3001):
    """Return the echo amplitude by physical optics: (1 / 4 pi) sum of cos exp(j 2 k rho) / rho^2 dA over the plate."""
    y = ((np.arange(across) + 0.5) / across * 2 - 1) * half[0]
    z = ((np.arange(across) + 0.5) / across * 2 - 1) * half[1]
    area = (2 * half[0] / across) * (2 * half[1] / across)
    rho = np.sqrt(position[0] ** 2 + (position[1] - y[:, None]) ** 2 + (position[2] - z) ** 2)
    return np.sum(abs(position[0]) / rho * np.exp(4j * np.pi * rho / LAMBDA) / rho**2) * area / (4 * np.pi)
