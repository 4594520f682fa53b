"""Antenna positions of the evaluation boards and the virtual array that they span.

Sensor frame: x forward (boresight), y left, z up, origin at the (0, 0) of the board's layout (RX1; RX4 on the AOP).
The layouts stand in the boards' files (`radarize.radar.boards`).
"""

import numpy as np
from jaxtyping import Float, Int

from radarize.radar.boards import load_board
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig

#: Antennas of a row that is not short; what velocities claim was fitted to rows of these.
ROW = 8


def tx_positions(config: RadarConfig) -> Float[np.ndarray, "tx 3"]:
    """Positions of the enabled transmitters in the sensor frame, m, physical order."""
    return _positions(config, load_board(config.board).tx, config.tx)


def rx_positions(config: RadarConfig) -> Float[np.ndarray, "rx 3"]:
    """Positions of the enabled receivers in the sensor frame, m, physical order."""
    return _positions(config, load_board(config.board).rx, config.rx)


def _positions(config: RadarConfig, layout: tuple, enabled: tuple[int, ...]) -> Float[np.ndarray, "antenna 3"]:
    positions = np.zeros((len(enabled), 3))
    positions[:, 1:] = _half(config) * np.asarray(layout, float)[list(enabled)]
    return positions


def virtual_positions(config: RadarConfig) -> Float[np.ndarray, "tx rx 3"]:
    """Sum of transmitter and receiver position per virtual antenna, m.

    An echo from unit direction u (far field) has the phase -2 pi / wavelength * (position . u) relative to the origin.
    """
    return tx_positions(config)[:, None] + rx_positions(config)[None]


def _half(config: RadarConfig) -> float:
    """Half a wavelength at the board's design frequency, m."""
    return SPEED_OF_LIGHT / load_board(config.board).design_frequency / 2


def _lattice(config: RadarConfig) -> Int[np.ndarray, "antenna 2"]:
    """Left and up of the virtual antennas, flat (tx, rx), in half wavelengths."""
    return np.rint(virtual_positions(config).reshape(-1, 3)[:, 1:] / _half(config)).astype(int)


def rows(config: RadarConfig) -> dict[float, Int[np.ndarray, "antenna"]]:
    """Virtual antennas of equal height, as flat (tx, rx) indices by ascending y; where two coincide, the first stays.

    Returns a dictionary from height (half wavelengths, ascending) to indices.
    """
    grid, result = _lattice(config), {}
    for height in np.unique(grid[:, 1]):
        members = np.flatnonzero(grid[:, 1] == height)
        _, first = np.unique(grid[members, 0], return_index=True)
        result[float(height)] = members[first]
    return result


def azimuth_row(config: RadarConfig) -> Int[np.ndarray, "antenna"]:
    """Flat (tx, rx) indices of the longest horizontal line of virtual antennas, by ascending y."""
    return max(rows(config).values(), key=len)


def elevation_pairs(config: RadarConfig) -> Int[np.ndarray, "pair 2"] | None:
    """Pairs (lower, upper) of virtual antennas at the same y, half a wavelength apart in z; None without such pairs.

    Averaging a pair steers to 0 deg elevation and nulls the zenith: the paper's elevation-aware beamforming (section
    4).
    """
    grid, by_height, pairs = _lattice(config), rows(config), []
    for height, lower in by_height.items():
        upper = by_height.get(height + 1.0, ())
        left_of_upper = {grid[u, 0]: u for u in upper}
        pairs += [(low, left_of_upper[grid[low, 0]]) for low in lower if grid[low, 0] in left_of_upper]
    return np.asarray(pairs) if pairs else None


def is_whole(config: RadarConfig) -> bool:
    """Whether the array tells elevation and has a row of eight antennas, as the IWR1843's with all transmitters."""
    return elevation_pairs(config) is not None and len(azimuth_row(config)) >= ROW
