"""Errors of occupancy maps against a floor plan."""

import numpy as np
import shapely
from jaxtyping import Float
from scipy.spatial import cKDTree

from radarize.evaluation.metrics import over
from radarize.io.pose import inverse, transform
from radarize.pipeline.runfolder import OccupancyMap
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid

#: Maximum distance of a correct map cell from a true surface, m.
TOLERANCE = 0.10
#: Spacing of the points that represent a wall, m.
SPACING = 0.02


def segment_points(plan: Float[np.ndarray, "segment 4"], spacing: float = SPACING) -> Float[np.ndarray, "point 2"]:
    """Return points along segments (x0 y0 x1 y1), at most `spacing` apart, each for nearly the same length, m."""
    plan = np.asarray(plan, float).reshape(-1, 4)
    start, end = plan[:, :2], plan[:, 2:]
    counts = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / spacing).astype(int), 1)
    owner = np.repeat(np.arange(len(plan)), counts)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return start[owner] + ((step + 0.5) / counts[owner])[:, None] * (end - start)[owner]


def distance_to_plan(
    points: Float[np.ndarray, "point 2"], plan: Float[np.ndarray, "segment 4"]
) -> Float[np.ndarray, "point"]:
    """Return the distance of each point to the nearest segment, m."""
    walls = shapely.multilinestrings(shapely.linestrings(np.reshape(plan, (-1, 2, 2)).astype(float)))
    shapely.prepare(walls)
    return shapely.distance(walls, shapely.points(points))


def scan_endpoints(
    positions: Float[np.ndarray, "scan 2"],
    yaw: Float[np.ndarray, "scan"],
    azimuths: Float[np.ndarray, "beam"],
    ranges: Float[np.ndarray, "scan beam"],
) -> Float[np.ndarray, "end 2"]:
    """Return the end points of beams with a return, m, in the frame of the poses."""
    hit = np.isfinite(ranges) & (ranges > 0)
    return _ends(positions, yaw, azimuths, np.where(hit, ranges, 0))[hit]


def _ends(positions: np.ndarray, yaw: np.ndarray, azimuths: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the ends of beams of given lengths, (scan, beam, 2); arguments as in `scan_endpoints`."""
    bearing = yaw[:, None] + azimuths
    return positions[:, None] + lengths[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)


def map_errors(
    grid: OccupancyMap,
    plan: Float[np.ndarray, "segment 4"],
    turn: Float[np.ndarray, "3 3"],
    shift: Float[np.ndarray, "3"],
    seen: Float[np.ndarray, "end 2"] | None = None,
) -> dict[str, float]:
    """Compare the occupied cells of a map with a floor plan.

    Args:
        grid: map in the frame of the estimate.
        plan: wall segments in the frame of the reference, m.
        turn, shift: alignment of the trajectory, from the frame of the estimate to that of the reference.
        seen: ends of true beams within the radar's range, in the frame of the reference; recall is of the parts of the
            plan that they hit, and of the whole plan if None.

    Returns:
        ``precision``: share of occupied cells within 10 cm of a wall. ``recall``: share of the wall's length within
        10 cm of an occupied cell. ``f1``: their harmonic mean. ``chamfer``: mean of the mean distances both ways, m.
        ``cells``: number of occupied cells. ``seen_length``: length of the compared parts of the plan, m.
        An empty map has a recall of 0 and a precision of NaN.
    """
    cells = grid.centers(grid.occupied)
    cells = (np.column_stack([cells, np.zeros(len(cells))]) @ turn.T + shift)[:, :2]
    walls = segment_points(plan)
    if seen is not None:
        walls = walls[cKDTree(seen).query(walls)[0] <= TOLERANCE]  # parts visible to the sensor
    about = {"cells": len(cells), "seen_length": len(walls) * SPACING}
    if not len(cells) or not len(walls):
        return {"precision": np.nan, "recall": 0.0 if len(walls) else np.nan, "f1": np.nan, "chamfer": np.nan} | about
    off_wall = distance_to_plan(cells, plan)
    off_map, _ = cKDTree(cells).query(walls)
    return agreement(off_wall, off_map) | {"chamfer": (off_wall.mean() + off_map.mean()) / 2} | about


def agreement(
    off_surface: Float[np.ndarray, "cell"], off_map: Float[np.ndarray, "point"], near: float = TOLERANCE
) -> dict[str, float]:
    """Return precision, recall and F1 of the cells of a map against the points of a surface.

    Args:
        off_surface: distances of cells from the surface, m.
        off_map: distances of the surface's points from the nearest cell, m.
        near: maximum distance of a match, m.

    Returns:
        ``precision`` and ``recall``: shares of cells and points within `near`; ``f1``: their harmonic mean.
    """
    precision = over(off_surface <= near)
    recall = float(np.mean(off_map <= near))
    return {"precision": precision, "recall": recall, "f1": 2 * precision * recall / max(precision + recall, 1e-12)}


def free_space_iou(
    grid: OccupancyMap,
    turn: Float[np.ndarray, "3 3"],
    shift: Float[np.ndarray, "3"],
    positions: Float[np.ndarray, "scan 2"],
    yaw: Float[np.ndarray, "scan"],
    azimuths: Float[np.ndarray, "beam"],
    ranges: Float[np.ndarray, "scan beam"],
) -> float:
    """Return the intersection over union of the map's free space with the area that true beams passed.

    Args:
        grid: map in the frame of the estimate.
        turn, shift: alignment of the trajectory, from the frame of the estimate to that of the reference.
        positions, yaw, azimuths, ranges: true scans in the frame of the reference, m and rad; beams without a return
            have the length of the longest one with a return.
    """
    met = np.isfinite(ranges) & (ranges > 0)
    if not met.any():
        return float("nan")
    config = GridConfig()
    truth = OccupancyGrid.empty(grid.resolution)
    ends = _ends(positions, yaw, azimuths, np.where(met, ranges, ranges[met].max()))
    for origin, end, hits in zip(positions, ends, met, strict=True):
        truth.insert(np.broadcast_to(origin, end.shape), end, hits, config)
    row, column = np.nonzero((truth.probability > 0) & (truth.probability < 0.5))
    points = truth.origin + (np.column_stack([column, row]) + 0.5) * truth.resolution
    there = (np.column_stack([points, np.zeros(len(points))]) - shift) @ turn
    at = np.floor(transform(inverse(np.array(grid.origin)), there[:, :2]) / grid.resolution).astype(int)
    rows, columns = grid.free.shape
    inside = (at >= 0).all(axis=1) & (at[:, 0] < columns) & (at[:, 1] < rows)
    both = grid.free[rows - 1 - at[inside, 1], at[inside, 0]].sum()
    return float(both / (len(points) + grid.free.sum() - both))
