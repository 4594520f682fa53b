"""How alike two sets of heat maps are, whatever places they show: statistics of their patches, and Fréchet's distance.

As in the single-image form of the Fréchet inception distance (Shaham et al., "SinGAN", ICCV 2019), patches are the
samples, so that a single frame has a distribution too; their features are not a network's but what a reader of heat
maps looks at: levels and contrasts, in dB.
"""

import numpy as np
import scipy.linalg
from jaxtyping import Float

#: Cells of a patch, rows and columns: 36 cm or 0.9 m/s by 12 deg at the radarize preset.
PATCH = (8, 8)
#: Quantiles of a patch's levels.
QUANTILES = (0.1, 0.5, 0.9)


def patch_statistics(maps: Float[np.ndarray, "frame row column"]) -> Float[np.ndarray, "frame patch 5"]:
    """What patches that overlap by half look like: quantiles of their levels about the map's mean, as the networks see
    them (`radarize.nets.maps.level`), and mean absolute steps from row to row and from column to column, dB.

    Args:
        maps: dB, at least `PATCH` large.
    """
    maps = np.asarray(maps, float)
    maps = maps - maps.mean(axis=(1, 2), keepdims=True)
    windows = np.lib.stride_tricks.sliding_window_view(maps, PATCH, axis=(1, 2))
    windows = windows[:, :: PATCH[0] // 2, :: PATCH[1] // 2]
    windows = windows.reshape(len(maps), -1, *PATCH)
    quantiles = np.quantile(windows, QUANTILES, axis=(2, 3))
    steps = [np.abs(np.diff(windows, axis=axis)).mean(axis=(2, 3)) for axis in (2, 3)]
    return np.stack([*quantiles, *steps], axis=-1)


def frechet_distance(one: Float[np.ndarray, "sample feature"], other: Float[np.ndarray, "sample feature"]) -> float:
    """Fréchet's distance of the normal distributions with two sets' means and covariances, in the features' unit:
    d^2 = |m1 - m2|^2 + tr(S1 + S2 - 2 (S1^1/2 S2 S1^1/2)^1/2) (Dowson and Landau, J. Multivariate Anal. 12, 1982).
    """
    apart = one.mean(axis=0) - other.mean(axis=0)
    first, second = (np.atleast_2d(np.cov(samples, rowvar=False, bias=True)) for samples in (one, other))
    root = _root(first)
    shared = np.linalg.eigvalsh(root @ second @ root)
    overlap = np.sqrt(np.maximum(shared, 0)).sum()
    return float(np.sqrt(max(apart @ apart + np.trace(first) + np.trace(second) - 2 * overlap, 0.0)))


def _root(covariance: np.ndarray) -> np.ndarray:
    values, vectors = scipy.linalg.eigh(covariance)
    return (vectors * np.sqrt(np.maximum(values, 0))) @ vectors.T
