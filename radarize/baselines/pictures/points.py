"""Points, and first surfaces, of a distribution over range."""

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from radarize.signal import polar

#: Cells of one side of the pattern: powers of two.
_SIDE = 8
#: Probability within the range at which a first surface is taken to be; chosen on walks 112, 118, 126 and 134 (F1 of
#: maps at 0.15 to 0.4: 70, 72, 71, 70, 65 %; the nearest cell of a probability of 0.01: 67 %).
_WITHIN = 0.2


def points(probability: Float[Tensor, "item 257 column"], dense: float | Tensor) -> Bool[Tensor, "item range column"]:
    """Pictures whose points lie as densely as the square of their cells' probability says.

    Where the network is sure every cell has a point, elsewhere some have, evenly spread: whoever averages over points
    hears of doubtful places, but mostly of those that are certain. One point on a bearing leaves what the lidar sees
    behind it without any, and all cells of some probability count doubtful ones like certain ones.

    Args:
        probability: of ranges, and last, of nothing.
        dense: from which on every cell has a point.
    """
    _, rows, columns = probability.shape
    rank = _ranks().to(probability.device).tile(rows // _SIDE, columns // _SIDE)
    return (probability[:, :-1] / dense).square() > rank


def first_surfaces(probability: Float[Tensor, "item 257 column"]) -> Float[np.ndarray, "item column"]:
    """Range of each column within which something is with a probability of a fifth, m; inf where there is none.

    Of several surfaces that a lidar sees on a column's beams the nearest is wanted, so less than the median.
    """
    within = probability[:, :-1].cumsum(dim=1) >= _WITHIN
    return np.where(within[:, -1].cpu(), polar.RANGES[within.int().argmax(dim=1).cpu()], np.inf)


def _ranks() -> Float[Tensor, "8 8"]:
    """Each share of cells of a square, evenly spread over it (Bayer, "An optimum method for two-level rendition of
    continuous-tone pictures", 1973)."""
    ranks = torch.zeros(1, 1)
    while len(ranks) < _SIDE:
        ranks = torch.cat([torch.cat([4 * ranks, 4 * ranks + 2], 1), torch.cat([4 * ranks + 3, 4 * ranks + 1], 1)])
    return (ranks + 0.5) / ranks.numel()
