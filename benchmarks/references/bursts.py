"""References for `tests/propagation/test_laws.py` and the gallery."""

import numpy as np

from benchmarks.references.rigs import Rig, burst, polar
from radarize.radar.config import SPEED_OF_LIGHT
from radarize.radar.presets import PRESETS
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers

CONFIG = PRESETS["radarize"]

HERE = np.zeros(3)


def point_echoes(place, sigma=1.0):
    return PathFinder(None, Scatterers.points(place, np.full(len(np.atleast_2d(place)), sigma)), None, CONFIG)(
        HERE, np.eye(3)
    )


def slot_phases(speed):
    """Return the phase of a closing echo by transmitter relative to TX1, rad: simulated, and -4 pi v Tc / lambda per
    slot."""
    place = polar(3.0)
    still = burst(CONFIG, point_echoes(place), Rig())
    moving = burst(CONFIG, point_echoes(place), Rig(velocity=(speed, 0, 0)))
    middle = CONFIG.samples // 2
    turn = np.angle(moving[:, :, 0, middle] * still[:, :, 0, middle].conj())
    per_slot = -4 * np.pi * speed * CONFIG.chirp_time / CONFIG.wavelength
    return np.angle(np.exp(1j * (turn - turn[:, :1])).mean(axis=0)), per_slot * np.array(CONFIG.slot)


def tone_ranges(signal, near):
    """Return the range by the beat frequency of each chirp of TX1-RX1, from a line fitted to its phase, m."""
    n = np.arange(CONFIG.samples) / CONFIG.sample_rate
    expected = 2 * CONFIG.slope * near / SPEED_OF_LIGHT
    phase = np.unwrap(np.angle(signal[:, 0, 0] * np.exp(-2j * np.pi * expected * n)), axis=1)
    return near + np.polyfit(n, phase.T, 1)[0] / (2 * np.pi) * SPEED_OF_LIGHT / (2 * CONFIG.slope)
