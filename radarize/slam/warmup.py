"""Warm-up of SLAM: compiles and loads everything before the first scan arrives."""

import numpy as np
from jaxtyping import Float

from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig

#: Number of laps, steps per lap, and half side of the square room, m.
_LAPS, _STEPS, _HALF = 2, 40, 2.0


def warm_up(config: SlamConfig, azimuths: Float[np.ndarray, "beam"]) -> None:
    """Run SLAM on laps in a synthetic room with loops, so that matching, walls and loop closure are all executed once.

    Args:
        config: of the back end that has to be fast from its first scan on.
        azimuths: of its beams, rad.
    """
    slam = Slam(config, endless=True)
    for k, yaw in enumerate(2 * np.pi / _STEPS * (np.arange(_LAPS * _STEPS) + 0.1)):  # avoids rays along a wall
        place = np.array([np.sin(yaw), -np.cos(yaw)])
        ray = np.stack([np.cos(yaw + azimuths), np.sin(yaw + azimuths)])
        to_walls = (_HALF - np.sign(ray) * place[:, None]) / np.abs(ray)  # across and along: the nearer wall counts
        slam.add_odometry(float(k), np.array([*place, yaw]))
        slam.add_scan(float(k), azimuths, to_walls.min(axis=0))
    slam.finish()
