"""The paper's figure: the static world draws v cos(phi - theta) into the Doppler-azimuth map of a moving radar."""

import numpy as np
import pytest

from radarize.heatmaps import Heatmaps
from radarize.radar.presets import PRESETS
from radarsim.propagation.finder import PathFinder
from radarsim.propagation.scatterers import Scatterers
from radarsim.receiver.frontend import FrontEnd
from tests.propagation.rigs import Rig, burst

CONFIG = PRESETS["radarize"]
SPEED = 1.2


def ridge(rig):
    """Doppler-azimuth map, noise included, of a ring of clutter around the rig; and the ridge's speed by column."""
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


@pytest.mark.parametrize(
    ("velocity", "rate", "lever"),
    [
        ((SPEED, 0, 0), 0.0, 0.0),
        ((-SPEED, 0, 0), 0.0, 0.0),
        ((0, SPEED, 0), 0.0, 0.0),
        ((0, -SPEED, 0), 0.0, 0.0),
        ((0.85, 0.85, 0), 0.0, 0.0),
        ((0.85, -0.85, 0), 0.0, 0.0),
        ((0.5, 0, 0), 1.2, 0.5),  # turning left with the sensor 0.5 m ahead: it also slides left at 0.6 m/s
        ((0.5, 0, 0), -1.2, 0.5),
    ],
    ids=["forward", "backward", "left", "right", "ahead-left", "ahead-right", "turn-left", "turn-right"],
)
def test_ridge(velocity, rate, lever):
    rig = Rig(velocity=velocity, yaw_rate=rate, yaw=-rate * CONFIG.burst_center, lever=(lever, 0, 0))
    sensor_velocity = np.array(velocity[:2]) + [0, rate * lever]
    maps, _, found = ridge(rig)
    columns = np.abs(maps.azimuths) < np.deg2rad(50)
    theory = sensor_velocity[0] * np.cos(maps.azimuths) + sensor_velocity[1] * np.sin(maps.azimuths)
    error = (found - theory)[columns]
    # a beam of 15 deg sees a span of speeds where the ridge is steep, and speckle picks one of them
    assert abs(np.median(error)) < 0.03
    assert np.quantile(np.abs(error), 0.9) < 0.2

    # the mirrored map, the wrong Doppler sign and a swapped lever arm all miss
    def misfit(v):
        wrong = v[0] * np.cos(maps.azimuths) + v[1] * np.sin(maps.azimuths)
        return np.mean(np.abs(found - wrong)[columns])

    true = misfit(sensor_velocity)
    vx, vy = sensor_velocity
    rivals = [(-vx, -vy), (vx, -vy), (-vx, vy)]
    assert all(misfit(r) > 2 * true for r in rivals if np.linalg.norm(np.subtract(r, sensor_velocity)) > 0.5)
