"""Isometries of the world as 3 x 4, matrix and offset in m: reflections, half turns, rigid motions, their products."""

import numpy as np
from jaxtyping import Float


def after(second: Float[np.ndarray, "*n 3 4"], first: Float[np.ndarray, "*m 3 4"]) -> Float[np.ndarray, "*k 3 4"]:
    """Compose two isometries: `first`, followed by `second`."""
    out = second[..., :3] @ first
    out[..., 3] += second[..., 3]
    return out


def image(isometry: Float[np.ndarray, "*n 3 4"], place: Float[np.ndarray, "*m 3"]) -> Float[np.ndarray, "*k 3"]:
    """Apply an isometry to places (m)."""
    return np.einsum("...ij,...j->...i", isometry[..., :3], place) + isometry[..., 3]


def inverse(isometry: Float[np.ndarray, "*n 3 4"]) -> Float[np.ndarray, "*n 3 4"]:
    """Inverse isometry; for a chain of mirrors, the chain in reverse order."""
    back = np.swapaxes(isometry[..., :3], -1, -2)
    return np.concatenate([back, -back @ isometry[..., 3:]], axis=-1)
