"""Estimate of receiver noise from the samples of a recording."""

import numpy as np
from jaxtyping import Complex, Float

from radarize.radar.windows import periodic


def noise_profile(signal: Complex[np.ndarray, "frame loop tx rx sample"]) -> Float[np.ndarray, "sample"]:
    """Estimate the noise power per sample from each range bin, counts^2; for white noise, the same in every bin.

    The median over fast Doppler bins is robust to a few movers; for exponential noise power it is ln 2 of the mean.
    """
    loops, n = signal.shape[1], signal.shape[-1]
    slow, fast = periodic(np.hanning, loops), periodic(np.hanning, n)
    cube = np.fft.fft(np.fft.fft(signal * fast, axis=-1) * slow[:, None, None, None], axis=1)
    cube = cube[:, loops // 4 : loops - loops // 4 + 1]
    power = np.abs(cube) ** 2 / (np.sum(slow**2) * np.sum(fast**2))
    return np.median(power.reshape(-1, n), axis=0) / np.log(2)


def noise_floor(profile: Float[np.ndarray, "sample"]) -> float:
    """Noise power of a sample, counts^2: the profile's level away from leakage and band edge."""
    n = len(profile)
    return float(np.median(profile[n // 10 : 8 * n // 10]))
