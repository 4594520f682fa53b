"""References for `tests/propagation/test_echoes.py` and the gallery."""

import numpy as np

from benchmarks.references.rigs import field
from radarize.radar.presets import PRESETS
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers

CONFIG = PRESETS["radarize"]

HERE, AHEAD = np.zeros(3), np.eye(3)


def speckle(places):
    """Return amplitudes of many scatterers in a cell, from positions at which the field is uncorrelated; RMS
    sqrt(2)."""
    rng = np.random.default_rng(5)
    place = np.stack([np.full(20000, 3.0), rng.uniform(-3, 3, 20000), rng.uniform(-1.0, 1.0, 20000)], axis=1)
    scatterers = Scatterers.points(place, np.ones(20000), rng.uniform(0, 2 * np.pi, 20000))
    finder = PathFinder(None, scatterers, None, CONFIG, range=10.0)
    fields = []
    for y in np.arange(places) * 0.2:
        position = np.array([0.0, (y % 3) - 1.5, (y // 3) * 0.1 - 0.4])
        fields.append(field(finder(position, AHEAD), position, CONFIG.wavelength))
    return np.abs(fields) / np.sqrt(np.mean(np.abs(fields) ** 2) / 2)
