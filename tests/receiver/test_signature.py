"""The paper's figure: in the Doppler-azimuth map of a moving radar the static world appears at v cos(phi - theta)."""

import numpy as np
import pytest

from benchmarks.references.rigs import Rig
from benchmarks.references.signature import CONFIG, ridge

SPEED = 1.2


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
