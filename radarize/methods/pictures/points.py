"""Points of a distribution over range."""

from jaxtyping import Bool, Float
from torch import Tensor


def points(probability: Float[Tensor, "item 257 column"], least: float | Tensor) -> Bool[Tensor, "item range column"]:
    """Pictures with a point in every cell that is likely enough.

    A single point on a bearing, the likeliest or the median, lies nearer to the truth, but leaves what the lidar sees
    behind it without any point: distances are measured both ways.
    """
    return probability[:, :-1] >= least
