"""Polar images of RadarHD's data set: of an array of eight antennas, and of a lidar.

Prabhakara et al., "High resolution point clouds from mmWave radar", ICRA 2023, and the program that made its data set.
An image has 256 rows of range up to 10.8 m, and columns of azimuth from -90 to 90 deg, positive to the left: 64 for the
radar, 512 for the lidar. The measures of the paper use a Cartesian grid (`cartesian`).
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex128, Float, Float32, Int, Int16, UInt8
from scipy.fft import fft

from radarize.io.errors import InputError
from radarize.io.recording import Recording, Stream
from radarize.radar.config import RadarConfig

ROWS, COLUMNS, BEAMS = 256, 64, 512
#: m, of rows; rad, of the radar's and of the lidar's columns.
REACH = 10.8
RANGES = np.linspace(0, REACH, ROWS)
AZIMUTHS, BEAM_AZIMUTHS = (np.radians(np.linspace(-90, 90, columns)) for columns in (COLUMNS, BEAMS))
#: m: largest height of a lidar's points above or below the lidar.
SLAB = 0.3
#: Smallest magnitude that is kept, relative to the largest one beyond the first bins with the transmitters' leakage.
THRESHOLD, LEAKAGE = 0.05, 6
#: Transmitters of the pictures, as published: eight antennas in a row. The pictures themselves have the beam of four,
#: so one transmitter's: strong echoes of the 25 training walks fit it within 2.5 dB (median), and the beam of eight
#: within 8.3 dB (`benchmarks.realism`).
PUBLISHED, MEASURED = (0, 2), (0,)
#: m, half of the square of the points; rad, azimuths to either side that radar images keep.
_SQUARE, _FIELD = 10.0, np.radians(70)
#: Edges of the measures' grid, m: x ahead, y to the left.
GRID = np.linspace(0, REACH, 256), np.linspace(-REACH, REACH, 512)
#: Names of radar and lidar images in a recording.
PICTURE = "maps/picture"
LIDAR = Stream(
    (ROWS, BEAMS // 8), "u1", "",
    "cells of range (0...10.8 m) and azimuth (-90...90 deg, 512, packed) that hold points of a lidar",
)  # fmt: skip


class Cells(NamedTuple):
    """Cells of sine of azimuth (left first) and range within an image, and the image's pixels that they map to."""

    cell: Int[np.ndarray, "cell"]
    pixel: Int[np.ndarray, "cell"]


@cache
def cells(config: RadarConfig) -> Cells:
    """Cells of a radar's range bins up to the unambiguous range of complex samples, to the centimetre."""
    sine = np.linspace(1, -1, COLUMNS)[:, None]
    ranges = np.linspace(0, round(config.max_range, 2), config.samples)
    x, y = ranges * np.sqrt(1 - sine**2), ranges * sine
    distance, azimuth = np.sqrt(x**2 + y**2), np.arctan2(y, x)
    inside = (x > 0) & (x <= _SQUARE) & (np.abs(y) <= _SQUARE) & (distance <= REACH) & (np.abs(azimuth) <= _FIELD)
    inside[:, :LEAKAGE] = False
    row = np.searchsorted(RANGES, distance[inside])
    column = np.searchsorted(np.degrees(AZIMUTHS), np.degrees(azimuth[inside]))
    return Cells(np.flatnonzero(inside), row * COLUMNS + column)


def antennas(
    adc: Int16[np.ndarray, "frame loop tx rx sample 2"], config: RadarConfig, transmitters: Sequence[int] = PUBLISHED
) -> Complex128[np.ndarray, "frame antenna range"]:
    """Range spectra of the first loop, without windows: four receivers of each transmitter, in a row.

    Raises:
        InputError: a radar without these transmitters, or without four receivers.
    """
    if not set(transmitters) <= set(config.tx) or len(config.rx) != 4:
        wanted = " and ".join(f"TX{number + 1}" for number in transmitters)
        raise InputError(f"radar: tx {config.tx} and rx {config.rx}, expected {wanted} with four receivers")
    loop = adc[:, 0][:, [config.tx.index(number) for number in transmitters]].astype(float)
    return fft((loop[..., 0] + 1j * loop[..., 1]).reshape(len(adc), 4 * len(transmitters), -1), axis=2)


