"""A walk through a room that is not there: whatever SLAM compiles or loads at first use is there afterwards."""

import numpy as np
from jaxtyping import Float

from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

#: Times round, steps of a time round, and m from the middle of the square room to its walls.
_LAPS, _STEPS, _HALF = 2, 40, 2.0


def warm_up(config: SlamConfig, azimuths: Float[np.ndarray, "beam"]) -> None:
    """Go round until places are met again: matches, walls and loops of closed submaps are all needed on the way.

    Args:
        config: of the back end that is to be fast from its first scan on.
        azimuths: of its beams, rad.
    """
    slam = Slam(config, endless=True)
    for k, yaw in enumerate(2 * np.pi / _STEPS * (np.arange(_LAPS * _STEPS) + 0.1)):  # no ray lies along a wall
        place = np.array([np.sin(yaw), -np.cos(yaw)])
        ray = np.stack([np.cos(yaw + azimuths), np.sin(yaw + azimuths)])
        to_walls = (_HALF - np.sign(ray) * place[:, None]) / np.abs(ray)  # across and along: the nearer one is met
        slam.add_odometry(float(k), np.array([*place, yaw]))
        slam.add_scan(float(k), azimuths, to_walls.min(axis=0))
    slam.finish()
