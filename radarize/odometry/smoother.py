"""Kalman filters of numbers that come and go, and fixed-lag smoother of a number at the last frames."""

import numpy as np
from jaxtyping import Float

Row = Float[np.ndarray, "number"]

#: Squared Mahalanobis distance from which on a measurement counts less.
_FAR = 9.0


class Gaussian:
    """Mean and covariance of numbers, of which sums are measured; sums are rows of weights.

    Args:
        variances: of the first numbers, which are zero and independent.

    Attributes:
        mean, covariance: of all.
        shared: covariance of the errors of all with that of one as it was, see `remember`.
    """

    def __init__(self, variances: Row):
        self.mean, self.covariance = np.zeros(len(variances)), np.diag(np.asarray(variances, float))
        self.shared = np.zeros(len(variances))

    def remember(self, place: int) -> None:
        """From here on, keep in `shared` what errors have in common with the one that a number has now."""
        self.shared = self.covariance[place].copy()

    def row(self, weights: dict[int, float]) -> Row:
        """Of a sum of some of the numbers, by their places."""
        row = np.zeros(len(self.mean))
        row[list(weights)] = list(weights.values())
        return row

    def variance(self, row: Row) -> float:
        """Of a sum."""
        return float(row @ self.covariance @ row)

    def replace(self, place: int, row: Row) -> None:
        """A number becomes a sum of all."""
        self.mean[place] = row @ self.mean
        spread = self.covariance @ row
        own = row @ spread
        self.covariance[place], self.covariance[:, place] = spread, spread
        self.covariance[place, place] = own
        self.shared[place] = row @ self.shared

    def add(self, place: int, row: Row, offset: float, variance: float) -> None:
        """A new number before the one at a place: a sum, an offset, and noise."""
        spread = self.covariance @ row
        own = row @ spread + variance
        self.mean = np.insert(self.mean, place, row @ self.mean + offset)
        self.covariance = np.insert(
            np.insert(self.covariance, place, spread, 0), place, np.insert(spread, place, own), 1
        )
        self.shared = np.insert(self.shared, place, row @ self.shared)

    def keep(self, places: list[int]) -> None:
        """Forget all other numbers."""
        self.mean, self.covariance = self.mean[places], self.covariance[np.ix_(places, places)]
        self.shared = self.shared[places]

    def update(self, row: Row, innovation: float, variance: float, far: float = _FAR) -> None:
        """A sum was measured to be larger than expected by an innovation; one that is too far off for its variance
        counts as if with the noise that makes it just likely."""
        spread = self.covariance @ row
        total = max(float(row @ spread) + variance, innovation**2 / far)
        self.mean = self.mean + innovation / total * spread
        self.covariance = self.covariance - np.outer(spread, spread / total)
        self.shared = self.shared - spread / total * (row @ self.shared)


class FixedLagSmoother(Gaussian):
    """A number (a yaw, a coordinate) at the last frames, oldest first, and its rate: a relative motion between two of
    the frames corrects all of them.

    Sums of relative motions of one spacing would drift apart. Frames may come at any times.

    Args:
        size: frames.
        wander: per second^1.5, by how much the rate wanders in a second.
        fastest: per second, standard deviation of the rate before anything is known.

    Attributes:
        seen: frames so far, at most all.
    """

    def __init__(self, size: int, wander: float, fastest: float):
        super().__init__(np.append(np.zeros(size), fastest**2))
        self._wander, self.seen = wander, 0

    @property
    def values(self) -> Float[np.ndarray, "frame"]:
        """Of the frames; the newest is the answer."""
        return self.mean[:-1]

    @property
    def rate(self) -> float:
        """Per second, now."""
        return float(self.mean[-1])

    def predict(self, duration: float) -> None:
        """The next frame, `duration` seconds later, to which the value has gone on at its rate; the first is zero."""
        size, self.seen = len(self.values), min(self.seen + 1, len(self.values))
        if self.seen == 1:
            return
        move = np.eye(size + 1, k=1)
        move[size - 1 :, size - 1 :] = [[1.0, duration], [0.0, 1.0]]
        self.mean = move @ self.mean
        self.covariance = move @ self.covariance @ move.T
        self.covariance[-2:, -2:] += random_walk_covariance(self._wander, duration)

    def decouple(self) -> None:
        """What follows tells no more of what was, nor of how the value came to be what it is."""
        self.covariance = np.diag(np.diag(self.covariance) * (np.arange(len(self.mean)) >= len(self.mean) - 2))

    def add_relative_motion(self, back: int, difference: float, variance: float) -> None:
        """Correct by a measured difference from `back` frames ago to now; none if there was no such frame."""
        if 0 < back < self.seen:
            row = self._difference(back)
            self.update(row, difference - float(row @ self.mean), variance, far=np.inf)

    def variance_since(self, back: int) -> float:
        """Variance of the difference from `back` frames ago to now."""
        return self.variance(self._difference(back))

    def _difference(self, back: int) -> Row:
        return self.row({-2: 1.0, -2 - back: -1.0})


def random_walk_covariance(wander: float, duration: float) -> Float[np.ndarray, "2 2"]:
    """Covariance of what a value and its rate have changed by, if the rate is a random walk of `wander` per root second
    (Bar-Shalom, Li and Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 6.2.2).
    """
    third, half = duration**3 / 3, duration**2 / 2
    return wander**2 * np.array([[third, half], [half, duration]])
