"""The point cloud that the radar's own chip would make of its samples."""

import numpy as np

from radarize.points import COLUMNS, PointClouds
from radarize.recording import Stream
from radarsim.sensors.sensor import Frames, Rig, Sensor


class ChipPoints(Sensor):
    """TI's point cloud of every frame, from the simulated samples."""

    of_radar = True

    def __init__(self, rig: Rig, rng: np.random.Generator):
        self._clouds = PointClouds(rig.config)
        self._frames = 0
        about = f"{' '.join(COLUMNS)} of TI's point cloud in the sensor frame, closing velocity positive"
        self.streams = {
            "points/frame": Stream((), "i4", "", "number of the frame that a point belongs to", "points/frame"),
            "points/cloud": Stream((len(COLUMNS),), "f4", "m, m/s, dB", about, "points/frame"),
        }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Points of all frames, one after another."""
        points, frame = self._clouds(frames.samples)
        frame = frame + self._frames
        self._frames += len(frames)
        return {"points/frame": frame, "points/cloud": points}
