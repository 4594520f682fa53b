"""Network output with uncertainty: a normal distribution, trained by its likelihood."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

#: Logarithms of the limits of standard deviations: 1 mm/s (or mrad) to 50 m/s (or rad).
_LEAST, _MOST = math.log(1e-3), math.log(50.0)


@dataclass(frozen=True)
class Gaussian:
    """Normal distributions, one per item.

    Attributes:
        mean: (item, dimension).
        factor: (item, dimension, dimension), lower triangular with a positive diagonal: its square is the covariance.
    """

    mean: Float[Tensor, "item dimension"]
    factor: Float[Tensor, "item dimension dimension"]

    @staticmethod
    def numbers(dimensions: int) -> int:
        """Return how many numbers per item `of` needs."""
        return dimensions + dimensions * (dimensions + 1) // 2

    @classmethod
    def of(cls, numbers: Float[Tensor, "item number"], dimensions: int) -> "Gaussian":
        """Make distributions from unbounded numbers: means, logarithms of the factor's diagonal, entries below it."""
        mean, diagonal, below = numbers.split([dimensions, dimensions, dimensions * (dimensions - 1) // 2], dim=1)
        entries = torch.cat([diagonal.clamp(_LEAST, _MOST).exp(), below], dim=1)
        places = [(k, k) for k in range(dimensions)] + [(i, j) for i in range(dimensions) for j in range(i)]
        basis = numbers.new_zeros(len(places), dimensions, dimensions)
        for k, (row, column) in enumerate(places):
            basis[k, row, column] = 1
        return cls(mean, (entries @ basis.flatten(1)).reshape(-1, dimensions, dimensions))

    @property
    def covariance(self) -> Float[Tensor, "item dimension dimension"]:
        return self.factor @ self.factor.mT

    def errors_squared(self, truth: Float[Tensor, "item dimension"]) -> Float[Tensor, "item"]:
        """Return squared Mahalanobis distances; for consistent distributions their mean is the number of dimensions."""
        residual = (truth - self.mean)[..., None]
        return torch.linalg.solve_triangular(self.factor, residual, upper=False).square().sum(dim=(1, 2))

    def negative_log_likelihood(
        self, truth: Float[Tensor, "item dimension"], beta: float = 0.0
    ) -> Float[Tensor, "item"]:
        """Return the negative log-likelihood without its constant term.

        Args:
            truth: (item, dimension).
            beta: 0: likelihood; 1: the mean is trained as with squared errors. In between, items with large estimated
                variance keep some weight (Seitzer et al., "On the pitfalls of heteroscedastic uncertainty estimation
                with probabilistic neural networks", 2022, equation 6).
        """
        log_determinant = self.factor.diagonal(dim1=1, dim2=2).log().sum(dim=1)
        loss = 0.5 * self.errors_squared(truth) + log_determinant
        weight = (2 * beta / self.mean.shape[1] * log_determinant).exp().detach()
        return loss * weight
