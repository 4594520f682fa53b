"""The antenna element's gain pattern, the same for every transmitter and receiver."""

import numpy as np
from jaxtyping import Float
from numba import njit

#: IWR1843BOOST (SPRUIM4, figures of the radiation pattern): 10.5 dBi, -3 dB at 28 deg azimuth and 14 deg elevation,
#: -6 dB at 50 and 20 deg. Beyond the published points the fall continues at the same pace: an estimate.
PEAK_DBI = 10.5
AZIMUTH_DEG = np.array([0.0, 10.0, 20.0, 28.0, 40.0, 50.0, 60.0, 75.0, 90.0])
AZIMUTH_LOSS_DB = np.array([0.0, 0.4, 1.55, 3.0, 4.7, 6.0, 8.2, 13.0, 20.0])
ELEVATION_DEG = np.array([0.0, 5.0, 10.0, 14.0, 20.0, 30.0, 45.0, 60.0, 90.0])
ELEVATION_LOSS_DB = np.array([0.0, 0.4, 1.55, 3.0, 6.0, 11.0, 17.0, 22.0, 27.0])


def gain_tables() -> tuple[Float[np.ndarray, "181"], Float[np.ndarray, "181"]]:
    """Amplitude gain (square root of power gain) against |azimuth| and against |elevation| in steps of half a degree.

    The element's amplitude gain is the product of both; the peak gain is in the first.
    """
    degrees = np.linspace(0, 90, 181)
    azimuth = PEAK_DBI - np.interp(degrees, AZIMUTH_DEG, AZIMUTH_LOSS_DB)
    elevation = -np.interp(degrees, ELEVATION_DEG, ELEVATION_LOSS_DB)
    return 10 ** (azimuth / 20), 10 ** (elevation / 20)


@njit(inline="always")
def amplitude_gain(x, y, z, azimuth_table, elevation_table):
    """Amplitude gain towards the sensor-frame direction (x, y, z), not necessarily normalised; 0 behind the board."""
    if x <= 0.0:
        return 0.0
    azimuth = abs(np.arctan2(y, x)) * (360.0 / np.pi)
    elevation = abs(np.arctan2(z, np.hypot(x, y))) * (360.0 / np.pi)
    i, j = min(int(azimuth), 179), min(int(elevation), 179)
    a = azimuth_table[i] + (azimuth - i) * (azimuth_table[i + 1] - azimuth_table[i])
    b = elevation_table[j] + (elevation - j) * (elevation_table[j + 1] - elevation_table[j])
    return a * b
