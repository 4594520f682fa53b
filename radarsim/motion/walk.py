"""Path of the radar through a scene: a platform's tour, through way-points, or along given poses."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from radarize.io.errors import InputError
from radarsim.machine.rng import keyed_rng
from radarsim.motion.planner import plan_motion
from radarsim.motion.platforms import PLATFORMS
from radarsim.motion.trajectory import Motion, Mounting, motion_from_tum
from radarsim.motion.vibration import vibrating
from radarsim.motion.waypoints import read_waypoints
from radarsim.world.scene import Scene

_TOUR = 40.0  # s, default duration of a tour


@dataclass(frozen=True)
class Walk:
    """Path of the radar.

    Attributes:
        platform: ``handheld``, ``cart`` or ``robot``: platform of a planned tour.
        duration: s; default: 40 s for a tour, or all of a trajectory or of way-points, which may end earlier.
        trajectory: TUM file of poses to follow instead of a planned tour: those of the sensor, or, with a mounting, of
            the body that carries it.
        waypoints: way-points of the platform instead of a tour, m, or a file of them (`waypoints.read_waypoints`).
        mounting: of the sensor on the platform; default: the platform's own.

    Raises:
        InputError: a duration that is not positive, or both a trajectory and way-points.
    """

    platform: str = "handheld"
    duration: float | None = None
    trajectory: Path | None = None
    waypoints: Path | Float[np.ndarray, "n 2"] | None = None
    mounting: Mounting | None = None

    def __post_init__(self):
        if self.duration is not None and not (np.isfinite(self.duration) and self.duration > 0):
            raise InputError(f"duration is {self.duration} s, expected a positive number of seconds")
        if self.trajectory is not None and self.waypoints is not None:
            raise InputError("both a trajectory and way-points are given, expected one of them")

    def through(self, scene: Scene, seed: int) -> Motion:
        """Plan the motion of the sensor through a scene; `seed` determines the random choices of a tour.

        Raises:
            InputError: unusable trajectory or way-points, or not enough free floor.
        """
        if self.trajectory is not None:
            motion = motion_from_tum(self.trajectory, self.mounting)
        else:
            places = self.waypoints
            places = read_waypoints(places) if isinstance(places, (str, Path)) else places
            length = _TOUR if self.duration is None and places is None else self.duration
            motion = plan_motion(scene, self.platform, length, keyed_rng(seed, "route"), places, self.mounting)
            motion = vibrating(motion, PLATFORMS[self.platform].vibration, keyed_rng(seed, "vibration"))
        return motion if self.duration is None else motion.until(self.duration)
