"""Statistics of a motion: distance, speeds, turn rates, directions, clearance."""

import json
from dataclasses import asdict, dataclass

import numpy as np

from radarsim.motion.trajectory import Motion
from radarsim.world.clearance import nearest
from radarsim.world.scene import Scene

_RATE = 100.0  # Hz
_STANDING = 0.05  # m/s


@dataclass(frozen=True)
class Statistics:
    """Statistics of a motion from 0 to its end; speeds and distance are those of the sensor in the horizontal plane.

    Attributes:
        duration: s.
        distance: m.
        mean_speed, top_speed: m/s.
        rms_turn_rate, top_turn_rate: about the vertical, rad/s.
        rms_roll, rms_pitch: of the sensor, rad.
        forward, backward, sideways, standing: fractions of the time in which the platform moves within 45 degrees of
            the sensor's heading, within 45 degrees of the opposite, in between, or not at all.
        clearance: smallest distance of the sensor from anything but the ground, m; None without a scene.
    """

    duration: float
    distance: float
    mean_speed: float
    top_speed: float
    rms_turn_rate: float
    top_turn_rate: float
    rms_roll: float
    rms_pitch: float
    forward: float
    backward: float
    sideways: float
    standing: float
    clearance: float | None = None

    @classmethod
    def of(cls, motion: Motion, scene: Scene | None = None) -> "Statistics":
        """Statistics of a motion, sampled at 100 Hz."""
        t = np.linspace(0, motion.duration, max(2, int(motion.duration * _RATE) + 1))
        speed = np.linalg.norm(motion.velocity(t)[:, :2], axis=1)
        rotation = motion.rotation(t)
        turn = rotation.apply(motion.angular_velocity(t))[:, 2]
        facing, left, up = (rotation.apply(axis) for axis in np.eye(3))
        course = motion.path(np.clip(t, *motion.path.x[[0, -1]]), 1)[:, :2]
        moving = np.linalg.norm(course, axis=1) >= _STANDING
        ahead = np.sum(course * facing[:, :2], axis=1)
        aside = np.abs(course[:, 1] * facing[:, 0] - course[:, 0] * facing[:, 1])
        forward, backward = moving & (ahead >= aside), moving & (-ahead >= aside)
        return cls(
            duration=float(motion.duration),
            distance=float(np.trapezoid(speed, t)),
            mean_speed=float(np.trapezoid(speed, t) / motion.duration),
            top_speed=float(speed.max()),
            rms_turn_rate=_rms(turn),
            top_turn_rate=float(np.abs(turn).max()),
            rms_roll=_rms(np.arctan2(left[:, 2], up[:, 2])),
            rms_pitch=_rms(np.arcsin(np.clip(facing[:, 2], -1, 1))),
            forward=float(forward.mean()),
            backward=float(backward.mean()),
            sideways=float((moving & ~forward & ~backward).mean()),
            standing=float((~moving).mean()),
            clearance=None if scene is None else float(nearest(scene, motion.position(t))[0].min()),
        )

    @classmethod
    def from_json(cls, text: str) -> "Statistics":
        """Read statistics written by `json`."""
        return cls(**json.loads(text))

    def json(self) -> str:
        """Write as JSON text, for an attribute of a recording."""
        return json.dumps(asdict(self))

    def __str__(self) -> str:
        """Summary in one line."""
        line = (
            f"{self.distance:.1f} m in {self.duration:.1f} s, mean {self.mean_speed:.2f} and at most "
            f"{self.top_speed:.2f} m/s, turning at {np.rad2deg(self.rms_turn_rate):.0f} deg/s (RMS, at most "
            f"{np.rad2deg(self.top_turn_rate):.0f}), {self.forward:.0%} forward, {self.backward:.0%} backward, "
            f"{self.sideways:.0%} sideways, {self.standing:.0%} standing"
        )
        return line if self.clearance is None else f"{line}, {self.clearance:.2f} m or more from everything"


def crossings(motion: Motion, scene: Scene) -> str:
    """Describe the first collision of the sensor in one sentence; empty if there is none."""
    t = np.append(np.arange(0, motion.duration, 1 / _RATE), motion.duration)
    place = motion.position(t)
    step = np.diff(place, axis=0)
    length = np.linalg.norm(step, axis=1)
    moved = np.flatnonzero(length > 1e-9)
    distance, triangle = scene.hit(place[moved], step[moved])
    struck = np.flatnonzero(distance <= length[moved])
    if not len(struck):
        return ""
    first = moved[struck[0]]
    names = sorted({scene.objects[i].name for i in scene.triangle_object[triangle[struck]]})
    what = repr(scene.objects[scene.triangle_object[triangle[struck[0]]]].name)
    more = f" and {len(names) - 1} other objects" if len(names) > 1 else ""
    x, y, _ = place[first]
    return f"the sensor passes through {what}{more}, first at t = {t[first]:.2f} s, x {x:.2f}, y {y:.2f} m"


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
