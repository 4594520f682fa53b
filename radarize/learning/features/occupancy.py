"""Label of the segmentation: free cells of range and bearing, and cells with the first surface."""

import numpy as np
from jaxtyping import UInt8

from radarize.learning.features.grid import MapGrid
from radarize.learning.features.table import Reading
from radarize.signal.depthlabel import SURFACE, UNKNOWN


def on_grid(
    cells: UInt8[np.ndarray, "frame range bearing"], own: MapGrid, known: MapGrid
) -> UInt8[np.ndarray, "frame known bearing"]:
    """Resample labels from a radar's range bins to those of another: the nearest cell's state, without losing surfaces;
    unknown beyond the radar's range."""
    nearest = np.rint(known.step * np.arange(known.rows) / own.step).astype(int)
    found = cells[:, np.minimum(nearest, own.rows - 1)]
    found[:, nearest >= own.rows] = UNKNOWN
    frame, row, bearing = np.nonzero(cells == SURFACE)
    row = np.rint(own.step * row / known.step).astype(int)
    seen = row < known.rows
    found[frame[seen], row[seen], bearing[seen]] = SURFACE
    return found


OCCUPANCY = Reading("occupancy", "truth/occupancy", on_grid=on_grid)
