"""Where the radar is and how it moves, exactly, in the middle of every burst."""

import numpy as np

from radarize.recording import Stream
from radarsim.sensors.sensor import Frames, Rig, Sensor


class TruePose(Sensor):
    """Pose and velocity of the radar."""

    streams = {
        "truth/time": Stream((), "f8", "s", "middle of the frame's burst: the instant of the other truth streams"),
        "truth/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the sensor in the world"),
        "truth/velocity": Stream((6,), "f8", "m/s, rad/s", "linear, then angular velocity of the sensor, sensor frame"),
    }

    def __init__(self, rig: Rig, rng: np.random.Generator):
        self._motion, self._center = rig.motion, rig.config.burst_center

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Pose and velocity."""
        times = frames.times + self._center
        rotation = self._motion.rotation(times)
        linear = rotation.inv().apply(self._motion.velocity(times))
        return {
            "truth/time": times,
            "truth/pose": np.hstack([self._motion.position(times), rotation.as_quat()]),
            "truth/velocity": np.hstack([linear, self._motion.angular_velocity(times)]),
        }
