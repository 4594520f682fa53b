"""Motion along a planned path: speed, heading and gait.

Speed along each segment follows from limits on acceleration and turn rate and from the carrier's usual speed; a person
adds gait and looks around. All is sampled at 100 Hz, smoothed over time and interpolated by C2 splines.
"""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, RotationSpline

from radarsim.motion.platforms import Platform
from radarsim.motion.trajectory import Motion, Mounting

STANDSTILL = 0.5  # at the start, s
_RATE = 100.0  # Hz
_MARGIN = 1.0  # s of motion before 0 (at rest) and after the end
_BACKED = 22.0  # s, longest segment that is driven backward instead of turning round


def drive(
    carrier: Platform,
    mounting: Mounting,
    height: float,
    segments: list[Float[np.ndarray, "n 2"]],
    duration: float,
    rng: np.random.Generator,
) -> Motion:
    """Move along path segments, one after the other, from a standstill of `STANDSTILL` seconds.

    Args:
        carrier: platform.
        mounting: of the sensor on it.
        height: of the mounting's origin above z = 0, m.
        segments: paths on the floor, m; each starts at the end of the one before.
        duration: s; inf: until the end of the last segment and half a second more.
        rng: random generator of speed, gait and glances.
    """
    place, course = _timeline(carrier, segments, rng)
    if np.isinf(duration):
        duration = len(place) / _RATE - _MARGIN + STANDSTILL
    steps = int((duration + 2 * _MARGIN + 0.5) * _RATE)
    time = np.arange(steps) / _RATE - _MARGIN
    short = max(0, steps - len(place))
    place = np.pad(place, ((0, short), (0, 0)), mode="edge")[:steps]
    course = np.pad(course, (0, short), mode="edge")[:steps]
    place = gaussian_filter1d(place, carrier.smoothing * _RATE, axis=0, mode="nearest")
    # 0 while standing at the start, 1 from a second later on.
    awake = _ease((time - STANDSTILL) / 1.0)
    if carrier.free_heading:
        heading = _follow(course + _glances(time, rng), carrier.turn_rate)
    else:
        heading = gaussian_filter1d(course, carrier.smoothing * _RATE, mode="nearest")
    speed = np.linalg.norm(np.gradient(place, 1 / _RATE, axis=0), axis=1)
    # Steps quicken with speed, about two a second at a walking pace; left and right foot make the half frequency.
    vigour = np.clip(gaussian_filter1d(speed, 0.2 * _RATE), 0, 1.3) * awake
    stride = 2 * np.pi * np.cumsum(1.2 + 0.7 * vigour) / _RATE
    wander = gaussian_filter1d(rng.standard_normal((3, steps)), 0.4 * _RATE, axis=1)
    wander *= carrier.tremor / np.maximum(wander.std(axis=1, keepdims=True), 1e-12) * awake
    half = np.sin(stride / 2)
    side = 0.6 * carrier.bob * vigour * half
    place = place + side[:, None] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    height = height + carrier.bob * vigour * np.sin(stride)
    roll = carrier.sway[0] * vigour * half + wander[0]
    pitch = carrier.sway[1] * vigour * np.sin(stride + 0.8) + wander[1]
    yaw = heading + carrier.sway[2] * vigour * np.sin(stride / 2 + 0.5) + wander[2]
    knots = slice(None, None, 2)
    path = CubicSpline(time[knots], np.column_stack([place, height])[knots])
    attitude = RotationSpline(time[knots], Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])[knots]))
    return Motion(float(duration), path, attitude, mounting.lever_arm, mounting.rotation)


def _timeline(
    carrier: Platform, segments: list[np.ndarray], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "step 2"], Float[np.ndarray, "step"]]:
    """Position and course of the carrier (rad, unwrapped) at 100 Hz, with turns on the spot between segments."""
    still = int((_MARGIN + STANDSTILL + 4 * carrier.smoothing) * _RATE)
    places: list[np.ndarray] = []
    courses: list[np.ndarray] = []
    for segment in segments:
        place, course = _segment(carrier, segment, rng)
        if not places:
            pause, turning = still, np.full(still, course[0])
        else:
            start = courses[-1][-1]
            change = _wrapped(course[0] - start)
            short = np.linalg.norm(np.diff(segment, axis=0), axis=1).sum() < _BACKED * carrier.speed
            if short and abs(change) > 2.0 and rng.random() < carrier.reversing:
                course = course + np.pi
                change = _wrapped(course[0] - start)
            course = course + start + change - course[0]
            # Smoothed over time below, which takes longer than the turn itself.
            pause = int((abs(change) / carrier.turn_rate + 2 * carrier.smoothing) * _RATE)
            turning = start + change * np.linspace(0, 1, pause)
        places += [np.tile(place[0], (pause, 1)), place]
        courses += [turning, course]
    return np.concatenate(places), np.concatenate(courses)


