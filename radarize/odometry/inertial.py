"""What inertial odometry sees of an IMU: 100 Hz samples, on the radar's axes or on level ones.

Level axes come from the sensor's own angular velocity, integrated, with gravity pulling them upright slowly: no truth
and no camera has a say. They start where the sensor looks at first and turn only as the gyroscope's bias makes them.
"""

import numpy as np
from jaxtyping import Float
from numba import njit
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from radarize.io.errors import InputError
from radarize.io.recording import Recording

#: s, from sample to sample.
PERIOD = 0.01
GRAVITY = 9.80665  # m/s^2
#: 1/s, at which specific force, which averages to gravity, pulls the axes upright (Mahony, Hamel and Pflimlin,
#: "Nonlinear complementary filters on the special orthogonal group", 2008).
_UPRIGHT = 0.1
#: Cosine of the angle to z up to which specific force may be that of a sensor that looks ahead.
_UPWARD = 0.7
#: s between samples in the mean, and m/s^2 or rad/s: beyond, it is no IMU.
_LONGEST, _STRONGEST = 1.0, 1e4
_STREAMS = ("imu/time", "imu/accelerometer", "imu/gyroscope")


class Imu:
    """An IMU's samples.

    Args:
        time: (sample,) s, ascending.
        force: specific force, m/s^2: +g upward at rest.
        turn: angular velocity, rad/s.

    Attributes:
        time: (tick,) ends of intervals of `PERIOD`.
        samples: (tick, 6) means over them of specific force and angular velocity, on the sensor's axes.
        attitude: (tick, 3, 3) from the sensor's to level axes.
    """

    def __init__(
        self,
        time: Float[np.ndarray, "sample"],
        force: Float[np.ndarray, "sample 3"],
        turn: Float[np.ndarray, "sample 3"],
    ):
        edges = np.arange(time[0], time[-1] + 1e-9, PERIOD)
        whole = cumulative_trapezoid(np.column_stack([force, turn]), time, axis=0, initial=0)
        self.time = edges[1:]
        self.samples = np.diff([np.interp(edges, time, column) for column in whole.T]).T / PERIOD
        self.attitude = _follow(np.ascontiguousarray(self.samples), PERIOD, _UPRIGHT)
        self._yaw = np.unwrap(np.arctan2(self.attitude[:, 1, 0], self.attitude[:, 0, 0]))
        level = np.einsum("tij,tkj->tki", self.attitude, self.samples.reshape(-1, 2, 3))
        level[:, 0, 2] -= GRAVITY
        self._level = level.reshape(-1, 6)

    @classmethod
    def of(cls, recording: Recording) -> "Imu":
        """That of a recording, on the radar's axes.

        Raises:
            InputError: it has none, or one that is not usable.
        """
        for name in _STREAMS:
            if not recording.has(name):
                raise InputError(
                    f"{recording.path}: has no /{name}, expected an IMU (radarsim: sensors imu; or imported with one)"
                )
        time, force, turn = (recording.read(name).astype(float) for name in _STREAMS)
        if len(time) < 2 or time[-1] - time[0] < 2 * PERIOD or not (np.diff(time) > 0).all():
            raise InputError(f"{recording.path}: /imu/time has {len(time)} instants, expected ascending ones")
        if not time[-1] - time[0] < _LONGEST * len(time):
            raise InputError(
                f"{recording.path}: /imu/time has {len(time)} instants in {time[-1] - time[0]:g} s, expected one every "
                f"{_LONGEST:g} s at least"
            )
        if not (np.abs(force) <= _STRONGEST).all() or not (np.abs(turn) <= _STRONGEST).all():
            raise InputError(
                f"{recording.path}: /imu has values that are no numbers of m/s^2 or rad/s, expected them within "
                f"{_STRONGEST:g}"
            )
        if recording.has("imu/mount"):
            mount = Rotation.from_quat(recording.read("imu/mount")[3:])
            force, turn = mount.apply(force), mount.apply(turn)
        elif (up := force.mean(axis=0))[2] < _UPWARD * np.linalg.norm(up):
            raise InputError(
                f"{recording.path}: has no /imu/mount, and gravity is felt along {np.round(up, 1).tolist()} m/s^2, "
                "expected along z of the radar's axes; `import --imu-turn` says how the IMU stands on the radar"
            )
        return cls(time, force, turn)

    def latest(self, instants: Float[np.ndarray, "frame"], count: int) -> Float[np.ndarray, "frame count 6"]:
        """The last samples before instants, on the sensor's axes; before the first one everything was as then."""
        return self.samples[self._before(instants, count)]

    def levelled(self, instants: Float[np.ndarray, "frame"], count: int) -> Float[np.ndarray, "frame count 6"]:
        """The same on level axes, less gravity."""
        return self._level[self._before(instants, count)]

    def yaw(self, instants: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
        """Heading of the sensor's x axis on level axes, rad, not wrapped."""
        return np.interp(instants, self.time, self._yaw)

    def _before(self, instants: np.ndarray, count: int) -> np.ndarray:
        end = np.searchsorted(self.time, np.asarray(instants) + 1e-9)
        return np.maximum(end[:, None] + np.arange(-count, 0), 0)


def instants(recording: Recording) -> Float[np.ndarray, "frame"]:
    """Burst centres of a recording's frames, s."""
    return recording.times + recording.config.burst_center


@njit(cache=True)
def _follow(samples, period, upright):
    """Attitudes after each sample, the first one upright with heading 0."""
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
        now = now @ _turned(samples[k, 3:] * period)
        felt = now @ samples[k, :3]
        felt /= np.sqrt((felt**2).sum()) + 1e-12
        now = _turned(np.array([felt[1], -felt[0], 0.0]) * (upright * period)) @ now
        attitude[k] = now
    return attitude


@njit(cache=True)
def _turned(vector):
    """Rotation matrix of a rotation vector."""
    angle = np.sqrt((vector**2).sum())
    a, b = 1.0 - angle**2 / 6, 0.5 - angle**2 / 24
    if angle > 1e-4:
        a, b = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + a * cross + b * (cross @ cross)
