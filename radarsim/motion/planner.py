"""Collision-free motions through a scene: tours of a platform, and walks through given way-points."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarsim.motion.drive import drive
from radarsim.motion.platforms import PLATFORMS, Platform
from radarsim.motion.tour import SLACK, route, tour
from radarsim.motion.trajectory import Motion, Mounting
from radarsim.world.clearance import Clearance, ground_level, nearest
from radarsim.world.scene import Scene
from radarsim.world.validation import naming

CLEARANCE = 0.22  # m, of the sensor on the clearance map; its true clearance is at least 0.2 m
_ATTEMPTS = 12


def plan_motion(
    scene: Scene,
    platform: str,
    duration: float | None,
    rng: np.random.Generator,
    waypoints: Float[np.ndarray, "n 2"] | None = None,
    mounting: Mounting | None = None,
) -> Motion:
    """Plan a tour through a scene with loops, or a walk through given way-points.

    Args:
        scene: scene to move in.
        platform: one of `PLATFORMS`.
        duration: s; None: as long as the way-points take.
        rng: random generator.
        waypoints: m; the motion ends shortly after the last one, at the latest after `duration`.
        mounting: of the sensor; default: the platform's lever arm, and a random tilt.

    Raises:
        InputError: unknown platform, a duration that is not positive, no room to move in the scene, or a way-point that
            is too close to something or cannot be reached.
    """
    if platform not in PLATFORMS:
        raise InputError(f"platform is {platform!r}, expected one of: {', '.join(PLATFORMS)}")
    if duration is None and waypoints is None:
        raise InputError("duration is missing, expected a number of seconds for a tour without way-points")
    if duration is not None and not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration is {duration} s, expected a positive number")
    carrier = PLATFORMS[platform]
    tilt = carrier.tilt * rng.standard_normal(2)  # always drawn: the same tour whatever the mounting
    if mounting is None:
        mounting = Mounting((carrier.lever_arm, 0.0, 0.0), Rotation.from_euler("ZYX", [0.0, *tilt]))
    arm = np.hypot(*mounting.lever_arm[:2])
    height = ground_level(scene) + carrier.height
    low, top = carrier.body
    clearance = Clearance.of(scene, low, max(top, carrier.height + mounting.lever_arm[2] + 0.25))
    with naming(f"scene {scene.name}, platform {platform}"):
        if waypoints is not None:
            _check(scene, carrier, clearance, waypoints)
            segments = route(clearance, carrier.radius, waypoints)
        limit = np.inf if duration is None or waypoints is not None else duration
        for _ in range(_ATTEMPTS):
            if waypoints is None:
                room = max(carrier.radius, arm + CLEARANCE + 0.05)
                length = carrier.speed * max(limit, 5.0)
                segments = tour(clearance, carrier.radius, room, length, rng)
            motion = drive(carrier, mounting, height, segments, limit, rng)
            times = np.arange(-0.5, motion.duration + 1.0, 1 / 50.0)
            place = motion.position(times)[:, :2]
            # Lever arm and gait move the sensor off the planned path, and add to its speed.
            touches = clearance.at(place) < CLEARANCE
            touches |= clearance.at(motion.path(times)[:, :2]) < carrier.footprint + 0.05
            if not touches.any() and np.linalg.norm(motion.velocity(times), axis=1).max() <= carrier.top_speed:
                return motion if duration is None else motion.until(duration)
    where = place[clearance.at(place).argmin()]
    raise InputError(
        f"scene {scene.name}, platform {platform}: found no {'tour' if waypoints is None else 'walk'} that keeps the "
        f"sensor 0.2 m from everything, the last one fails at x {where[0]:.2f}, y {where[1]:.2f} m"
    )


def _check(scene: Scene, carrier: Platform, clearance: Clearance, places: Float[np.ndarray, "n 2"]) -> None:
    """Raise InputError for way-points that are too close to an obstacle, with its name."""
    room = clearance.at(places)
    close = np.flatnonzero(room < carrier.radius - SLACK)
    if not len(close):
        return
    number, (x, y) = close[0] + 1, places[close[0]]
    heights = ground_level(scene) + np.linspace(*carrier.body, 40)
    distance, item = nearest(scene, np.column_stack([np.tile([x, y], (len(heights), 1)), heights]))
    what = scene.objects[item[distance.argmin()]].name
    if room[close[0]] > 0:
        where = f"lies {distance.min():.2f} m from {what!r}, expected {carrier.radius:.2f} m or more"
    elif np.any([x, y] < scene.bounds[0, :2]) or np.any([x, y] > scene.bounds[1, :2]):
        where = "lies outside the scene"
    else:
        where = f"lies where there is no floor to stand on, in or at {what!r}"
    raise InputError(f"way-point {number} (x {x:.2f}, y {y:.2f} m) {where}")