def _segment(
    carrier: Platform, segment: Float[np.ndarray, "n 2"], rng: np.random.Generator
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m"]]:
    """Motion along one segment from standstill to standstill, sampled at 100 Hz."""
    ahead = np.diff(segment, axis=0)
    step = np.maximum(np.linalg.norm(ahead, axis=1), 1e-6)
    along = np.concatenate([[0], np.cumsum(step)])
    middle = (along[:-1] + along[1:]) / 2
    course = gaussian_filter1d(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0])), 3, mode="nearest")
    curvature = np.maximum(np.abs(np.gradient(course, middle)), 1e-6)
    # Smoothed white noise of the given standard deviation over some 1.5 m.
    spread = 1.5 / step.mean()
    habit = gaussian_filter1d(rng.standard_normal(len(step)), spread) * np.sqrt(2 * np.sqrt(np.pi) * spread)
    pace = carrier.speed * np.clip(1 + carrier.unsteadiness * habit, 0.6, 1.4)
    # Gait and turning add to the speed of a handheld sensor.
    limit = np.minimum(pace, (0.8 if carrier.free_heading else 0.95) * carrier.top_speed)
    limit = np.minimum(limit, 0.8 * carrier.turn_rate / curvature)
    limit = np.minimum(limit, np.sqrt(carrier.acceleration / curvature))
    # v^2 grows by 2 a s at most, from a standstill at both ends: the lower envelope over both directions.
    square = np.interp(along, middle, limit) ** 2
    square[[0, -1]] = 0.0
    gain = 2 * carrier.acceleration * along
    square = np.minimum.accumulate(square - gain) + gain
    square = np.minimum.accumulate((square + gain)[::-1])[::-1] - gain
    speed = np.sqrt(np.maximum(square, 0.0))
    clock = np.concatenate([[0], np.cumsum(2 * step / np.maximum(speed[:-1] + speed[1:], 1e-3))])
    at = np.interp(np.arange(0, clock[-1], 1 / _RATE), clock, along)
    place = np.stack([np.interp(at, along, segment[:, k]) for k in range(2)], axis=1)
    return place, np.interp(at, middle, course)


def _glances(time: Float[np.ndarray, "step"], rng: np.random.Generator) -> Float[np.ndarray, "step"]:
    """Angle between a person's facing and course, rad: mostly zero, at times sideways, backward or looking around."""
    angle, at = np.zeros(len(time)), 4.0
    while at < time[-1]:
        length = rng.uniform(3.0, 8.0)
        side = rng.choice([-1.0, 1.0])
        kind = rng.choice(4, p=[0.55, 0.17, 0.16, 0.12])
        turned = side * (0.0, rng.uniform(25, 55), rng.uniform(60, 95), 180.0)[kind]
        angle[(time >= at) & (time < at + length)] = np.deg2rad(turned)
        at += length
    return angle


def _follow(target: Float[np.ndarray, "step"], rate: float) -> Float[np.ndarray, "step"]:
    """Turn towards a heading with limited rate and angular acceleration, as a person does."""
    gain, snap = 2.5, 5.0 / _RATE
    # The body turns before the path does (R. Grasso et al., Neuroscience Letters 253, 1998): no lag in curves.
    ahead = np.pad(target, (0, int(_RATE / gain)), mode="edge")[int(_RATE / gain) :]
    heading, turning = float(target[0]), 0.0
    result = []
    for goal in ahead.tolist():
        wanted = min(max(gain * (goal - heading), -rate), rate)
        turning += min(max(wanted - turning, -snap), snap)
        heading += turning / _RATE
        result.append(heading)
    return gaussian_filter1d(np.array(result), 0.08 * _RATE, mode="nearest")


def _wrapped(angle: float) -> float:
    """Wrap an angle to -pi...pi."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _ease(x: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
    """Rise from 0 to 1 over 0...1 with two continuous derivatives."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)
