"""Scans by the segmentation network: where each bearing's first surface is, if it can be told."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from radarize.io.stopwatch import stage
from radarize.learning.nets.compiled import compiled
from radarize.learning.nets.segmentation import SegmentationNet
from radarize.radar.config import RadarConfig
from radarize.scans import echoes
from radarize.scans.extraction import HeatmapScans
from radarize.signal.batch import Batch

#: Least probability that a range is right within `HALF_WIDTH` cells: higher leaves fewer ghosts and fewer bearings.
MIN_PROBABILITY = 0.7
#: Cells to either side that count as right: 9 cm of the preset's.
HALF_WIDTH = 2
#: Of its width, how far a column's outermost rays lie from its middle, in the label that the network learned
#: (`radarsim.sensors.scan`).
EDGE_OFFSET = 3 / 8
#: m: what differs by less from bearing to bearing is one surface.
_STEP = 0.3


class SegmentationScans:
    """Scans of a stream's frames.

    Args:
        first: take the first surface; False: the likeliest occupied cell of each bearing, wherever it is, for
            comparison.
        beyond: scans of a radar that sees farther than the network: what they see there is taken, where the network
            sees nothing.

    Attributes:
        ranges: of the network's rows, m.

    Raises:
        InputError: no such weights, or they do not fit the radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path, first: bool = True, beyond: HeatmapScans | None = None):
        self._net, header = compiled(weights, SegmentationNet, radar)
        self._windows, self.ranges = header.windows(radar, SegmentationNet.maker), header.ranges(radar)
        self.first = first
        assert header.grid is not None  # the network sees maps
        self._beyond = beyond if radar.max_range > header.grid.reach else None

    @torch.inference_mode()
    def occupancy(self, batch: Batch) -> Float[np.ndarray, "frame range bearing"]:
        """Probability that a cell holds a bearing's first surface, if nothing is before it."""
        shown = self._windows.push(batch.maps(self._windows.maps), batch.stamps)[0]
        likely = self._net.estimate(shown.maps)
        assert isinstance(likely, torch.Tensor)  # the network's only answer
        return likely.numpy()

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Ranges on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is seen."""
        with stage("scans"):
            occupancy = self.occupancy(batch)
            if self.first:
                near = at_column_centers(echoes.bins_to_ranges(first_surface(occupancy, MIN_PROBABILITY), self.ranges))
            else:
                near = echoes.bins_to_ranges(echoes.strongest(occupancy >= MIN_PROBABILITY, occupancy), self.ranges)
        if self._beyond is None:
            return near
        far = self._beyond.extract(batch)
        return np.where(np.isinf(near) & (far > self.ranges[-1]), far, near)


def first_surface(
    occupancy: Float[np.ndarray, "frame range bearing"], least: float
) -> Float[np.ndarray, "frame bearing"]:
    """Fractional range bin of every bearing's first surface, inf where none is likely enough."""
    bins, probability = most_likely(occupancy)
    return np.where(probability >= least, bins, np.inf)


def at_column_centers(ranges: Float[np.ndarray, "frame bearing"]) -> Float[np.ndarray, "frame bearing"]:
    """Ranges in the middle of each column, from those of its nearest ray, inf where there is none.

    The network was taught all surfaces that a column's rays see, and the first of a wall at an angle is that of an
    outermost ray: by `EDGE_OFFSET` of what the range changes from column to column too near.
    """
    steps = np.diff(np.where(np.isinf(ranges), np.nan, ranges), axis=1)
    same = np.abs(steps) <= _STEP
    change, sides = np.zeros(ranges.shape), np.zeros(ranges.shape, int)
    for side in (np.s_[:, 1:], np.s_[:, :-1]):
        change[side] += np.where(same, steps, 0)
        sides[side] += same
    return ranges + EDGE_OFFSET * np.abs(change) / np.maximum(sides, 1)


def most_likely(
    occupancy: Float[np.ndarray, "frame range bearing"],
) -> tuple[Float[np.ndarray, "frame bearing"], Float[np.ndarray, "frame bearing"]]:
    """Fractional range bin where every bearing's first surface is likeliest, and how likely it is that near.

    With h the probability of a cell if nothing is before it, the first surface is in a cell with probability
    h * product over nearer cells of (1 - h): behind a surface hardly anything is left for ghosts, which is the
    first-echo rule in terms of probability. The answer is the mean over the likeliest 2 `HALF_WIDTH` + 1 cells in a row.
    """
    free = np.cumprod(1 - occupancy, axis=1)
    here = occupancy * np.concatenate([np.ones_like(free[:, :1]), free[:, :-1]], axis=1)
    place = here * np.arange(here.shape[1])[:, None]
    mass, moment = (_window_sums(values) for values in (here, place))
    best = mass.argmax(axis=1)[:, None]
    mass, moment = (np.take_along_axis(values, best, axis=1)[:, 0] for values in (mass, moment))
    return moment / np.maximum(mass, 1e-12), mass


def _window_sums(values: Float[np.ndarray, "frame range bearing"]) -> Float[np.ndarray, "frame range bearing"]:
    """Sums over each cell and its `HALF_WIDTH` neighbours to either side."""
    total = np.cumsum(np.pad(values, ((0, 0), (HALF_WIDTH + 1, HALF_WIDTH), (0, 0))), axis=1)
    return total[:, 2 * HALF_WIDTH + 1 :] - total[:, : -2 * HALF_WIDTH - 1]
