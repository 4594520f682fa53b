"""Exact pose and velocity of the radar at the centre of every burst."""

import numpy as np

from radarize.io.recording import Stream
from radarsim.motion.trajectory import turned
from radarsim.scenario import Frames
from radarsim.sensors.sensor import Sensor


class TruePose(Sensor):
    """Pose and velocity of the radar."""

    streams = {
        "truth/time": Stream((), "f8", "s", "middle of the frame's burst: the instant of the other truth streams"),
        "truth/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the sensor in the world"),
        "truth/velocity": Stream((6,), "f8", "m/s, rad/s", "linear, then angular velocity of the sensor, sensor frame"),
    }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Pose and velocity of frames."""
        motion, times = self.scenario.motion, frames.middles
        rotation = motion.rotation(times)
        linear = turned(rotation.inv(), motion.velocity(times))
        return {
            "truth/time": times,
            "truth/pose": np.hstack([motion.position(times), rotation.as_quat()]),
            "truth/velocity": np.hstack([linear, motion.angular_velocity(times)]),
        }
