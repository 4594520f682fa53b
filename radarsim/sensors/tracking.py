"""A tracking camera like Intel's RealSense T265: poses at 200 Hz, smooth, and slowly drifting away.

Its visual-inertial odometry keeps gravity, but heading and scale are open: steps are added up with a scale error of
0.5 % (standard deviation, constant) and a heading error that walks by 0.03 degrees in a second; every pose jitters by
a millimetre and 0.02 degrees. So it ends up within 1 % of the way travelled most of the time, which is what its data
sheet gives for closed loops.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from radarize.recording import Stream
from radarsim.sensors.sensor import Frames, Rig, Sensor, Ticker

RATE = 200.0
SCALE_ERROR = 0.005
HEADING_WALK = np.deg2rad(0.03)  # rad / sqrt(s)
JITTER = (1e-3, np.deg2rad(0.02))  # m, rad


class TrackingCamera(Sensor):
    """Poses of the radar as tracked, its lever arm already taken out, and as they are.

    Args:
        rig: what it is mounted on.
        rng: for its errors.
    """

    def __init__(self, rig: Rig, rng: np.random.Generator):
        self._motion, self._rng = rig.motion, rng
        self._ticker = Ticker(rig.config, RATE)
        self._scale = 1 + SCALE_ERROR * rng.standard_normal()
        self._heading = 0.0
        self._true = self._tracked = rig.motion.position(np.zeros(1))[0]
        clock = "tracking/time"
        self.streams = {
            clock: Stream((), "f8", "s", "instants of the tracking camera's poses", clock),
            "tracking/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the radar as tracked", clock),
            "tracking/true_pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the radar, exact", clock),
        }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Poses until the next frame."""
        times = self._ticker(frames)
        position, rotation = self._motion.position(times), self._motion.rotation(times)
        draw = self._rng.standard_normal((len(times), 7))
        heading = self._heading + np.cumsum(HEADING_WALK / np.sqrt(RATE) * draw[:, 6])
        turn = Rotation.from_rotvec(heading[:, None] * [0.0, 0.0, 1.0])
        steps = self._scale * turn.apply(np.diff(position, axis=0, prepend=self._true[None]))
        tracked = self._tracked + np.cumsum(steps, axis=0)
        if len(times):
            self._heading, self._true, self._tracked = heading[-1], position[-1], tracked[-1]
        shaken = turn * rotation * Rotation.from_rotvec(JITTER[1] * draw[:, 3:6])
        return {
            "tracking/time": times,
            "tracking/pose": np.hstack([tracked + JITTER[0] * draw[:, :3], shaken.as_quat()]),
            "tracking/true_pose": np.hstack([position, rotation.as_quat()]),
        }
