"""Elastic bands: smooth a shortest path on a grid to a path that a person would take.

After S. Quinlan and O. Khatib, "Elastic bands: connecting path planning and control", ICRA 1993: the line contracts,
and the clearance map pushes it away from obstacles.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from radarsim.world.clearance import Clearance

STEP = 0.025  # m between points of a line
SLACK = 0.03  # m of clearance that a line may lose against its path
_SPARE = 0.35  # m beyond the required clearance within which obstacles push
_ROUNDS = 60
_WIDE, _NARROW = 0.7, 0.12  # m, smoothing length of the first and the last round


def relax(
    path: Float[np.ndarray, "n 2"], clearance: Clearance, radius: float, pins: Sequence[int] = ()
) -> Float[np.ndarray, "m 2"]:
    """Smooth a path, with its ends fixed.

    Args:
        path: path with clearance of at least `radius`, m.
        clearance: clearance map of the carrier.
        radius: clearance to keep, reduced by at most `SLACK`, m.
        pins: indices of points in `path` that the line passes through.

    Returns:
        Points of the line, about `STEP` apart.
    """
    line, marks, places = _resample(path), _lengths(path)[list(pins)], path[list(pins)]
    marks = marks / max(_lengths(path)[-1], 1e-9)
    for sigma in np.geomspace(_WIDE, _NARROW, _ROUNDS):
        line = _smooth(line, sigma)
        near = np.clip(radius + _SPARE - clearance.at(line), 0, _SPARE)
        # Towards the ends, which stay, there is no push.
        along = _lengths(line)
        free = 1 - np.exp(-((np.minimum(along, along[-1] - along) / 0.4) ** 2))
        # Points move by at most a tenth of the smoothing length, so that lines do not jump between the walls of a
        # doorway.
        line = line + (0.3 * free * np.minimum(near, 0.3 * sigma))[:, None] * clearance.uphill(line)
        line, marks = _pinned(line, marks, places)
        line = _resample(line)
    if clearance.at(line).min() >= radius - SLACK:
        return line
    return _rounded(path, clearance, radius)


def _rounded(path: Float[np.ndarray, "n 2"], clearance: Clearance, radius: float) -> Float[np.ndarray, "m 2"]:
    """Round off a path as far as its clearance allows."""
    dense = _resample(path)
    for sigma in 0.3 * 0.8 ** np.arange(7):
        line = _smooth(dense, sigma)
        if clearance.at(line).min() >= radius - SLACK:
            break
    return line


def _smooth(line: Float[np.ndarray, "n 2"], sigma: float) -> Float[np.ndarray, "n 2"]:
    """Smooth a line by a Gaussian of `sigma` m along it, at most a quarter of its length. Odd reflection at the ends
    keeps them fixed."""
    sigma = min(sigma, STEP * (len(line) - 1) / 4)
    pad = int(4 * sigma / STEP)
    padded = np.pad(line, ((pad, pad), (0, 0)), mode="reflect", reflect_type="odd")
    return ndimage.gaussian_filter1d(padded, sigma / STEP, axis=0)[pad : pad + len(line)]


def _pinned(line, marks, places):
    """Bend a line through its pins; return it and the pins' positions as fractions of its length."""
    if not len(places):
        return line, marks
    along = _lengths(line)
    at = np.searchsorted(along, marks * along[-1]).clip(1, len(line) - 2)
    for i, place in zip(at, places, strict=True):
        # Bends reach at most to the neighbouring pins.
        others = np.abs(along[np.setdiff1d(at, i)] - along[i]).min(initial=1.2)
        bend = np.exp(-((3 * (along - along[i]) / max(others, 4 * STEP)) ** 2))
        line = line + bend[:, None] * (place - line[i])
    along = _lengths(line)
    return line, along[at] / along[-1]


def _lengths(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n"]:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def _resample(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    along = _lengths(points)
    even = np.linspace(0, along[-1], max(8, int(np.ceil(along[-1] / STEP)) + 1))
    return np.column_stack([np.interp(even, along, points[:, k]) for k in range(2)])
