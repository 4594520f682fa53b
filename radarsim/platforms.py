"""The three carriers of the sensor: a hand, a cart, a small robot, and how each makes its way through a scene.

A tour gives the legs; speed follows from limits on acceleration, turn rate and the platform's habits; a person adds
gait and looks around. All is sampled at 100 Hz, smoothed over time and handed to C2 splines.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.errors import InputError
from radarsim.motion import Motion
from radarsim.scene.clearance import Clearance
from radarsim.scene.scene import Scene
from radarsim.tour import tour

CLEARANCE = 0.25  # of the sensor, m
STANDSTILL = 0.5  # at the start, s
_RATE = 100.0  # Hz
_SMOOTHING = 0.12  # s, Gaussian over time
_MARGIN = 1.0  # s of motion before 0 (still) and after the end


@dataclass(frozen=True)
class Platform:
    """What carries the sensor.

    Attributes:
        body: lowest and highest point of the carrier, m: everything between is an obstacle.
        height: of the sensor, m.
        radius: clearance of the carrier's centre, m; the sensor's own is checked besides.
        speed: usual, m/s; slower in curves.
        top_speed: never exceeded, m/s.
        acceleration: m/s^2, along and across.
        turn_rate: rad/s.
        lever_arm: forward from the carrier's axis, m.
        tilt: of the sensor's mount, standard deviation, rad.
        bob: amplitude of the gait at 1 m/s, m; zero on wheels.
        sway: amplitude of the gait in roll, pitch, yaw, rad.
        tremor: slow wander of roll and pitch, standard deviation, rad.
        free_heading: may face elsewhere than it goes.
    """

    body: tuple[float, float]
    height: float
    radius: float
    speed: float
    top_speed: float
    acceleration: float
    turn_rate: float
    lever_arm: float
    tilt: float
    bob: float = 0.0
    sway: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tremor: float = 0.0
    free_heading: bool = False


PLATFORMS: dict[str, Platform] = {
    "handheld": Platform(
        body=(0.06, 1.8), height=1.2, radius=0.40, speed=1.05, top_speed=1.6, acceleration=1.2,
        turn_rate=np.deg2rad(70), lever_arm=0.12, tilt=np.deg2rad(2), bob=0.02,
        sway=(np.deg2rad(2), np.deg2rad(1.5), np.deg2rad(3)), tremor=np.deg2rad(1.2), free_heading=True,
    ),
    "cart": Platform(
        body=(0.04, 1.2), height=0.95, radius=0.36, speed=1.1, top_speed=1.6, acceleration=0.8,
        turn_rate=np.deg2rad(45), lever_arm=0.20, tilt=np.deg2rad(0.5), tremor=np.deg2rad(0.15),
    ),
    "robot": Platform(
        body=(0.03, 0.45), height=0.20, radius=0.34, speed=0.45, top_speed=0.5, acceleration=0.4,
        turn_rate=np.deg2rad(40), lever_arm=0.10, tilt=np.deg2rad(0.5), tremor=np.deg2rad(0.1),
    ),
}  # fmt: skip


def plan(scene: Scene, platform: str, duration: float, rng: np.random.Generator) -> Motion:
    """A tour of `duration` seconds through a scene, which comes back to places it has been.

    Raises:
        InputError: unknown platform, a duration that is not positive, or no room to move in the scene.
    """
    if platform not in PLATFORMS:
        raise InputError(f"platform is {platform!r}, expected one of: {', '.join(PLATFORMS)}")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration is {duration} s, expected a positive number")
    carrier = PLATFORMS[platform]
    clearance = Clearance.of(scene, *carrier.body)
    times = np.arange(-_MARGIN, duration + 2 * _MARGIN, 1 / 50.0)
    for _ in range(10):
        try:
            legs = tour(clearance, carrier.radius, carrier.speed * max(duration, 5.0), rng)
        except InputError as error:
            raise InputError(f"scene {scene.name}, platform {platform}: {error}") from error
        motion = _drive(carrier, legs, duration, rng)
        # Lever arm and gait move the sensor off the planned line, and add to its speed.
        clear = clearance.at(motion.position(times)[:, :2]).min() >= CLEARANCE
        if clear and np.linalg.norm(motion.velocity(times), axis=1).max() <= carrier.top_speed:
            return motion
    raise InputError(f"scene {scene.name}, platform {platform}: found no tour that keeps {CLEARANCE} m from everything")


def _drive(carrier: Platform, legs: list[np.ndarray], duration: float, rng: np.random.Generator) -> Motion:
    steps = int((duration + 2 * _MARGIN + 0.5) * _RATE)
    time = np.arange(steps) / _RATE - _MARGIN
    place, course = _timeline(carrier, legs, steps, rng)
    place = gaussian_filter1d(place, _SMOOTHING * _RATE, axis=0, mode="nearest")
    # 0 while standing at the start, 1 from a second later on.
    awake = _ease((time - STANDSTILL) / 1.0)
    if carrier.free_heading:
        heading = _follow(course + _glances(time, rng), carrier.turn_rate)
    else:
        heading = gaussian_filter1d(course, 1.5 * _SMOOTHING * _RATE, mode="nearest")
    velocity = np.gradient(place, 1 / _RATE, axis=0)
    speed = np.linalg.norm(velocity, axis=1)
    # Steps quicken with speed, about two a second at a walking pace; left and right foot make the half frequency.
    vigour = np.clip(gaussian_filter1d(speed, 0.2 * _RATE), 0, 1.3) * awake
    stride = 2 * np.pi * np.cumsum(1.2 + 0.7 * vigour) / _RATE
    wander = gaussian_filter1d(rng.standard_normal((3, steps)), 0.4 * _RATE, axis=1)
    wander *= carrier.tremor / np.maximum(wander.std(axis=1, keepdims=True), 1e-12) * awake
    half = np.sin(stride / 2)
    side = 0.6 * carrier.bob * vigour * half
    place = place + side[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    height = carrier.height + carrier.bob * vigour * np.sin(stride)
    roll = carrier.sway[0] * vigour * half + wander[0]
    pitch = carrier.sway[1] * vigour * np.sin(stride + 0.8) + wander[1]
    yaw = heading + carrier.sway[2] * vigour * np.sin(stride / 2 + 0.5) + wander[2]
    knots = slice(None, None, 2)
    path = CubicSpline(time[knots], np.column_stack([place, height])[knots])
    attitude = RotationSpline(time[knots], Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])[knots]))
    mount = Rotation.from_euler("ZYX", [0.0, *(carrier.tilt * rng.standard_normal(2))])
    return Motion(float(duration), path, attitude, (carrier.lever_arm, 0.0, 0.0), mount)


def _timeline(
    carrier: Platform, legs: list[np.ndarray], steps: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "step 2"], Float[np.ndarray, "step"]]:
    """Place and course (rad, unwrapped) at 100 Hz: legs driven one after the other, with stops between."""
    still = int((_MARGIN + STANDSTILL + 4 * _SMOOTHING) * _RATE)
    places, courses, done = [], [], 0
    for leg in legs:
        place, course = _leg(carrier, leg, rng)
        if not places:
            pause, turning = still, np.full(still, course[0])
        else:
            start = courses[-1][-1]
            course = course + 2 * np.pi * np.round((start - course[0]) / (2 * np.pi))
            change = course[0] - start
            # A person turns while setting off; wheels turn on the spot, at a peak of 1.9 times the mean rate.
            pause = int((0.3 if carrier.free_heading else 0.4 + 1.9 * abs(change) / carrier.turn_rate) * _RATE)
            turning = start + change * _ease(np.linspace(0, 1, pause))
        places += [np.tile(place[0], (pause, 1)), place]
        courses += [turning, course]
        done += pause + len(place)
        if done >= steps:
            break
    place, course = np.concatenate(places), np.concatenate(courses)
    short = max(0, steps - len(place))
    place, course = np.pad(place, ((0, short), (0, 0)), mode="edge"), np.pad(course, (0, short), mode="edge")
    return place[:steps], course[:steps]


def _leg(
    carrier: Platform, leg: Float[np.ndarray, "n 2"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m"]]:
    """One leg from standstill to standstill, sampled at 100 Hz."""
    ahead = np.diff(leg, axis=0)
    step = np.maximum(np.linalg.norm(ahead, axis=1), 1e-6)
    along = np.concatenate([[0], np.cumsum(step)])
    course = np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))
    course = gaussian_filter1d(course, 3, mode="nearest")
    curvature = np.abs(np.gradient(course)) / step
    # Smoothed white noise of standard deviation 0.15 over some 1.5 m.
    habit = 0.15 * np.sqrt(2 * np.sqrt(np.pi) * 75) * gaussian_filter1d(rng.standard_normal(len(step)), 75)
    pace = carrier.speed * np.clip(1 + habit, 0.6, 1.4)
    # Gait and turning add to the speed of a sensor in the hand.
    limit = np.minimum(pace, (0.8 if carrier.free_heading else 0.95) * carrier.top_speed)
    limit = np.minimum(limit, 0.8 * carrier.turn_rate / np.maximum(curvature, 1e-6))
    limit = np.minimum(limit, np.sqrt(carrier.acceleration / np.maximum(curvature, 1e-6)))
    speed = np.concatenate([[0.0], (limit[:-1] + limit[1:]) / 2, [0.0]])
    for order in (range(1, len(speed)), range(len(speed) - 2, -1, -1)):
        for i in order:
            back = i - 1 if order.step == 1 else i + 1
            reach = np.sqrt(speed[back] ** 2 + 2 * carrier.acceleration * step[min(i, back)])
            speed[i] = min(speed[i], reach)
    clock = np.concatenate([[0], np.cumsum(2 * step / np.maximum(speed[:-1] + speed[1:], 1e-3))])
    times = np.arange(0, clock[-1], 1 / _RATE)
    at = np.interp(times, clock, along)
    place = np.stack([np.interp(at, along, leg[:, k]) for k in range(2)], axis=1)
    return place, np.interp(at, (along[:-1] + along[1:]) / 2, course)


def _glances(time: Float[np.ndarray, "step"], rng: np.random.Generator) -> Float[np.ndarray, "step"]:
    """How far a person faces away from the course, rad: mostly not, at times sideways, backward or looking around."""
    angle, at = np.zeros(len(time)), 4.0
    while at < time[-1]:
        length = rng.uniform(2.0, 4.5)
        side = rng.choice([-1.0, 1.0])
        kind = rng.choice(4, p=[0.5, 0.2, 0.18, 0.12])
        turned = side * (0.0, rng.uniform(25, 55), rng.uniform(60, 95), 180.0)[kind]
        angle[(time >= at) & (time < at + length)] = np.deg2rad(turned)
        at += length
    return angle


def _follow(target: Float[np.ndarray, "step"], rate: float) -> Float[np.ndarray, "step"]:
    """Turn towards a heading with limited rate and angular acceleration, as a person does."""
    heading, turning = target[0], 0.0
    result = np.empty(len(target))
    for i, goal in enumerate(target):
        wanted = np.clip(2.2 * (goal - heading), -rate, rate)
        turning += np.clip(wanted - turning, -4.0 / _RATE, 4.0 / _RATE)
        heading += turning / _RATE
        result[i] = heading
    return gaussian_filter1d(result, 0.08 * _RATE, mode="nearest")


def _ease(x: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """From 0 to 1 over 0...1 with two continuous derivatives."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)
