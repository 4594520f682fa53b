"""Motion of a sensor: smooth position and attitude at any time, with their exact derivatives.

A body follows C2 splines in position and attitude; the sensor is mounted on it with a lever arm and a fixed tilt. Its
velocity includes the lever arm's part, and Doppler follows from the same functions as the path length.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from radarize.io.errors import InputError
from radarize.io.tum import read_tum

_FASTEST = 20.0  # m/s between two poses of a file; faster ones indicate wrong units of position or time
_SHARPEST = np.deg2rad(120)  # between two poses; the sense of larger rotations is ambiguous


@dataclass(frozen=True)
class Mounting:
    """Pose of a sensor on the body that carries it.

    Attributes:
        lever_arm: position of the sensor in the body frame, m.
        rotation: sensor-to-body rotation.
    """

    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: Rotation = Rotation.identity()

    @classmethod
    def of(cls, lever_arm: Sequence[float], tilt: Sequence[float]) -> "Mounting":
        """Build a mounting from x, y, z in m (forward, left, up) and roll, pitch, yaw in degrees (pitch positive: nose
        down)."""
        x, y, z = map(float, lever_arm)
        return cls((x, y, z), Rotation.from_euler("ZYX", tuple(tilt)[::-1], degrees=True))

    @classmethod
    def parse(cls, text: str) -> "Mounting":
        """Parse six numbers in a line: x y z in m, roll pitch yaw in degrees.

        Raises:
            InputError: the text is anything else.
        """
        try:
            numbers = [float(word) for word in text.replace(",", " ").split()]
        except ValueError:
            numbers = []
        if len(numbers) != 6 or not np.isfinite(numbers).all():
            raise InputError(f"mounting is {text!r}, expected six numbers: x y z in m, roll pitch yaw in degrees")
        return cls.of(numbers[:3], numbers[3:])


@dataclass(frozen=True)
class Motion:
    """Motion of a sensor on a moving body.

    Times start at 0; outside of the span of the splines the body is at rest.

    Attributes:
        duration: s.
        path: body position in the world over time, m.
        attitude: body-to-world rotation over time.
        lever_arm: sensor in the body frame, m.
        mount: sensor-to-body rotation.
    """

    duration: float
    path: CubicSpline
    attitude: RotationSpline
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mount: Rotation = Rotation.identity()

    def position(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Position of the sensor in the world, m."""
        inside = self._inside(t)
        return self.path(inside) + turned(self.attitude(inside), self.lever_arm)

    def rotation(self, t: Float[np.ndarray, "n"]) -> Rotation:
        """Sensor-to-world rotation at times t, s."""
        return self.attitude(self._inside(t)) * self.mount

    def velocity(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Velocity of the sensor in the world frame, m/s: v + R (omega x lever arm)."""
        inside = self._inside(t)
        swing = np.cross(self.attitude(inside, 1), self.lever_arm)
        return (self.path(inside, 1) + turned(self.attitude(inside), swing)) * self._moving(t)

    def angular_velocity(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Angular velocity in the sensor frame, rad/s."""
        return turned(self.mount.inv(), self.attitude(self._inside(t), 1)) * self._moving(t)

    def until(self, duration: float) -> "Motion":
        """Return the motion ended after `duration` (s) at the latest."""
        return replace(self, duration=min(self.duration, duration))

    def acceleration(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Acceleration of the sensor in the world frame, m/s^2: a + R (alpha x l + omega x (omega x l))."""
        inside = self._inside(t)
        omega = self.attitude(inside, 1)
        swing = np.cross(self.attitude(inside, 2), self.lever_arm) + np.cross(omega, np.cross(omega, self.lever_arm))
        return (self.path(inside, 2) + turned(self.attitude(inside), swing)) * self._moving(t)

    def mounted(self, offset: tuple[float, float, float]) -> "Motion":
        """Return the motion of a point fixed at `offset` (m) in the sensor frame, with parallel axes."""
        return replace(self, lever_arm=tuple(np.asarray(self.lever_arm) + self.mount.apply(offset)))

    def _inside(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        return np.clip(np.asarray(t, float), self.path.x[0], self.path.x[-1])

    def _moving(self, t: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 1"]:
        t = np.asarray(t, float)
        return ((t >= self.path.x[0]) & (t <= self.path.x[-1]))[:, None].astype(float)

    @classmethod
    def still(
        cls,
        position: tuple[float, float, float],
        yaw: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        duration: float = 1.0,
    ) -> "Motion":
        """Motion of a sensor at rest; angles in rad, applied as roll, pitch, yaw (pitch positive: nose down)."""
        times = np.array([-1.0, duration + 1.0])
        turn = Rotation.from_euler("ZYX", np.tile([yaw, pitch, roll], (2, 1)))
        return cls(
            duration, CubicSpline(times, np.tile(np.asarray(position, float), (2, 1))), RotationSpline(times, turn)
        )

    @classmethod
    def linear(
        cls,
        position: tuple[float, float, float],
        velocity: tuple[float, float, float],
        yaw: float = 0.0,
        yaw_rate: float = 0.0,
        lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
        duration: float = 1.0,
    ) -> "Motion":
        """Motion with constant world `velocity` (m/s) and yaw rate (rad/s); the body passes `position` at t = 0."""
        # Knots so dense that the rotation between two is at most 45 degrees.
        begin, end = -1.0, duration + 1.0
        count = 2 + int(np.ceil(abs(yaw_rate) * (end - begin) / (np.pi / 4)))
        times = np.linspace(begin, end, count)
        path = np.asarray(position, float) + times[:, None] * np.asarray(velocity, float)
        turn = Rotation.from_euler("z", (yaw + yaw_rate * times)[:, None])
        return cls(duration, CubicSpline(times, path), RotationSpline(times, turn), lever_arm)


def turned(rotation: Rotation, vectors: Float[np.ndarray, "*n 3"] | tuple) -> Float[np.ndarray, "n 3"]:
    """Rotate vectors, each bit-identical to rotating it alone (`Rotation.apply` sums a single one in another order)."""
    return (rotation.as_matrix() @ np.asarray(vectors, float)[..., None])[..., 0]


def motion_from_tum(path: str | Path, mounting: Mounting | None = None) -> Motion:
    """Read a motion from the poses of a TUM file (``time x y z qx qy qz qw``, ``#`` comments); its first pose is t = 0.

    Args:
        path: file with poses of the sensor, or of a body that carries it.
        mounting: of the sensor on that body; default: the poses are the sensor's own.

    Raises:
        InputError: missing file, wrong columns, a value that is not finite, time stamps that do not ascend, a
            quaternion that is not of unit length, or poses that make no motion, see `motion_through`.
    """
    stamps, poses = read_tum(path)
    return motion_through(stamps, poses, stamps[0], mounting, str(path))


def motion_through(
    stamps: Float[np.ndarray, "pose"],
    poses: Float[np.ndarray, "pose 7"],
    start: float,
    mounting: Mounting | None,
    source: str,
) -> Motion:
    """Interpolate poses by a smooth motion.

    Args:
        stamps: time stamps, s, ascending.
        poses: positions, m, and quaternions x y z w.
        start: time stamp of the motion's t = 0.
        mounting: mounting of the sensor on the body of the poses; None: they are the sensor's own.
        source: origin of the poses, for error messages.

    Raises:
        InputError: fewer than four poses, poses too far apart, or a gap in which a smooth curve deviates from them.
    """
    if len(stamps) < 4:
        raise InputError(f"{source}: {len(stamps)} poses, expected at least 4")
    times, steps, chords = stamps - start, np.diff(stamps), np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1)
    attitude = Rotation.from_quat(poses[:, 3:])

    def refuse(bad: np.ndarray, what: Callable[[int], str], expected: str) -> None:
        if bad.any():
            i = int(bad.argmax())
            raise InputError(f"{source}: between times {stamps[i]:.3f} and {stamps[i + 1]:.3f} {what(i)}, {expected}")

    speed, turn = chords / steps, (attitude[:-1].inv() * attitude[1:]).magnitude()
    refuse(
        speed > _FASTEST,
        lambda i: f"the poses move {chords[i]:.3g} m at {speed[i]:.3g} m/s",
        f"expected positions in m and times in s of something slower than {_FASTEST:g} m/s",
    )
    refuse(
        turn > _SHARPEST,
        lambda i: f"the poses turn by {np.rad2deg(turn[i]):.0f} degrees",
        f"expected poses so dense that none turns by more than {np.rad2deg(_SHARPEST):.0f}",
    )
    curve = CubicSpline(times, poses[:, :3])
    astray = np.linalg.norm(curve(times[:-1] + steps / 2) - (poses[:-1, :3] + poses[1:, :3]) / 2, axis=1)
    refuse(
        astray > 0.5 + chords,
        lambda i: f"a smooth curve through the poses deviates from them by {astray[i]:.2g} m",
        "expected poses without such a gap or jump",
    )
    carried = mounting or Mounting()
    return Motion(float(times[-1]), curve, RotationSpline(times, attitude), carried.lever_arm, carried.rotation)
