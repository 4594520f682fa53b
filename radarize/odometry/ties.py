"""Values of the last few frames, of which only differences are ever measured."""

import numpy as np
from jaxtyping import Float


class Ties:
    """A Kalman filter of a number (a yaw, a coordinate) at the last frames and of its rate: a difference that is
    measured ties two of the frames, and all that are tied to them move along.

    Chains of differences of one spacing would drift apart. Frames may come at any times.

    Args:
        size: frames, oldest first.
        wander: per second^1.5, by how much the rate wanders in a second.
        fastest: per second, standard deviation of the rate before anything is known.

    Attributes:
        values: (frame,); the newest is the answer.
        rate: per second, now.
        covariance: (frame and rate, frame and rate).
        seen: frames so far, at most all.
    """

    def __init__(self, size: int, wander: float, fastest: float):
        self._state = np.zeros(size + 1)
        self.covariance = np.zeros((size + 1, size + 1))
        self.covariance[-1, -1] = fastest**2
        self._wander, self.seen = wander, 0

    @property
    def values(self) -> Float[np.ndarray, "frame"]:
        return self._state[:-1]

    @property
    def rate(self) -> float:
        return float(self._state[-1])

    def predict(self, duration: float) -> None:
        """The next frame, `duration` seconds later, to which the value has gone on at its rate; the first is zero."""
        size, self.seen = len(self.values), min(self.seen + 1, len(self.values))
        if self.seen == 1:
            return
        move = np.eye(size + 1, k=1)
        move[size - 1 :, size - 1 :] = [[1.0, duration], [0.0, 1.0]]
        self._state = move @ self._state
        self.covariance = move @ self.covariance @ move.T
        self.covariance[-2:, -2:] += wandered(self._wander, duration)

    def part(self) -> None:
        """What follows tells no more of what was, nor of how the value came to be what it is."""
        self.covariance = np.diag(np.diag(self.covariance) * (np.arange(len(self._state)) >= len(self._state) - 2))

    def tie(self, back: int, difference: float, variance: float) -> None:
        """Kalman update by a difference from `back` frames ago to now; none if there was no such frame."""
        if not 0 < back < self.seen:
            return
        row = self._difference(back)
        spread = self.covariance @ row
        gain = spread / (row @ spread + variance)
        self._state = self._state + gain * (difference - row @ self._state)
        self.covariance = self.covariance - np.outer(gain, spread)

    def variance(self, back: int) -> float:
        """Of the difference from `back` frames ago to now."""
        row = self._difference(back)
        return float(row @ self.covariance @ row)

    def _difference(self, back: int) -> Float[np.ndarray, "frame_and_rate"]:
        row = np.zeros(len(self._state))
        row[-2], row[-2 - back] = 1.0, -1.0
        return row


def wandered(wander: float, duration: float) -> Float[np.ndarray, "2 2"]:
    """Covariance of what a value and its rate have changed by, if the rate is a random walk of `wander` per root second
    (Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 6.2.2).
    """
    third, half = duration**3 / 3, duration**2 / 2
    return wander**2 * np.array([[third, half], [half, duration]])
