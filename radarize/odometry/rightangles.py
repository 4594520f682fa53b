"""Directions of walls: most walls of a building are at right angles, or have a few directions."""

from collections.abc import Sequence
from typing import overload

import numpy as np
from jaxtyping import Float

from radarize.io.pose import wrap

#: Weight of a new direction, in walls; minimum probability for a wall to be associated with a known direction.
_NEW_WEIGHT, _MIN_PROBABILITY = 0.5, 0.9


@overload
def from_right_angle(angle: float) -> float: ...


@overload
def from_right_angle(angle: np.ndarray) -> np.ndarray: ...


def from_right_angle(angle: float | Float[np.ndarray, "*any"]) -> float | Float[np.ndarray, "*any"]:
    """Deviation of angles (rad) from the nearest multiple of a right angle, within +-pi/4."""
    return wrap(4 * angle) / 4


def associate_direction(
    deviations: Float[np.ndarray, "direction"],
    variances: float | Float[np.ndarray, "direction"],
    walls: Sequence[int],
) -> int | None:
    """Associate a wall with one of the known directions, as in a Chinese restaurant process (Aldous, 1985): the weight
    of a known direction is its number of walls times the likelihood, the weight of a new one is a constant.

    Args:
        deviations: of the wall from each known direction or a right angle to it, rad.
        variances: of the deviations, rad^2.
        walls: number of walls associated with each direction so far.

    Returns:
        The index of the direction, or the number of directions if the wall has a new one; None if it is ambiguous.
    """
    likelihood = np.array(walls) * np.exp(-(deviations**2) / variances / 2) / np.sqrt(2 * np.pi * variances)
    probability = likelihood / (likelihood.sum() + _NEW_WEIGHT / (np.pi / 2))
    if probability.max(initial=0.0) > _MIN_PROBABILITY:
        return int(probability.argmax())
    return len(walls) if probability.sum() < 0.5 else None
