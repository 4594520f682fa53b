"""Values of the last few frames, of which only differences are ever measured."""

import numpy as np
from jaxtyping import Float


class Ties:
    """A Kalman filter of a number (a yaw, a coordinate) at the last frames: a difference that is measured ties two of
    them, and all that are tied to them move along.

    Chains of differences of one spacing would drift apart.

    Args:
        size: frames, oldest first.
        change: per second, standard deviation of the rate's change from frame to frame.
        fastest: per second, the same of the rate before anything is known.

    Attributes:
        values: (frame,); the newest is the answer.
        covariance: (frame, frame).
        seen: frames so far, at most all.
    """

    def __init__(self, size: int, change: float, fastest: float):
        self.values, self.covariance = np.zeros(size), np.zeros((size, size))
        self.change, self.fastest, self.seen = change, fastest, 0

    def predict(self, duration: float) -> None:
        """The next frame, `duration` seconds later, at which the value has gone on at the last rate, more or less."""
        move, noise = np.eye(len(self.values), k=1), 0.0
        move[-1, -1] = 1.0
        if self.seen == 1:
            noise = (self.fastest * duration) ** 2
        elif self.seen > 1:
            move[-1, -2:] = -1.0, 2.0
            noise = (self.change * duration) ** 2
        self.values = move @ self.values
        self.covariance = move @ self.covariance @ move.T
        self.covariance[-1, -1] += noise
        self.seen = min(self.seen + 1, len(self.values))

    def tie(self, back: int, difference: float, variance: float) -> None:
        """Kalman update by a difference from `back` frames ago to now; none if there was no such frame."""
        if back >= self.seen:
            return
        row = self._difference(back)
        spread = self.covariance @ row
        gain = spread / (row @ spread + variance)
        self.values = self.values + gain * (difference - row @ self.values)
        self.covariance = self.covariance - np.outer(gain, spread)

    def variance(self, back: int) -> float:
        """Of the difference from `back` frames ago to now."""
        row = self._difference(back)
        return float(row @ self.covariance @ row)

    def _difference(self, back: int) -> Float[np.ndarray, "frame"]:
        row = np.zeros(len(self.values))
        row[-1], row[-1 - back] = 1.0, -1.0
        return row
