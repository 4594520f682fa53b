"""Inertial measurement unit like the D435i's Bosch BMI055, at 200 Hz.

It measures specific force (at rest +g upward) and angular velocity, exact derivatives of the motion's splines at the
sensor's position, plus

- white noise of density N: Allan deviation N / sqrt(tau);
- a bias that is constant, plus a first-order Gauss-Markov process whose Allan deviation peaks at the bias instability
  (IEEE Std 952-1997, annex C), plus a random walk K: K sqrt(tau / 3);
- quantisation, and saturation at the range's ends.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from radarize.io.recording import Product, Stream
from radarsim.motion.trajectory import turned
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.depth import MOUNT, mount
from radarsim.sensors.sensor import Sensor

RATE = 200.0
STANDARD_GRAVITY = 9.80665  # m/s^2
_G = STANDARD_GRAVITY
#: Peak of the Allan deviation of a Gauss-Markov process, in its standard deviations, at 1.89 correlation times; and
#: the floor of flicker noise, by which bias instability is quoted: sqrt(2 ln 2 / pi).
_PEAK, _FLOOR = 0.618, 0.664


@dataclass(frozen=True)
class Errors:
    """Error model of a triad of accelerometers or gyroscopes, in its unit u: m/s^2 or rad/s.

    Attributes:
        noise: density of the white noise, u / sqrt(Hz).
        instability: bias instability, u.
        correlation_time: of the Gauss-Markov part of the bias, s.
        walk: random walk of the bias, u sqrt(Hz) (u per second per sqrt(Hz)).
        offset: constant part of the bias, u, standard deviation.
        step: of the converter, u.
        limit: largest magnitude, u.
    """

    noise: float
    instability: float
    correlation_time: float
    walk: float
    offset: float
    step: float
    limit: float

    def allan_deviation(self, tau: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Allan deviation of noise and bias for averages over `tau`, s."""
        t, ratio = self.correlation_time, np.asarray(tau, float) / self.correlation_time
        wander = 2 * self._wander**2 / ratio * (1 - (3 - 4 * np.exp(-ratio) + np.exp(-2 * ratio)) / (2 * ratio))
        return np.sqrt((self.noise**2 + self.step**2 / 12 / RATE) / (t * ratio) + wander + self.walk**2 * t * ratio / 3)

    @property
    def _wander(self) -> float:
        """Standard deviation of the Gauss-Markov part of the bias."""
        return self.instability * _FLOOR / _PEAK


#: BMI055 data sheet (BST-BMI055-DS000): 150 ug/sqrt(Hz), 12 bit at +-4 g, zero-g offset +-70 mg; 0.014 deg/s/sqrt(Hz),
#: 16 bit at +-1000 deg/s, zero-rate offset +-1 deg/s. A tenth of the offsets is taken to remain after the camera's
#: factory calibration. Instability and random walk are not in the data sheet: assumed, usual for parts of this class.
ACCELEROMETER = Errors(
    noise=150e-6 * _G, instability=40e-6 * _G, correlation_time=100.0, walk=5e-6 * _G, offset=7e-3 * _G,
    step=4 * _G / 2048, limit=4 * _G,
)  # fmt: skip
GYROSCOPE = Errors(
    noise=np.deg2rad(0.014), instability=np.deg2rad(10 / 3600), correlation_time=100.0, walk=np.deg2rad(2e-4),
    offset=np.deg2rad(0.1), step=np.deg2rad(1000) / 32768, limit=np.deg2rad(1000),
)  # fmt: skip


class Triad:
    """Triad of orthogonal sensors, with errors drawn for all samples at once.

    Args:
        errors: of each.
        rng: random generator; a shorter series has the same errors as the start of a longer one.
        count: number of samples, at `RATE`.

    Attributes:
        bias: constant, Gauss-Markov and random-walk parts together, of every sample.
    """

    bias: Float[np.ndarray, "tick 3"]

    def __init__(self, errors: Errors, rng: np.random.Generator, count: int):
        from scipy.signal import lfilter  # slow to import

        self._errors = errors
        start, drive = rng.standard_normal((2, 3)), rng.standard_normal((count, 3, 3))
        keep = np.exp(-1 / (RATE * errors.correlation_time))
        force = np.sqrt(1 - keep**2) * drive[:, 0]
        wander, _ = lfilter([1.0], [1.0, -keep], force, axis=0, zi=keep * start[:1])
        walk = np.cumsum(drive[:, 1], axis=0) / np.sqrt(RATE)
        self.bias = errors.offset * start[1] + errors._wander * wander + errors.walk * walk
        self._noise = errors.noise * np.sqrt(RATE) * drive[:, 2]

    def measure(
        self, truth: Float[np.ndarray, "tick 3"], ticks: Int[np.ndarray, "tick"]
    ) -> Float[np.ndarray, "tick 3"]:
        """Measured values of the samples with indices `ticks`."""
        errors = self._errors
        value = np.rint((truth + self.bias[ticks] + self._noise[ticks]) / errors.step) * errors.step
        return np.clip(value, -errors.limit, errors.limit)


class Imu(Sensor):
    """Accelerometers and gyroscopes in the depth camera's housing, with axes parallel to the radar's."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        self._motion = scenario.motion.mounted(MOUNT)
        count = len(scenario.ticks(RATE))
        self._accelerometer = Triad(ACCELEROMETER, scenario.rng("accelerometer"), count)
        self._gyroscope = Triad(GYROSCOPE, scenario.rng("gyroscope"), count)
        clock = "imu/time"
        self.streams = {
            clock: Stream((), "f8", "s", "instants of the IMU's samples", clock),
            "imu/accelerometer": Stream((3,), "f4", "m/s^2", "specific force x y z: +g upward at rest", clock),
            "imu/gyroscope": Stream((3,), "f4", "rad/s", "angular velocity x y z", clock),
            "imu/bias": Stream(
                (6,), "f4", "m/s^2, rad/s", "true bias in it: accelerometer x y z, gyroscope x y z", clock
            ),
        }
        specification = np.array([[e.noise, e.instability, e.walk] for e in (ACCELEROMETER, GYROSCOPE)])
        about = "noise density (1/sqrt(Hz)), bias instability, random walk (sqrt(Hz)) of accelerometer, gyroscope"
        self.products = {
            "imu/mount": mount("IMU"),
            "imu/specification": Product(specification, "m/s^2, rad/s", about),
        }

    def truth(
        self, times: Float[np.ndarray, "tick"]
    ) -> tuple[Float[np.ndarray, "tick 3"], Float[np.ndarray, "tick 3"]]:
        """Exact specific force and angular velocity."""
        acceleration = self._motion.acceleration(times) + [0.0, 0.0, STANDARD_GRAVITY]
        return turned(self._motion.rotation(times).inv(), acceleration), self._motion.angular_velocity(times)

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Samples up to the next frame."""
        ticks = frames.ticks(RATE)
        times = ticks / RATE
        force, turn = self.truth(times)
        return {
            "imu/time": times,
            "imu/accelerometer": self._accelerometer.measure(force, ticks),
            "imu/gyroscope": self._gyroscope.measure(turn, ticks),
            "imu/bias": np.hstack([self._accelerometer.bias[ticks], self._gyroscope.bias[ticks]]),
        }
