"""Path of the radar through a scene: a platform's tour, through way-points, or along given poses."""

from dataclasses import dataclass
from functools import cached_property
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
_RATE = 50.0  # Hz, at which a walk is compared with its way-points
_NEAR = 0.1  # m, within which the carrier passes a way-point: its path is smooth, and sways with the gait


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
            places = self._places
            length = _TOUR if self.duration is None and places is None else self.duration
            motion = plan_motion(scene, self.platform, length, keyed_rng(seed, "route"), places, self.mounting)
            motion = vibrating(motion, PLATFORMS[self.platform].vibration, keyed_rng(seed, "vibration"))
        return motion if self.duration is None else motion.until(self.duration)

    def unreached(self, motion: Motion) -> str:
        """Describe in one sentence the first way-point that a motion `through` them ends before; empty if there is
        none."""
        places = self._places
        if places is None or self.duration is None:
            return ""
        times = np.arange(0, motion.path.x[-1], 1 / _RATE)  # the path goes on after the motion's end
        path, last = motion.path(times)[:, :2], 0
        for number, (x, y) in enumerate(places[1:], 2):
            distance = np.hypot(*(path[last:] - [x, y]).T)
            last += int(np.argmax(distance <= max(_NEAR, distance.min())))
            if times[last] > motion.duration:
                return (
                    f"the walk of {motion.duration:g} s ends before way-point {number} of {len(places)} (x {x:.2f}, "
                    f"y {y:.2f} m), reached after {times[last]:.1f} s; without a duration it ends at the last one"
                )
        return ""

    @cached_property
    def _places(self) -> Float[np.ndarray, "n 2"] | None:
        places = self.waypoints
        return read_waypoints(places) if isinstance(places, (str, Path)) else places
