"""Antenna positions of the evaluation boards and their virtual array.

Sensor frame: x forward (boresight), y left, z up, origin at the (0, 0) of the board's layout (RX1; RX4 on the AOP).
The boards' files contain the layouts (`radarize.radar.boards`). Transmitters that fire simultaneously count as one at
their midpoint.
"""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from radarize.radar.boards import load_board
from radarize.radar.config import SPEED_OF_LIGHT, RadarConfig, fired, firing_name

#: Number of antennas of a full row; the velocity's covariance was fitted to rows of this length.
ROW = 8


def tx_positions(config: RadarConfig) -> Float[np.ndarray, "tx 3"]:
    """Positions of the enabled transmitters in the sensor frame, m, physical order."""
    return _positions(config, layout(config)[0])


def rx_positions(config: RadarConfig) -> Float[np.ndarray, "rx 3"]:
    """Positions of the enabled receivers in the sensor frame, m, physical order."""
    return _positions(config, layout(config)[1])


def layout(config: RadarConfig) -> tuple[Float[np.ndarray, "tx 2"], Float[np.ndarray, "rx 2"]]:
    """Positions (left, up) of the enabled transmitters and receivers, physical order, in half wavelengths at the
    board's design frequency."""
    board = load_board(config.board)
    tx, rx = np.asarray(board.tx, float), np.asarray(board.rx, float)
    return np.array([tx[list(fired(firing))].mean(axis=0) for firing in config.tx]), rx[list(config.rx)]


def _positions(config: RadarConfig, places: Float[np.ndarray, "antenna 2"]) -> Float[np.ndarray, "antenna 3"]:
    return np.column_stack([np.zeros(len(places)), _half(config) * places])


def virtual_positions(config: RadarConfig) -> Float[np.ndarray, "tx rx 3"]:
    """Sum of transmitter and receiver position per virtual antenna, m.

    An echo from unit direction u (far field) has the phase -2 pi / wavelength * (position . u) relative to the origin.
    """
    return tx_positions(config)[:, None] + rx_positions(config)[None]


def _half(config: RadarConfig) -> float:
    """Half a wavelength at the board's design frequency, m."""
    return SPEED_OF_LIGHT / load_board(config.board).design_frequency / 2


def _lattice(config: RadarConfig) -> Float[np.ndarray, "antenna 2"]:
    """Positions (left, up) of the virtual antennas, flat (tx, rx), in half wavelengths to three digits."""
    return np.round(virtual_positions(config).reshape(-1, 3)[:, 1:] / _half(config), 3)


def rows(config: RadarConfig) -> dict[float, Int[np.ndarray, "antenna"]]:
    """Virtual antennas of equal height, as flat (tx, rx) indices by ascending y; of coinciding ones, the first is kept.

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


def row_beside(heights: Iterable[float], height: float) -> float | None:
    """Height of the row used with the one at `height` to estimate elevation: the nearest less than a wavelength away,
    the upper one of two; None without one. Heights in half wavelengths."""
    others = sorted((h for h in heights if 0 < abs(h - height) < 2), key=lambda h: (abs(h - height), -h))
    return others[0] if others else None


def elevation_pairs(config: RadarConfig) -> Int[np.ndarray, "pair 2"] | None:
    """Pairs (lower, upper) of virtual antennas at the same y in neighbouring rows, less than a wavelength apart in z;
    None without such pairs.

    Averaging a pair steers to 0 deg elevation and, where it is half a wavelength high, nulls the zenith: the paper's
    elevation-aware beamforming (section 4).
    """
    grid, by_height, pairs = _lattice(config), rows(config), []
    heights = sorted(by_height)
    for height, above in pairwise(heights):
        if above - height >= 2:
            continue
        left_of_upper = {grid[u, 0]: u for u in by_height[above]}
        pairs += [(low, left_of_upper[grid[low, 0]]) for low in by_height[height] if grid[low, 0] in left_of_upper]
    return np.asarray(pairs) if pairs else None


def is_whole(config: RadarConfig) -> bool:
    """Whether the array resolves elevation and has a row of eight antennas, like the IWR1843's with all
    transmitters."""
    return elevation_pairs(config) is not None and len(azimuth_row(config)) >= ROW


def losses(config: RadarConfig) -> list[str]:
    """Losses by the firing order of the transmitters, a sentence each; empty if each fires once, alone."""
    found = []
    several = [firing for firing in config.tx_order if len(fired(firing)) > 1]
    if several:
        names = firing_name(several[0])
        found.append(
            f"{names} fire at once and count as one transmitter midway between them: their own directions are lost, of "
            f"{len(set().union(*map(fired, config.tx_order))) * len(config.rx)} virtual antennas "
            f"{len(np.unique(_lattice(config), axis=0))} are left, and echoes off the middle of their common beam are "
            "weaker or of reversed sign"
        )
    if len(set(config.tx_order)) < len(config.tx_order):
        found.append(
            f"transmitters fire {len(config.tx_order)} chirps a loop, some of them several: the first of each makes "
            f"the array, and the unambiguous speed is that of the loop, {config.max_velocity:.2f} m/s"
        )
    return found
