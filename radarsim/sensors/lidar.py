"""Lidar beside the radar, as pictures of its points at its own height (`radarize.signal.polar`)."""

import numpy as np
from jaxtyping import Float

from radarize.signal import polar
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.scan import headings
from radarsim.sensors.sensor import Sensor

#: rad: elevations of the beams that can meet a surface within the slab, as of a lidar of 64 beams over 33 deg.
ELEVATIONS = np.radians(np.linspace(-16.5, 16.5, 33))


class Lidar(Sensor):
    """Points of the first surfaces around the horizon, levelled: 512 beams over half a circle, 10.8 m, +-0.3 m."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        self.streams = {"truth/lidar": polar.LIDAR}
        bearing, elevation = np.meshgrid(polar.BEAM_AZIMUTHS, ELEVATIONS)
        beams = [np.cos(bearing) * np.cos(elevation), np.sin(bearing) * np.cos(elevation), np.sin(elevation)]
        self._beams = np.stack([each.ravel() for each in beams], axis=1)
        slope = np.maximum(np.abs(self._beams[:, 2]), polar.SLAB / polar.REACH)
        self._reach = polar.SLAB / slope  # of each beam before it leaves the slab, m

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Lidar images of frames."""
        motion, times = self.scenario.motion, frames.middles
        each = zip(times, motion.position(times), headings(motion, times), strict=True)
        return {"truth/lidar": np.stack([self._picture(*one) for one in each])}

    def _picture(self, time: float, position: Float[np.ndarray, "3"], yaw: float) -> np.ndarray:
        cos, sin = np.cos(yaw), np.sin(yaw)
        ways = self._beams @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        distance = self.scenario.rays.distance(position[None], ways[None], np.array([time]), through_glass=True)[0]
        hit = distance <= self._reach
        picture = np.zeros((polar.ROWS, polar.BEAMS), bool)
        picture[tuple(polar.lidar_pixels(self._beams[hit] * distance[hit, None]).T)] = True
        return np.packbits(picture, axis=1)
