"""Points of a distribution over range."""

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def points(probability: Float[Tensor, "item 257 column"], least: float | Tensor) -> Bool[Tensor, "item range column"]:
    """Pictures with one point in every column that is likely to have any: at the median of its ranges, from which the
    true one is least far on average."""
    ranges, nothing = probability[:, :-1], probability[:, -1]
    share = ranges.cumsum(dim=1) / ranges.sum(dim=1, keepdim=True).clamp_min(1e-12)
    median = (share < 0.5).sum(dim=1).clamp_max(ranges.shape[1] - 1)
    there = (1 - nothing) >= least
    rows = torch.arange(ranges.shape[1], device=probability.device)[:, None]
    return (rows == median[:, None]) & there[:, None]
