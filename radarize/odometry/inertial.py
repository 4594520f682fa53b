"""IMU samples for inertial odometry: at 100 Hz, on the sensor axes or on level axes.

Level axes are an integration of the gyroscope, corrected slowly by the direction of gravity. They use no other sensor
and no truth. Their heading is zero at the start and drifts with the bias of the gyroscope.
"""

import numpy as np
from jaxtyping import Float
from numba import njit
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording

#: Sampling period, s.
PERIOD = 0.01
GRAVITY = 9.80665  # m/s^2
#: Gain of the correction by gravity, 1/s: the mean specific force is gravity (Mahony, Hamel and Pflimlin, "Nonlinear
#: complementary filters on the special orthogonal group", 2008).
_GRAVITY_GAIN = 0.1
#: Minimum cosine of the angle between mean specific force and z of a sensor that looks ahead.
_MIN_UPWARD = 0.7
#: Maximum mean period, s, and maximum magnitude of samples, m/s^2 or rad/s, of a valid IMU.
_MAX_PERIOD, _MAX_VALUE = 1.0, 1e4
_STREAMS = ("imu/time", "imu/accelerometer", "imu/gyroscope")


class Imu:
    """Samples of an IMU.

    Args:
        time: (sample,) s, ascending.
        force: specific force, m/s^2: +g upward at rest.
        angular_velocity: rad/s.

    Attributes:
        time: (tick,) ends of intervals of `PERIOD`.
        samples: (tick, 6) means of specific force and angular velocity over these intervals, on the sensor axes.
        attitude: (tick, 3, 3) rotation from the sensor axes to the level axes.
    """

    def __init__(
        self,
        time: Float[np.ndarray, "sample"],
        force: Float[np.ndarray, "sample 3"],
        angular_velocity: Float[np.ndarray, "sample 3"],
    ):
        edges = np.arange(time[0], time[-1] + 1e-9, PERIOD)
        integral = cumulative_trapezoid(np.column_stack([force, angular_velocity]), time, axis=0, initial=0)
        self.time = edges[1:]
        self.samples = np.diff([np.interp(edges, time, column) for column in integral.T]).T / PERIOD
        self.attitude = _integrate_attitude(np.ascontiguousarray(self.samples), PERIOD, _GRAVITY_GAIN)
        self._yaw = np.unwrap(np.arctan2(self.attitude[:, 1, 0], self.attitude[:, 0, 0]))
        level = np.einsum("tij,tkj->tki", self.attitude, self.samples.reshape(-1, 2, 3))
        level[:, 0, 2] -= GRAVITY
        self._level = level.reshape(-1, 6)

    @classmethod
    def of(cls, recording: Recording) -> "Imu":
        """Return the IMU of a recording, on the axes of the radar.

        Raises:
            InputError: the recording has no IMU, or one that is not usable.
        """
        for name in _STREAMS:
            if not recording.has(name):
                raise InputError(
                    f"{recording.path}: has no /{name}, expected an IMU (radarsim: sensors imu; or imported with one)"
                )
        time, force, angular_velocity = (recording.read(name).astype(float) for name in _STREAMS)
        if len(time) < 2 or time[-1] - time[0] < 2 * PERIOD or not (np.diff(time) > 0).all():
            raise InputError(f"{recording.path}: /imu/time has {len(time)} instants, expected ascending ones")
        if not time[-1] - time[0] < _MAX_PERIOD * len(time):
            raise InputError(
                f"{recording.path}: /imu/time has {len(time)} instants in {time[-1] - time[0]:g} s, expected one every "
                f"{_MAX_PERIOD:g} s at least"
            )
        if not (np.abs(force) <= _MAX_VALUE).all() or not (np.abs(angular_velocity) <= _MAX_VALUE).all():
            raise InputError(
                f"{recording.path}: /imu has values out of range, expected finite m/s^2 and rad/s within {_MAX_VALUE:g}"
            )
        if recording.has("imu/mount"):
            mount = Rotation.from_quat(recording.read("imu/mount")[3:])
            force, angular_velocity = mount.apply(force), mount.apply(angular_velocity)
        elif (up := force.mean(axis=0))[2] < _MIN_UPWARD * np.linalg.norm(up):
            raise InputError(
                f"{recording.path}: has no /imu/mount, and mean specific force is {np.round(up, 1).tolist()} m/s^2, "
                "expected along z of the radar's axes; set the mounting of the IMU with `import --imu-turn`"
            )
        return cls(time, force, angular_velocity)

    def latest(self, instants: Float[np.ndarray, "frame"], count: int) -> Float[np.ndarray, "frame count 6"]:
        """Return the last samples before instants, on the sensor axes; before the start of the IMU the first sample is
        repeated."""
        return self.samples[self._before(instants, count)]

    def levelled(self, instants: Float[np.ndarray, "frame"], count: int) -> Float[np.ndarray, "frame count 6"]:
        """Return the same on level axes, without gravity."""
        return self._level[self._before(instants, count)]

    def yaw(self, instants: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """Return the heading of the sensor on level axes, rad, unwrapped."""
        return np.interp(instants, self.time, self._yaw)

    def _before(self, instants: np.ndarray, count: int) -> np.ndarray:
        end = np.searchsorted(self.time, np.asarray(instants) + 1e-9)
        return np.maximum(end[:, None] + np.arange(-count, 0), 0)


def instants(recording: Recording) -> Float[np.ndarray, "frame"]:
    """Return the burst centres of a recording's frames, s."""
    return recording.times + recording.config.burst_center


@njit(cache=True)
def _integrate_attitude(samples, period, gain):
    """Attitudes after each sample, starting upright with heading 0."""
    attitude = np.empty((len(samples), 3, 3))
    if not len(samples):
        return attitude
    up = samples[: min(len(samples), 50), :3].copy().sum(axis=0)
    up /= np.sqrt((up**2).sum()) + 1e-12
    ahead = np.array([1.0, 0.0, 0.0]) - up[0] * up
    ahead /= np.sqrt((ahead**2).sum()) + 1e-12
    now = np.empty((3, 3))
    now[0], now[2] = ahead, up
    now[1] = np.cross(up, ahead)
    for k in range(len(samples)):
        now = now @ _rotation_matrix(samples[k, 3:] * period)
        felt = now @ samples[k, :3]
        felt /= np.sqrt((felt**2).sum()) + 1e-12
        now = _rotation_matrix(np.array([felt[1], -felt[0], 0.0]) * (gain * period)) @ now
        attitude[k] = now
    return attitude


@njit(cache=True)
def _rotation_matrix(vector):
    """Rotation matrix of a rotation vector."""
    angle = np.sqrt((vector**2).sum())
    a, b = 1.0 - angle**2 / 6, 0.5 - angle**2 / 24
    if angle > 1e-4:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + a * cross + b * (cross @ cross)
