"""Scans by the segmentation network, which estimates the first surface on each bearing."""

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

#: Minimum probability that the true range is within `HALF_WIDTH` cells. A higher value leaves fewer ghosts and fewer
#: bearings (chosen on the tuning sets FURNISHED and RADARS_FURNISHED, `radarize.evaluation.benchmark.choices`: with
#: 0.74, 88 % of ranges on 8 walks of FURNISHED are within 10 cm and 77 % of surfaces have a range; with 0.8, 90 % and
#: 71 %).
MIN_PROBABILITY = 0.74
#: Half width of the window around a range, cells: 9 cm with the preset radar.
HALF_WIDTH = 2
#: Distance of the outermost rays of a column from its centre, as a share of its width, in the training label
#: (`radarsim.sensors.scan`).
EDGE_OFFSET = 3 / 8
#: Maximum range difference between neighbouring bearings on one surface, m.
_MAX_STEP = 0.3


class SegmentationScans:
    """Scan extractor by the segmentation network.

    Args:
        first: return the first surface; False: the most likely occupied cell of each bearing at any range, for
            comparison.
        beyond: scan extractor of a radar whose range exceeds that of the network; its echoes beyond that range are used
            where the network detects nothing.

    Attributes:
        ranges: of the rows of the network, m.

    Raises:
        InputError: no such weights, or they do not fit the radar.
    """

    def __init__(self, radar: RadarConfig, weights: Path, first: bool = True, beyond: HeatmapScans | None = None):
        self._net, header = compiled(weights, SegmentationNet, radar)
        self._windows, self.ranges = header.windows(radar, SegmentationNet.maker), header.ranges(radar)
        self.first = first
        self._beyond = beyond if radar.max_range > header.map_grid.reach else None

    @torch.inference_mode()
    def occupancy(self, batch: Batch) -> Float[np.ndarray, "frame range bearing"]:
        """Return the probability that a cell holds the first surface of its bearing, given that the nearer cells are
        free."""
        window = self._windows.push(batch.maps(self._windows.maps), batch.stamps)[0]
        probability = self._net.estimate(window.maps)
        assert isinstance(probability, torch.Tensor)  # the network has one output
        return probability.numpy()

    def extract(self, batch: Batch) -> Float[np.ndarray, "frame bearing"]:
        """Return the scans of the next frames: ranges on `radarize.signal.bearings.BEARINGS`, m, inf where nothing is
        detected."""
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
    """Return the fractional range bin of the first surface on every bearing, inf where its probability is below
    `least`."""
    bins, probability = most_likely(occupancy)
    return np.where(probability >= least, bins, np.inf)


def at_column_centers(ranges: Float[np.ndarray, "frame bearing"]) -> Float[np.ndarray, "frame bearing"]:
    """Convert ranges of the nearest ray of each column to ranges at its centre, inf where there is none.

    The label marks all surfaces that the rays of a column hit, so the first cell of an oblique wall is that of an
    outermost ray. It is too near by `EDGE_OFFSET` times the change of range from column to column.
    """
    steps = np.diff(np.where(np.isinf(ranges), np.nan, ranges), axis=1)
    same = np.abs(steps) <= _MAX_STEP
    change, sides = np.zeros(ranges.shape), np.zeros(ranges.shape, int)
    for side in (np.s_[:, 1:], np.s_[:, :-1]):
        change[side] += np.where(same, steps, 0)
        sides[side] += same
    return ranges + EDGE_OFFSET * np.abs(change) / np.maximum(sides, 1)


def most_likely(
    occupancy: Float[np.ndarray, "frame range bearing"],
) -> tuple[Float[np.ndarray, "frame bearing"], Float[np.ndarray, "frame bearing"]]:
    """Return the fractional range bin of the most likely first surface on every bearing, and the probability of its
    window.

    With h the probability of a cell given that all nearer cells are free, the first surface is in that cell with
    probability h * product over nearer cells of (1 - h). Ghosts behind a surface get almost no probability, which is
    the first-echo rule in terms of probabilities. The result is the mean over the window of 2 `HALF_WIDTH` + 1 cells
    with the largest probability.
    """
    free = np.cumprod(1 - occupancy, axis=1)
    here = occupancy * np.concatenate([np.ones_like(free[:, :1]), free[:, :-1]], axis=1)
    weighted_bins = here * np.arange(here.shape[1])[:, None]
    mass, moment = (_window_sums(values) for values in (here, weighted_bins))
    best = mass.argmax(axis=1)[:, None]
    mass, moment = (np.take_along_axis(values, best, axis=1)[:, 0] for values in (mass, moment))
    return moment / np.maximum(mass, 1e-12), mass


def _window_sums(values: Float[np.ndarray, "frame range bearing"]) -> Float[np.ndarray, "frame range bearing"]:
    """Sums over each cell and its `HALF_WIDTH` neighbours to either side."""
    total = np.cumsum(np.pad(values, ((0, 0), (HALF_WIDTH + 1, HALF_WIDTH), (0, 0))), axis=1)
    return total[:, 2 * HALF_WIDTH + 1 :] - total[:, : -2 * HALF_WIDTH - 1]
