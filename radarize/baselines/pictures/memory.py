"""What was seen shortly before."""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

#: s after which a distribution counts 1/e. Chosen on walks 112, 118, 126 and 134: 0.26 m Chamfer distance without,
#: 0.23 with 0.2 s, 0.22 with 0.4 and with 0.8, 0.23 with 1.2.
LASTS = 0.5


class Memory:
    """Distributions of a stream, averaged with those before them, the older the less.

    Frame by frame a picture's speckle is another, and a network's doubts with it, while the room stays where it is for
    as long as it takes to walk some decimetres.
    """

    def __init__(self) -> None:
        self._known: Tensor | None = None
        self._time = -math.inf

    def push(
        self, probability: Float[Tensor, "frame row column"], stamps: Float[np.ndarray, "frame"]
    ) -> Float[Tensor, "frame row column"]:
        """Averages up to each of the next frames, by their distributions and times (s)."""
        found = []
        for each, time in zip(probability, stamps, strict=True):
            known = each if self._known is None else self._known
            self._known = each + math.exp((self._time - time) / LASTS) * (known - each)
            self._time = time
            found.append(self._known)
        return torch.stack(found)
