"""What is known of a few numbers that come and go, and of which sums are measured: a Kalman filter."""

import numpy as np
from jaxtyping import Float

Row = Float[np.ndarray, "number"]

#: Squared Mahalanobis distance from which on a measurement counts less.
_FAR = 9.0


class Gaussian:
    """Mean and covariance of numbers; sums of them are rows of weights.

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

    def update(self, row: Row, innovation: float, variance: float) -> None:
        """A sum was measured to be larger than expected by an innovation; one that is too far off for its variance
        counts as if with the noise that makes it just likely."""
        spread = self.covariance @ row
        total = max(float(row @ spread) + variance, innovation**2 / _FAR)
        self.mean = self.mean + innovation / total * spread
        self.covariance = self.covariance - np.outer(spread, spread / total)
        self.shared = self.shared - spread / total * (row @ self.shared)
