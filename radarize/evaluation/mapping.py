"""Maps against the floor plan."""

import numpy as np
import shapely
from jaxtyping import Float
from scipy.spatial import cKDTree

from radarize.evaluation.metrics import over
from radarize.io.pose import inverse, transform
from radarize.pipeline.runfolder import OccupancyMap
from radarize.slam.config import GridConfig
from radarize.slam.grid import OccupancyGrid

#: m: a mapped point this near to a true surface counts as right.
TOLERANCE = 0.10
#: m: spacing of the points that stand for a wall.
SPACING = 0.02


def segment_points(plan: Float[np.ndarray, "segment 4"], spacing: float = SPACING) -> Float[np.ndarray, "point 2"]:
    """Points along segments (x0 y0 x1 y1), at most `spacing` apart, so that each stands for the same length."""
    plan = np.asarray(plan, float).reshape(-1, 4)
    start, end = plan[:, :2], plan[:, 2:]
    counts = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / spacing).astype(int), 1)
    owner = np.repeat(np.arange(len(plan)), counts)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    return start[owner] + ((step + 0.5) / counts[owner])[:, None] * (end - start)[owner]


def distance_to_plan(
    points: Float[np.ndarray, "point 2"], plan: Float[np.ndarray, "segment 4"]
) -> Float[np.ndarray, "point"]:
    """Distance of each point to the nearest segment, m."""
    walls = shapely.multilinestrings(shapely.linestrings(np.reshape(plan, (-1, 2, 2)).astype(float)))
    shapely.prepare(walls)
    return shapely.distance(walls, shapely.points(points))


def scan_endpoints(
    positions: Float[np.ndarray, "scan 2"],
    yaw: Float[np.ndarray, "scan"],
    azimuths: Float[np.ndarray, "beam"],
    ranges: Float[np.ndarray, "scan beam"],
) -> Float[np.ndarray, "end 2"]:
    """Where the beams that returned anything end, m, in the frame of the poses."""
    hit = np.isfinite(ranges) & (ranges > 0)
    return _ends(positions, yaw, azimuths, np.where(hit, ranges, 0))[hit]


def _ends(positions: np.ndarray, yaw: np.ndarray, azimuths: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Ends of beams of some lengths, (scan, beam, 2); arguments as of `scan_endpoints`."""
    bearing = yaw[:, None] + azimuths
    return positions[:, None] + lengths[..., None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)


def map_errors(
    grid: OccupancyMap,
    plan: Float[np.ndarray, "segment 4"],
    turn: Float[np.ndarray, "3 3"],
    shift: Float[np.ndarray, "3"],
    seen: Float[np.ndarray, "end 2"] | None = None,
) -> dict[str, float]:
    """Occupied cells against a floor plan.

    Args:
        grid: map in the estimate's frame.
        plan: wall segments in the reference's frame, m.
        turn, shift: alignment of the trajectory, from the estimate's to the reference's frame.
        seen: ends of true beams within the radar's reach, in the reference's frame; recall is of those parts of the
            plan that they touch, and of the whole plan if None.

    Returns:
        ``precision``: share of occupied cells within 10 cm of a wall. ``recall``: share of the wall's length within
        10 cm of an occupied cell. ``f1``: their harmonic mean. ``chamfer``: mean of the mean distances both ways, m.
        ``cells``, ``seen_length`` (m): how many and how much that was about.
        An empty map recalls nothing, and its precision is NaN.
    """
    cells = grid.centers(grid.occupied)
    cells = (np.column_stack([cells, np.zeros(len(cells))]) @ turn.T + shift)[:, :2]
    walls = segment_points(plan)
    if seen is not None:
        walls = walls[cKDTree(seen).query(walls)[0] <= TOLERANCE]  # what the sensor had a chance to map
    about = {"cells": len(cells), "seen_length": len(walls) * SPACING}
    if not len(cells) or not len(walls):
        return {"precision": np.nan, "recall": 0.0 if len(walls) else np.nan, "f1": np.nan, "chamfer": np.nan} | about
    off_wall = distance_to_plan(cells, plan)
    off_map, _ = cKDTree(cells).query(walls)
    return agreement(off_wall, off_map) | {"chamfer": (off_wall.mean() + off_map.mean()) / 2} | about


def agreement(
    off_surface: Float[np.ndarray, "cell"], off_map: Float[np.ndarray, "point"], near: float = TOLERANCE
) -> dict[str, float]:
    """How well a map's cells and a surface's points agree.

    Args:
        off_surface: distances of cells from the surface, m.
        off_map: distances of the surface's points from the nearest cell, m.
        near: m, within which they do.

    Returns:
        ``precision`` and ``recall``, the shares of cells and points that do, and ``f1``, their harmonic mean.
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
    """Overlap of the map's free space with what true beams passed through: intersection over union of the areas.

    Args:
        grid: map in the estimate's frame.
        turn, shift: alignment of the trajectory, from the estimate's to the reference's frame.
        positions, yaw, azimuths, ranges: true scans in the reference's frame, m and rad; beams that met nothing count
            as far as the longest that did.
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
