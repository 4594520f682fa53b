"""Tracking camera like Intel's RealSense T265: smooth poses at 200 Hz with slow drift.

Its visual-inertial odometry observes gravity, but drifts in heading and scale: steps are summed with a scale error of
0.5 % (standard deviation, constant) and a heading error with a random walk of 0.03 degrees per sqrt(s); every pose has
white noise of a millimetre and 0.02 degrees. The final error is mostly within 1 % of the distance travelled, as its
data sheet specifies for closed loops.
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
    """Poses of the radar as tracked, with the camera's lever arm removed, and as they are."""

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
        """Tracked and true poses of the whole motion, whose steps are summed from its start."""
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
        """Poses up to the next frame."""
        ticks, (tracked, true) = frames.ticks(RATE), self._poses
        return {"tracking/time": ticks / RATE, "tracking/pose": tracked[ticks], "tracking/true_pose": true[ticks]}
