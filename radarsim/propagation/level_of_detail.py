"""Level of detail: how many of a surface's scatterers stand for it, seen from where the sensor is.

A resolution cell grows with range, so fewer scatterers a square metre make the same speckle; and where the antenna
hardly looks (floor and ceiling near by), a few stand for many. So of the scatterers at distance r in a direction of
amplitude gain g a share p = `FULL_DETAIL` / r sqrt(g / g_peak) is used, which keeps the number in a cell as it is. Each
scatterer has a rank, drawn once, uniform in 0...1, and counts with the amplitude cos(pi rank / 4 p), zero from rank
2 p on, over the root of its mean square over all ranks. So mean power is that of all of them, whatever p, and a
scatterer comes and goes smoothly over a doubling of range: nothing pops, and speckle stays coherent along a walk
(changing p by dp costs a share of about (dp / p)^2 of the power: 0.25 % for 10 cm at 2 m).
"""

import numpy as np
from numba import njit

#: Distance up to which about all scatterers in the middle of the beam are used, m.
FULL_DETAIL = 0.9
#: Where the antenna does not look at all, mirrors may show a scatterer all the same: least share of the peak gain that
#: is reckoned with.
LEAST_GAIN = 0.05


@njit(inline="always")
def share(gain, distance):
    """Share of scatterers used at a distance (m) in a direction of amplitude gain (peak 1), straight."""
    return FULL_DETAIL / distance * np.sqrt(min(max(gain, LEAST_GAIN), 1.0))


@njit(inline="always")
def detail(rank, used):
    """Amplitude factor of a scatterer where a share is used; 1 for those of negative rank: they stand for themselves.

    Args:
        rank: 0...1, or negative.
        used: share of scatterers, as `share` gives it, may exceed 1.
    """
    if rank < 0.0:
        return 1.0
    if rank >= 2 * used:
        return 0.0
    mean_square = used
    if 2 * used > 1.0:
        mean_square = 0.5 + used / np.pi * np.sin(0.5 * np.pi / used)
    return np.cos(0.25 * np.pi * rank / used) / np.sqrt(mean_square)
