"""References for `tests/receiver/test_signature.py` and the gallery."""

import numpy as np

from benchmarks.references.rigs import burst
from radarize.radar.presets import PRESETS
from radarize.signal.heatmaps import Heatmaps
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.frontend import FrontEnd

CONFIG = PRESETS["radarize"]


def ridge(rig):
    """Return the Doppler-azimuth map, with noise, of a ring of clutter around the rig, and the ridge's speed by
    column."""
    rng = np.random.default_rng(7)
    n = 4000
    azimuth, range_ = rng.uniform(-np.pi / 2, np.pi / 2, n), rng.uniform(1.5, 4.0, n)
    place = np.stack([range_ * np.cos(azimuth), range_ * np.sin(azimuth), np.zeros(n)], axis=1)
    middle = np.array([CONFIG.burst_center])
    center, attitude = rig.position(middle)[0], rig.rotation(middle).as_matrix()[0]
    scatterers = Scatterers.points(place + center, 1e-3 * range_**4, rng.uniform(0, 2 * np.pi, n))
    echoes = PathFinder(None, scatterers, None, CONFIG)(center, attitude)
    front = FrontEnd(CONFIG)
    adc = front.digitize(burst(CONFIG, echoes, rig), rng)
    maps = Heatmaps(CONFIG)
    power = maps.doppler_azimuth(adc[None])[0].numpy()
    # the centre of power around the strongest bin of each column
    bins = np.clip(power.argmax(axis=0) + np.arange(-1, 2)[:, None], 0, len(maps.velocities) - 1)
    weight = np.take_along_axis(power, bins, axis=0)
    return maps, power, (maps.velocities[bins] * weight).sum(axis=0) / weight.sum(axis=0)
