"""Level of detail: the fraction of a surface's scatterers that is used, depending on distance and antenna gain.

A resolution cell grows with range, so fewer scatterers per square metre give the same speckle; at low antenna gain
(floor and ceiling nearby), a few are enough, too. So of the scatterers at distance r in a direction of amplitude gain g
a fraction p = `FULL_DETAIL` / r sqrt(g / g_peak) is used, which keeps the number in a cell constant. Each scatterer has
a rank, drawn once, uniform in 0...1, and is weighted by the amplitude cos(pi rank / 4 p), zero from rank 2 p on, over
its RMS over all ranks. So the mean power is that of all scatterers for any p, and a scatterer fades in and out smoothly
over a doubling of range: speckle stays coherent along a walk (a change of p by dp decorrelates a fraction of about (dp
/ p)^2 of the power: 0.25 % for 10 cm at 2 m).
"""

import numpy as np
from numba import njit

#: Distance up to which almost all scatterers in the middle of the beam are used, m.
FULL_DETAIL = 0.9
#: Smallest fraction of the peak gain assumed: scatterers outside of the beam may be visible over mirrors.
LEAST_GAIN = 0.05


@njit(inline="always")
def share(gain, distance):
    """Fraction of scatterers used at a distance (m) in a direction of amplitude gain (peak 1), on a direct path."""
    return FULL_DETAIL / distance * np.sqrt(min(max(gain, LEAST_GAIN), 1.0))


@njit(inline="always")
def detail(rank, used):
    """Amplitude factor of a scatterer if a fraction is used; 1 for negative ranks, which represent only themselves.

    Args:
        rank: 0...1, or negative.
        used: fraction of scatterers, from `share`, may exceed 1.
    """
    if rank < 0.0:
        return 1.0
    if rank >= 2 * used:
        return 0.0
    mean_square = used
    if 2 * used > 1.0:
        mean_square = 0.5 + used / np.pi * np.sin(0.5 * np.pi / used)
    return np.cos(0.25 * np.pi * rank / used) / np.sqrt(mean_square)
