"""The occupancy label of a depth camera's pictures: what segmentation learns, where no simulator has made it.

The camera is taken to stand at the radar, level, with the same boresight, as the published labels do.
"""

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from radarize.io.recording import Product, Stream
from radarize.radar.config import RadarConfig

#: States of a cell, as in the simulator's label.
FREE, SURFACE, UNKNOWN = 0, 1, 2
#: Bearings of the label's columns, rad, as in the simulator's.
AZIMUTHS = np.deg2rad(np.arange(-44, 44))
#: m; pixels whose points are farther above or below the camera's axis are left out, as in the published labels.
SLAB = 0.03
LABEL = "truth/occupancy"


def label_streams(config: RadarConfig) -> tuple[dict[str, Stream], dict[str, Product]]:
    """The label and its axes, as data sets of a recording."""
    about = "state of cells (radar range bin, bearing) in the camera's plane: 0 free, 1 surface, 2 unknown"
    ranges = Product(config.ranges - config.range_bias, "m", f"middles of the range cells of /{LABEL}")
    bearings = Product(AZIMUTHS, "rad", f"bearings of /{LABEL}, positive to the left")
    stream = Stream((config.samples, len(AZIMUTHS)), "u1", "", about, labels=("free", "surface", "unknown"))
    return {LABEL: stream}, {f"{LABEL}_ranges": ranges, f"{LABEL}_azimuths": bearings}


def occupancy(
    depth: UInt16[np.ndarray, "frame row column"], pinhole: Float[np.ndarray, "4"], config: RadarConfig
) -> UInt8[np.ndarray, "frame range bearing"]:
    """States of cells from depth pictures.

    A column of pixels sees a surface at the median distance of its points in the camera's plane. A bearing is free up
    to the farthest surface of its columns, and unknown behind it, or everywhere if no pixel has a value.

    Args:
        depth: along the optical axis, mm; 0: no value.
        pinhole: fx, fy, cx, cy, pixels.
        config: of the radar; the cells are its range bins.
    """
    fx, fy, cx, cy = pinhole
    frames, rows, columns = depth.shape
    across, down = (np.arange(columns) - cx) / fx, (np.arange(rows) - cy) / fy
    forward = depth * 1e-3
    level = (depth > 0) & (np.abs(forward * down[:, None]) < SLAB)
    distance = np.sort(np.where(level, forward * np.hypot(1.0, across), np.inf), axis=1)
    middle = np.maximum(level.sum(axis=1) - 1, 0) // 2
    distance = np.take_along_axis(distance, middle[:, None], axis=1)[:, 0]
    bearing = np.rint((-np.arctan(across) - AZIMUTHS[0]) / (AZIMUTHS[1] - AZIMUTHS[0])).astype(int)
    inside = (bearing >= 0) & (bearing < len(AZIMUTHS))
    known = np.isfinite(distance) & inside
    frame, column = known.nonzero()
    cell = np.rint((distance[known] + config.range_bias) / config.range_resolution).astype(int)
    farthest = np.zeros((frames, len(AZIMUTHS)), int)
    np.maximum.at(farthest, (frame, bearing[column]), cell)
    states = np.where(np.arange(config.samples)[:, None] < farthest[:, None], FREE, UNKNOWN).astype(np.uint8)
    reached = cell < config.samples
    states[frame[reached], cell[reached], bearing[column[reached]]] = SURFACE
    return states
