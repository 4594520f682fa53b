"""Loss functions, per item."""

import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn.functional import softplus

from radarize.learning.nets.gaussian import Gaussian
from radarize.signal.depthlabel import FREE, SURFACE

#: See `Gaussian.negative_log_likelihood`.
BETA = 0.5


def likelihood(found: Gaussian, truth: Float[Tensor, "item dimension"]) -> Float[Tensor, "item"]:
    """Loss of velocities: negative log-likelihood, instead of the paper's squared errors."""
    return found.negative_log_likelihood(truth, BETA)


def cyclic(both: Gaussian, turn: Float[Tensor, "item 1"]) -> Float[Tensor, "item"]:
    """Loss of rotations by likelihood: reversed windows have the negative rotation (paper, equation 5).

    Args:
        both: distributions of windows and then of the same windows reversed.
        turn: rad.
    """
    forth, back = likelihood(both, torch.cat([turn, -turn])).chunk(2)
    return (forth + back) / 2


def surfaces(logits: Float[Tensor, "item range bearing"], label: UInt8[Tensor, "item range bearing"]) -> Tensor:
    """Loss of occupancy: cross-entropy with equal weight of surfaces, 1 % of the cells, and free cells, plus Dice.

    Cells behind the first surface are unknown and have no weight. The paper's Dice counts them as free, and in the
    published code it sums over items and both classes, so that it equals 1 - mean probability of the true class and
    does not balance the classes.

    Returns:
        (item,)
    """
    surface, free = (label == SURFACE).float(), (label == FREE).float()

    def mean(values: Tensor, weights: Tensor) -> Tensor:
        return (values * weights).sum(dim=(1, 2)) / weights.sum(dim=(1, 2)).clamp_min(1)

    entropy = (mean(softplus(-logits), surface) + mean(softplus(logits), free)) / 2
    likely = torch.sigmoid(logits)
    shared = (likely * surface).sum(dim=(1, 2))
    total = (likely * (surface + free)).sum(dim=(1, 2)) + surface.sum(dim=(1, 2))
    return entropy + 1 - (2 * shared + 1) / (total + 1)
