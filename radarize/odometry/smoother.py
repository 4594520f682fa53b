"""Kalman filter with a variable number of states, and fixed-lag smoother of a scalar over the last frames."""

import numpy as np
from jaxtyping import Float

Row = Float[np.ndarray, "number"]

#: Squared Mahalanobis distance above which a measurement is down-weighted.
_GATE = 9.0


class Gaussian:
    """Mean and covariance of states. Measurements are weighted sums of states; a row holds the weights.

    Args:
        variances: of the initial states, which are zero and independent.

    Attributes:
        mean, covariance: of all states.
        cross_covariance: covariance of the errors of all states with the error that one state had at a time, see
            `remember`.
    """

    def __init__(self, variances: Row):
        self.mean, self.covariance = np.zeros(len(variances)), np.diag(np.asarray(variances, float))
        self.cross_covariance = np.zeros(len(variances))

    def remember(self, index: int) -> None:
        """Start tracking the cross-covariance of all errors with the current error of one state."""
        self.cross_covariance = self.covariance[index].copy()

    def row(self, weights: dict[int, float]) -> Row:
        """Return the row with these weights, by the index of the state."""
        row = np.zeros(len(self.mean))
        row[list(weights)] = list(weights.values())
        return row

    def variance(self, row: Row) -> float:
        """Return the variance of a weighted sum."""
        return float(row @ self.covariance @ row)

    def replace(self, index: int, row: Row) -> None:
        """Replace a state by a weighted sum of states."""
        self.mean[index] = row @ self.mean
        spread = self.covariance @ row
        own_variance = row @ spread
        self.covariance[index], self.covariance[:, index] = spread, spread
        self.covariance[index, index] = own_variance
        self.cross_covariance[index] = row @ self.cross_covariance

    def add(self, index: int, row: Row, offset: float, variance: float) -> None:
        """Insert a state before an index: a weighted sum plus an offset and noise."""
        spread = self.covariance @ row
        own_variance = row @ spread + variance
        self.mean = np.insert(self.mean, index, row @ self.mean + offset)
        self.covariance = np.insert(
            np.insert(self.covariance, index, spread, 0), index, np.insert(spread, index, own_variance), 1
        )
        self.cross_covariance = np.insert(self.cross_covariance, index, row @ self.cross_covariance)

    def keep(self, places: list[int]) -> None:
        """Marginalise out all other states."""
        self.mean, self.covariance = self.mean[places], self.covariance[np.ix_(places, places)]
        self.cross_covariance = self.cross_covariance[places]

    def update(self, row: Row, innovation: float, variance: float, gate: float = _GATE) -> None:
        """Correct by a measured sum, given the innovation. An innovation beyond the gate is down-weighted: the variance
        is raised until the innovation is at the gate."""
        spread = self.covariance @ row
        total = max(float(row @ spread) + variance, innovation**2 / gate)
        self.mean = self.mean + innovation / total * spread
        self.covariance = self.covariance - np.outer(spread, spread / total)
        self.cross_covariance = self.cross_covariance - spread / total * (row @ self.cross_covariance)


class FixedLagSmoother(Gaussian):
    """Fixed-lag smoother of a scalar (a yaw, a coordinate) at the last frames, oldest first, and of its rate. Each
    relative motion between two frames corrects all of them.

    Frames may come at irregular times.

    Args:
        size: number of frames.
        wander: random walk of the rate, 1/s^1.5: its standard deviation after 1 s.
        fastest: standard deviation of the rate before any measurement, 1/s.

    Attributes:
        seen: number of frames so far, at most `size`.
    """

    def __init__(self, size: int, wander: float, fastest: float):
        super().__init__(np.append(np.zeros(size), fastest**2))
        self._wander, self.seen = wander, 0

    @property
    def values(self) -> Float[np.ndarray, "frame"]:
        """Estimates at the frames; the last one is the newest."""
        return self.mean[:-1]

    @property
    def rate(self) -> float:
        """Current rate, 1/s."""
        return float(self.mean[-1])

    def predict(self, duration: float) -> None:
        """Add the next frame, `duration` seconds later, predicted with the rate; the value at the first frame is
        zero."""
        size, self.seen = len(self.values), min(self.seen + 1, len(self.values))
        if self.seen == 1:
            return
        move = np.eye(size + 1, k=1)
        move[size - 1 :, size - 1 :] = [[1.0, duration], [0.0, 1.0]]
        self.mean = move @ self.mean
        self.covariance = move @ self.covariance @ move.T
        self.covariance[-2:, -2:] += random_walk_covariance(self._wander, duration)

    def decouple(self) -> None:
        """Drop the correlation with earlier frames: later measurements no longer correct them."""
        self.covariance = np.diag(np.diag(self.covariance) * (np.arange(len(self.mean)) >= len(self.mean) - 2))

    def add_relative_motion(self, back: int, difference: float, variance: float) -> None:
        """Correct by a measured difference between `back` frames ago and now; without effect if there was no such
        frame."""
        if 0 < back < self.seen:
            row = self._difference(back)
            self.update(row, difference - float(row @ self.mean), variance, gate=np.inf)

    def variance_since(self, back: int) -> float:
        """Return the variance of the difference between `back` frames ago and now."""
        return self.variance(self._difference(back))

    def _difference(self, back: int) -> Row:
        return self.row({-2: 1.0, -2 - back: -1.0})


def random_walk_covariance(wander: float, duration: float) -> Float[np.ndarray, "2 2"]:
    """Covariance of the change of a value and its rate if the rate is a random walk of `wander` per root second
    (Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 6.2.2)."""
    third, half = duration**3 / 3, duration**2 / 2
    return wander**2 * np.array([[third, half], [half, duration]])
