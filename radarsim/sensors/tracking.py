"""A tracking camera like Intel's RealSense T265: poses at 200 Hz, smooth, and slowly drifting away.

Its visual-inertial odometry keeps gravity, but heading and scale are open: steps are added up with a scale error of
0.5 % (standard deviation, constant) and a heading error that walks by 0.03 degrees in a second; every pose jitters by
a millimetre and 0.02 degrees. So it ends up within 1 % of the way travelled most of the time, which is what its data
sheet gives for closed loops.
"""

from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from radarize.io.recording import Stream
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor

RATE = 200.0
SCALE_ERROR = 0.005
HEADING_WALK = np.deg2rad(0.03)  # rad / sqrt(s)
JITTER = (1e-3, np.deg2rad(0.02))  # m, rad


class TrackingCamera(Sensor):
    """Poses of the radar as tracked, its lever arm already taken out, and as they are."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        clock = "tracking/time"
        self.streams = {
            clock: Stream((), "f8", "s", "instants of the tracking camera's poses", clock),
            "tracking/pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the radar as tracked", clock),
            "tracking/true_pose": Stream((7,), "f8", "m, quaternion", "x y z qx qy qz qw of the radar, exact", clock),
        }

    @cached_property
    def _poses(self) -> tuple[Float[np.ndarray, "tick 7"], Float[np.ndarray, "tick 7"]]:
        """Tracked and true poses of the whole motion, whose steps add up from its start."""
        motion, rng = self.scenario.motion, self.scenario.rng("tracking")
        times = self.scenario.ticks(RATE) / RATE
        position, rotation = motion.position(times), motion.rotation(times)
        scale, draw = 1 + SCALE_ERROR * rng.standard_normal(), rng.standard_normal((len(times), 7))
        heading = np.cumsum(HEADING_WALK / np.sqrt(RATE) * draw[:, 6])
        turn = Rotation.from_rotvec(heading[:, None] * [0.0, 0.0, 1.0])
        steps = scale * turn.apply(np.diff(position, axis=0, prepend=position[:1]))
        tracked = position[0] + np.cumsum(steps, axis=0) + JITTER[0] * draw[:, :3]
        shaken = turn * rotation * Rotation.from_rotvec(JITTER[1] * draw[:, 3:6])
        return np.hstack([tracked, shaken.as_quat()]), np.hstack([position, rotation.as_quat()])

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Poses until the next frame."""
        ticks, (tracked, true) = frames.ticks(RATE), self._poses
        return {"tracking/time": ticks / RATE, "tracking/pose": tracked[ticks], "tracking/true_pose": true[ticks]}
