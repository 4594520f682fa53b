"""Recursive average of a network's distributions over time."""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

#: Time constant of the average, s. Chosen on walks 112, 118, 126 and 134, by the Chamfer distance: 0.26 m without
#: averaging, 0.23 m with 0.2 s, 0.22 m with 0.4 s and 0.8 s, 0.23 m with 1.2 s.
LASTS = 0.5


class Memory:
    """Exponentially weighted average of the distributions of a stream.

    Speckle, and the network's uncertainty with it, changes from frame to frame, while the surroundings stay nearly the
    same over a motion of some decimetres.
    """

    def __init__(self) -> None:
        self._known: Tensor | None = None
        self._time = -math.inf

    def push(
        self, probability: Float[Tensor, "frame row column"], stamps: Float[np.ndarray, "frame"]
    ) -> Float[Tensor, "frame row column"]:
        """Return the averages up to each of the next frames.

        Args:
            probability: distribution of each frame.
            stamps: time of each frame, s.
        """
        found = []
        for each, time in zip(probability, stamps, strict=True):
            known = each if self._known is None else self._known
            self._known = each + math.exp((self._time - time) / LASTS) * (known - each)
            self._time = time
            found.append(self._known)
        return torch.stack(found)
