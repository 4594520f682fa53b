"""Directions of walls: most of a building's stand at right angles, or in a few directions."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from radarize.io.pose import wrap

#: Walls that a new direction counts for; probability from which on a wall has one that is known.
_NEW, _CERTAIN = 0.5, 0.9


def from_right_angle(angle: float | Float[np.ndarray, "*any"]) -> float | Float[np.ndarray, "*any"]:
    """Angles (rad) less the nearest multiple of a right one: within pi/4 of 0."""
    return wrap(4 * angle) / 4


def associate_direction(
    off: Float[np.ndarray, "direction"],
    variances: float | Float[np.ndarray, "direction"],
    walls: Sequence[int],
) -> int | None:
    """Which direction a wall has, weighed as in a Chinese restaurant process (Aldous, 1985): a known one by how many
    walls had it and how well it fits, a new one by a constant.

    Args:
        off: by which the wall is past each known direction or a right angle to it, rad.
        variances: of that, rad^2.
        walls: how many had it.

    Returns:
        The direction's number; as many as there are for a new one; None where it is in doubt.
    """
    likely = np.array(walls) * np.exp(-(off**2) / variances / 2) / np.sqrt(2 * np.pi * variances)
    share = likely / (likely.sum() + _NEW / (np.pi / 2))
    if share.max(initial=0.0) > _CERTAIN:
        return int(share.argmax())
    return len(walls) if share.sum() < 0.5 else None
