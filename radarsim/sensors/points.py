"""Point cloud by the detection chain on the radar's own chip."""

import numpy as np

from radarize.io.recording import Stream
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor


class ChipPoints(Sensor):
    """TI's point cloud of every frame, computed from the simulated samples."""

    def __init__(self, scenario: Scenario):
        from radarize.signal.points import COLUMNS, PointClouds  # imports PyTorch, which takes two seconds

        super().__init__(scenario)
        self._clouds = PointClouds(scenario.config)
        about = f"{' '.join(COLUMNS)} of TI's point cloud in the sensor frame, closing velocity positive"
        self.streams = {
            "points/frame": Stream((), "i4", "", "number of the frame that a point belongs to", "points/frame"),
            "points/cloud": Stream((len(COLUMNS),), "f4", "m, m/s, dB", about, "points/frame"),
        }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Points of all frames, one after another."""
        points, frame = self._clouds(frames.samples)
        return {"points/frame": frame, "points/cloud": points}
