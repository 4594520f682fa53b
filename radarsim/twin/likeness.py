"""Similarity of heat maps: cell by cell for the same place, by correlation and MS-SSIM; or as sets from any places, by
statistics of their patches and the Fréchet distance.

Sets are compared as in the single-image form of the Fréchet inception distance (Shaham et al., "SinGAN", ICCV 2019):
patches are the samples, so that a single frame has a distribution, too. Features are levels and contrasts in dB instead
of a network's.
"""

import numpy as np
import scipy.linalg
import torch
from jaxtyping import Float

#: Size of a patch, rows and columns: 36 cm or 0.9 m/s by 12 deg at the radarize preset.
PATCH = (8, 8)
#: Quantiles of a patch's levels.
QUANTILES = (0.1, 0.5, 0.9)
#: Levels are clipped at this value, dB above a map's median.
DEPTH = 45.0
#: Weights of MS-SSIM's scales from fine to coarse, and side of its Gaussian window of 1.5 cells (Wang, Simoncelli and
#: Bovik, "Multiscale structural similarity for image quality assessment", Asilomar 2003). At the coarsest scale
#: maps are mirrored at their borders.
SCALES, WINDOW = (0.0448, 0.2856, 0.3001, 0.2363, 0.1333), 11


def foreground(maps: Float[np.ndarray, "frame row column"]) -> Float[np.ndarray, "frame row column"]:
    """Level above each map's median, 0...`DEPTH` dB: most cells of a room are empty, and their noise is not
    compared."""
    return np.clip(maps - np.median(maps, axis=(1, 2), keepdims=True), 0, DEPTH)


def correlation(
    one: Float[np.ndarray, "frame *cell"], other: Float[np.ndarray, "frame *cell"]
) -> Float[np.ndarray, "frame"]:
    """Pearson's correlation over the cells of each pair; NaN if either map is constant."""
    a, b = (np.asarray(maps, float).reshape(len(maps), -1) for maps in (one, other))
    a, b = (values - values.mean(axis=1, keepdims=True) for values in (a, b))
    scale = np.sqrt(np.sum(a**2, axis=1) * np.sum(b**2, axis=1))
    return np.where(scale > 0, np.sum(a * b, axis=1) / np.where(scale > 0, scale, 1), np.nan)


def similarity(
    one: Float[np.ndarray, "frame row column"], other: Float[np.ndarray, "frame row column"]
) -> Float[np.ndarray, "frame"]:
    """MS-SSIM of each pair of maps of 0...`DEPTH` dB, at as many of its five scales as the smaller side allows; NaN if
    it allows none."""
    from torchmetrics.functional.image import multiscale_structural_similarity_index_measure as ms_ssim

    side = min(one.shape[1:])
    scales = [n for n in range(2, len(SCALES) + 1) if side >> (n - 1) > WINDOW // 2]
    if not scales:
        return np.full(len(one), np.nan)
    weights = np.array(SCALES[: scales[-1]])
    first, second = (torch.as_tensor(np.asarray(maps, np.float32))[:, None] for maps in (one, other))
    found = [
        ms_ssim(
            first[k : k + 64], second[k : k + 64],
            sigma=1.5, data_range=DEPTH, betas=tuple(weights / weights.sum()), reduction="none", normalize="relu",
            kernel_size=1,  # of uniform windows; a Gaussian one's follows from sigma
        ).double().numpy()
        for k in range(0, len(one), 64)
    ]  # fmt: skip
    return np.concatenate(found)


def patch_statistics(maps: Float[np.ndarray, "frame row column"]) -> Float[np.ndarray, "frame patch 5"]:
    """Statistics of patches that overlap by half: quantiles of their levels relative to the map's mean, as networks get
    them (`radarize.learning.nets.maps.level`), and mean absolute steps between rows and between columns, dB.

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


def frechet_distance(one: Float[np.ndarray, "sample feature"], other: Float[np.ndarray, "another feature"]) -> float:
    """Fréchet distance of the normal distributions with two sets' means and covariances, in the features' unit:
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
