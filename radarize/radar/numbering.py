"""Frame numbers from time stamps, in which lost frames leave a gap."""

import numpy as np
from jaxtyping import Float, Int


class Numbering:
    """Frame numbers of a stream. The step between time stamps is rounded to whole frame periods, one at least; only
    steps count, so a clock error of some percent is not taken for a gap, however long the stream.

    Args:
        period: between frames, s.

    Attributes:
        missing: number of lost frames so far.
    """

    def __init__(self, period: float):
        self.period, self.missing = period, 0
        self._last: tuple[int, float] | None = None  # number and stamp

    def of(self, stamps: Float[np.ndarray, "frame"]) -> Int[np.ndarray, "frame"]:
        """Numbers of the next frames; the first frame of the stream is 0.

        Args:
            stamps: ascending, s.
        """
        if not len(stamps):
            return np.zeros(0, int)
        number, stamp = self._last or (-1, stamps[0] - self.period)
        steps = np.maximum(np.rint(np.diff(stamps, prepend=stamp) / self.period), 1).astype(int)
        numbers = number + np.cumsum(steps)
        self.missing += int((steps - 1).sum())
        self._last = int(numbers[-1]), float(stamps[-1])
        return numbers
