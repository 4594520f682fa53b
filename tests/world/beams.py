"""Beams of a level scanner, for tests of the surroundings."""

import numpy as np
from jaxtyping import Float


def level_beams(
    position: Float[np.ndarray, "3"], bearings: Float[np.ndarray, "beam"]
) -> tuple[Float[np.ndarray, "beam 3"], Float[np.ndarray, "beam 3"]]:
    """Origins and directions of horizontal beams at some bearings, deg."""
    angle = np.deg2rad(bearings)
    directions = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    return np.broadcast_to(position, directions.shape), directions
