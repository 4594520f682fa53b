"""Points and first surfaces from a distribution over range."""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from radarize.signal import polar

#: Side of the dither pattern, cells; a power of two.
_SIDE = 8
#: Cumulative probability that defines the range of a first surface. Chosen on walks 112, 118, 126 and 134 by the F1 of
#: maps: 70, 72, 71, 70, 65 % for 0.15 to 0.4; 67 % for the nearest cell with a probability of 0.01.
_WITHIN = 0.2


def points(probability: Float[Tensor, "item 257 column"], dense: float | Tensor) -> Bool[Tensor, "item range column"]:
    """Place points with a density proportional to the square of the cells' probability.

    Cells above a probability all have a point; below it, points are spread evenly by ordered dithering. So averages
    over points include uncertain surfaces with a small weight. One point per bearing would miss surfaces behind the
    first, and a threshold would give uncertain and certain cells the same weight.

    Args:
        probability: probability of each range cell, and in the last row that of no point.
        dense: probability above which every cell has a point.
    """
    _, rows, columns = probability.shape
    rank = _ranks().to(probability.device).tile(rows // _SIDE, columns // _SIDE)
    return (probability[:, :-1] / dense).square() > rank


def first_surfaces(probability: Float[Tensor, "item 257 column"]) -> Float[np.ndarray, "item column"]:
    """Return the range of each column within which a point lies with a probability of 0.2, m; inf without such a range.

    The value is below the median, because of several surfaces within a column the nearest is wanted.
    """
    within = probability[:, :-1].cumsum(dim=1) >= _WITHIN
    return np.where(within[:, -1].cpu(), polar.RANGES[within.int().argmax(dim=1).cpu()], np.inf)


def _ranks() -> Float[Tensor, "8 8"]:
    """Return the thresholds of ordered dithering (Bayer, "An optimum method for two-level rendition of continuous-tone
    pictures", 1973)."""
    ranks = torch.zeros(1, 1)
    while len(ranks) < _SIDE:
        ranks = torch.cat([torch.cat([4 * ranks, 4 * ranks + 2], 1), torch.cat([4 * ranks + 3, 4 * ranks + 1], 1)])
    return (ranks + 0.5) / ranks.numel()
