"""Panoramic depth images of a radar's sparse points: the input of milliEgo."""

import numpy as np
from jaxtyping import Float, Int

from radarize.baselines.milliego.network import COLUMNS, ROWS
from radarize.io.recording import Recording
from radarize.signal.heatmaps import Heatmaps
from radarize.signal.points import DENSE, PointClouds

#: Half the field of view in azimuth and in elevation, rad.
_ASIDE, _UP = np.radians(60.0), np.radians(45.0)
#: Range of a depth of 1, m.
_FAR = 5.0
#: Rows and columns on either side of a point that it covers.
_SPOT = (1, 2)
_BATCH = 32


def panoramas(
    points: Float[np.ndarray, "point 6"], frame: Int[np.ndarray, "point"], frames: int
) -> Float[np.ndarray, "frame row column"]:
    """Render depth images of point clouds (`PointClouds`): the nearest point of each pixel, 0 without points.

    Returns:
        Depth over 5 m, at most 1; rows from top to bottom, columns from right to left.
    """
    depth = np.linalg.norm(points[:, :3], axis=1)
    row = np.floor(ROWS * (0.5 - np.arcsin(points[:, 2] / np.maximum(depth, 1e-9)) / (2 * _UP))).astype(int)
    column = np.floor(COLUMNS * (0.5 + np.arctan2(points[:, 1], points[:, 0]) / (2 * _ASIDE))).astype(int)
    image = np.full((frames, ROWS, COLUMNS), np.inf, np.float32)
    for down in range(-_SPOT[0], _SPOT[0] + 1):
        for left in range(-_SPOT[1], _SPOT[1] + 1):
            r, c = row + down, column + left
            inside = (r >= 0) & (r < ROWS) & (c >= 0) & (c < COLUMNS)
            place = (frame[inside], r[inside], c[inside])
            np.minimum.at(image, place, (depth[inside] / _FAR).astype(np.float32))
    return np.where(np.isfinite(image), np.minimum(image, 1), 0)


def seen(recording: Recording, frames: slice) -> Float[np.ndarray, "frame row column"]:
    """Render panoramas of a recording's frames.

    Raises:
        InputError: the recording has no samples.
    """
    heatmaps, clouds = Heatmaps(recording.config), PointClouds(recording.config, DENSE)
    wanted = range(*frames.indices(len(recording)))
    found = []
    for first in range(wanted.start, wanted.stop, _BATCH * wanted.step):
        last = min(first + _BATCH * wanted.step, wanted.stop)
        adc, valid = (read(first, last)[:: wanted.step] for read in (recording.adc, recording.valid))
        found.append(panoramas(*clouds.of(heatmaps, heatmaps.spectrum(adc, valid)), len(adc)).astype(np.float16))
    return np.concatenate(found)
