"""Scan of a perfect lidar at the radar in the horizontal plane: ranges, and occupancy labels on the radar's range bins.

Both are levelled: the plane is horizontal whatever the sensor's roll and pitch, and bearings are relative to the
horizontal direction of its boresight. Rays start at the sensor's position at the centre of the burst. Glass counts as a
surface, as it does for the radar; moving objects are at their positions at that time.
"""

from enum import IntEnum

import numpy as np
from jaxtyping import Float, UInt8

from radarize.io.recording import Product, Stream
from radarize.radar.config import RadarConfig
from radarsim.motion.trajectory import Motion, turned
from radarsim.scenario import Frames, Scenario
from radarsim.sensors.sensor import Sensor

#: Bearings of the scan, rad: the radar's own 88 columns of one degree.
AZIMUTHS = np.deg2rad(np.arange(-44, 44))
#: Bearings of the four rays per column of the label, rad, (column, ray).
RAYS = AZIMUTHS[:, None] + (AZIMUTHS[1] - AZIMUTHS[0]) * ((np.arange(4) + 0.5) / 4 - 0.5)


class Cell(IntEnum):
    """State of a cell of the occupancy label."""

    FREE = 0
    SURFACE = 1  #: the first surface on some bearing of the column
    UNKNOWN = 2  #: behind it


def headings(motion: Motion, times: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
    """Horizontal direction of the boresight, rad."""
    forward = turned(motion.rotation(times), (1.0, 0.0, 0.0))
    return np.arctan2(forward[:, 1], forward[:, 0])


def level_rays(
    motion: Motion, times: Float[np.ndarray, "frame"], azimuths: Float[np.ndarray, "ray"]
) -> tuple[Float[np.ndarray, "frame 3"], Float[np.ndarray, "frame ray 3"]]:
    """Origins and horizontal unit directions of rays at bearings relative to the boresight's horizontal direction."""
    bearing = headings(motion, times)[:, None] + azimuths
    return motion.position(times), np.stack([np.cos(bearing), np.sin(bearing), np.zeros_like(bearing)], axis=-1)


def axes(name: str, config: RadarConfig, cells: str) -> dict[str, Product]:
    """Range and bearing axes of a stream on the radar's range bins and the scan's bearings."""
    return {
        f"{name}_ranges": Product(config.ranges - config.range_bias, "m", f"{cells} of /{name}"),
        f"{name}_azimuths": Product(AZIMUTHS, "rad", f"bearings of /{name}, positive to the left"),
    }


class PlanarScan(Sensor):
    """Range of the first surface on each bearing."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        height = float(scenario.motion.position(np.array([scenario.config.burst_center]))[0, 2])
        about = "range of the first surface in the horizontal plane, inf beyond the radar's range"
        self.streams = {"truth/scan": Stream((len(AZIMUTHS),), "f4", "m", about)}
        self.products = {
            "truth/scan_azimuths": Product(AZIMUTHS, "rad", "bearings of /truth/scan, positive to the left"),
            "truth/floor_plan": Product(
                scenario.scene.floor_plan(height),
                "m",
                "x0 y0 x1 y1 of everything cut by the plane of the sensor at start",
            ),
        }

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Scans of frames."""
        times = frames.middles
        distance = self.scenario.rays.distance(*level_rays(self.scenario.motion, times, AZIMUTHS), times)
        return {"truth/scan": np.where(distance <= self.scenario.config.max_range, distance, np.inf)}


class Occupancy(Sensor):
    """State of every cell of a polar grid with the radar's range bins and the scan's bearings."""

    def __init__(self, scenario: Scenario):
        super().__init__(scenario)
        cells = (scenario.config.samples, len(AZIMUTHS))
        about = "state of cells (radar range bin, bearing) in the horizontal plane: " + ", ".join(
            f"{cell} {cell.name.lower()}" for cell in Cell
        )
        self.streams = {
            "truth/occupancy": Stream(cells, "u1", "", about, labels=tuple(cell.name.lower() for cell in Cell))
        }
        self.products = axes("truth/occupancy", scenario.config, "middles of the range cells")

    def observe(self, frames: Frames) -> dict[str, np.ndarray]:
        """Occupancy labels of frames."""
        times = frames.middles
        rays = level_rays(self.scenario.motion, times, RAYS.ravel())
        distance = self.scenario.rays.distance(*rays, times).reshape(len(times), *RAYS.shape)
        return {"truth/occupancy": self.label(distance)}

    def label(self, distance: Float[np.ndarray, "frame column ray"]) -> UInt8[np.ndarray, "frame range column"]:
        """States from the ranges of a column's rays: free up to the farthest of its first surfaces, unknown beyond."""
        config = self.scenario.config
        index = (np.minimum(distance, 2 * config.max_range) + config.range_bias) / config.range_resolution
        index = np.rint(index).astype(int)
        bins = np.arange(config.samples)
        states = np.where(bins < index.max(axis=2)[..., None], Cell.FREE, Cell.UNKNOWN).astype(np.uint8)
        frame, column, ray = np.nonzero(index < config.samples)
        states[frame, column, index[frame, column, ray]] = Cell.SURFACE
        return states.transpose(0, 2, 1)