def pictures(
    adc: Int16[np.ndarray, "frame loop tx rx sample 2"], config: RadarConfig, transmitters: Sequence[int] = PUBLISHED
) -> UInt8[np.ndarray, "frame range azimuth"]:
    """Images of frames: decibels from the smallest (0) to the largest (255) that is kept; 0 in empty pixels.

    Args:
        adc: raw I/Q.
        config: radar configuration.
        transmitters: transmitters to use, see `PUBLISHED` and `MEASURED`.

    Raises:
        InputError: see `antennas`.
    """
    found = np.zeros((len(adc), ROWS * COLUMNS), np.uint8)
    inside = cells(config)
    for picture, heard in zip(found, antennas(adc, config, transmitters), strict=True):
        magnitude = np.abs(np.fft.fftshift(fft(heard, COLUMNS, axis=0), axes=0))
        kept = magnitude.ravel()[inside.cell] >= THRESHOLD * magnitude[:, LEAKAGE:].max()
        level = 10 * np.log10(np.maximum(magnitude.ravel()[inside.cell[kept]], 1e-30))
        if level.size and np.ptp(level) > 0:
            share = (level - level.min()) / np.ptp(level)
            np.maximum.at(picture, inside.pixel[kept], (share * 255).astype(np.uint8))
    return found.reshape(-1, ROWS, COLUMNS)


def pictured(recording: Recording) -> bool:
    """Whether a recording has a radar's images and no samples."""
    return not recording.has_samples and recording.has(PICTURE)


def power(pictures: UInt8[np.ndarray, "frame range azimuth"]) -> Float32[np.ndarray, "frame range azimuth"]:
    """Power of images relative to their strongest cell; grey values are linear in decibels, down to `THRESHOLD`."""
    share = pictures.astype(np.float32) / 255
    return np.where(pictures > 0, np.float32(THRESHOLD**2) ** (1 - share), np.float32(0))


def lidar_pixels(
    points: Float[np.ndarray, "point 3"],
) -> Int[np.ndarray, "pixel 2"]:
    """Rows and columns of a lidar's image that contain points (x forward, y left, z up, m) near its own height."""
    x, y, z = points.T
    inside = (x > 0) & (x <= _SQUARE) & (np.abs(y) <= _SQUARE) & (np.abs(z) <= SLAB)
    distance = np.linalg.norm(points, axis=1)
    inside &= distance <= REACH
    row = np.searchsorted(RANGES, distance[inside])
    column = np.searchsorted(np.degrees(BEAM_AZIMUTHS), np.degrees(np.arctan2(y, x)[inside]))
    return np.stack(np.unravel_index(np.unique(row * BEAMS + column), (ROWS, BEAMS)), axis=1)


def azimuths(columns: int) -> Float[np.ndarray, "column"]:
    """Azimuths of an image with any number of columns, rad."""
    return np.linspace(-np.pi / 2, np.pi / 2, columns)


def cartesian(picture: Bool[np.ndarray, "range azimuth"]) -> Float[np.ndarray, "point 2"]:
    """Points (x forward, y left, m) of an image with any number of columns, through the grid of the measures."""
    rows, columns = np.nonzero(picture)
    azimuth = azimuths(picture.shape[1])[columns]
    ranges = RANGES[rows]
    return gridded(np.stack([ranges * np.cos(azimuth), ranges * np.sin(azimuth)], axis=1))


def gridded(points: Float[np.ndarray, "point 2"]) -> Float[np.ndarray, "cell 2"]:
    """Cells of the measures' grid that contain points, as points (m)."""
    inside = (points[:, 0] >= 0) & (points[:, 0] <= REACH) & (np.abs(points[:, 1]) <= REACH)
    places = [np.searchsorted(axis, values) for axis, values in zip(GRID, points[inside].T, strict=True)]
    cells = np.unique(np.stack(places, axis=1), axis=0)
    return on_grid(tuple(cells.T))


def on_grid(cells: Sequence[Int[np.ndarray, "cell"]]) -> Float[np.ndarray, "cell 2"]:
    """Convert rows and columns of cells of the measures' grid to points (m)."""
    return np.stack([axis[index] for axis, index in zip(GRID, cells, strict=True)], axis=1)
