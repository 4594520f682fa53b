"""What training makes small, item by item."""

import torch
from jaxtyping import Float, UInt8
from torch import Tensor
from torch.nn.functional import softplus

from radarize.learning.nets.gaussian import Gaussian
from radarize.signal.depthlabel import FREE, SURFACE

#: See `Gaussian.negative_log_likelihood`.
BETA = 0.5


def likelihood(found: Gaussian, truth: Float[Tensor, "item dimension"]) -> Float[Tensor, "item"]:
    """Of velocities: negative log-likelihood, where the paper has squared errors."""
    return found.negative_log_likelihood(truth, BETA)


def cyclic(both: Gaussian, turn: Float[Tensor, "item 1"]) -> Float[Tensor, "item"]:
    """Of turns: the way back is the way there, negated (paper, equation 5), by likelihood.

    Args:
        both: of twice as many items, windows and then the same windows reversed.
        turn: rad.
    """
    forth, back = likelihood(both, torch.cat([turn, -turn])).chunk(2)
    return (forth + back) / 2


def surfaces(logits: Float[Tensor, "item range bearing"], label: UInt8[Tensor, "item range bearing"]) -> Tensor:
    """Of occupancy: cross-entropy in which surfaces, 1 % of the cells, weigh as much as free cells, and Dice.

    Cells behind the first surface are unknown and do not count. (The paper's Dice counts them as free; and as published
    it sums over items and both classes, which makes it 1 - mean probability of the true class: no balance at all.)

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
