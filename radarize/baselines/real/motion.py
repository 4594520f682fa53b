"""Turns, trajectories and maps of real walks, from a radar's pictures and from scans that methods make of them.

The reference is the lidar beside the radar: its poses, and its points at these poses as the map.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from radarize.baselines.pictures.odometry import PictureRates
from radarize.baselines.scan_matching.odometry import ScanMatching
from radarize.baselines.walks.poses import BEARINGS, at, stamps
from radarize.baselines.walks.walks import PERIOD
from radarize.evaluation.mapping import agreement
from radarize.evaluation.metrics import TrajectoryErrors, evaluate_trajectory
from radarize.io.alignment import trajectory
from radarize.io.errors import InputError
from radarize.io.pose import between, compose, transform, wrap
from radarize.io.tum import planar_poses
from radarize.odometry.uncertainty import ErrorModel
from radarize.pipeline.method import Inputs, Weights
from radarize.radar.presets import PRESETS
from radarize.signal import polar
from radarize.signal.batch import Batch, Signal
from radarize.slam.backend import Slam
from radarize.slam.config import SlamConfig
from radarize.slam.grid import OccupancyGrid

#: Frames over which turns are measured: 0.2 s.
SPAN = 4
#: Frames, standard deviation: turns are smoothed over 0.3 s. Chosen on walks 112, 113 and 120, where it takes the error
#: from 1.01, 0.93, 0.83 to 0.74, 0.73, 0.59 deg; more gains little.
SMOOTH = 6
#: Columns by which pictures are shifted against each other at most: 57 deg/s.
_MOST = 4
#: Errors of the odometry that SLAM is given: of a step's length and m per step; rad per step and as a bias, rad/s. A
#: cart's wheel odometry as the lidar logs have it.
_STEP, _YAW, _BIAS = (0.05, 0.001), np.radians(0.1), np.radians(0.3)
#: Of the back end: that for radar scans.
_CONFIG = SlamConfig.preset("radar")
#: m: cells of the lidar's map, how many frames must have seen one, and the distances at which maps agree.
_CELL, _SEEN, NEAR = 0.05, 3, (0.1, 0.2)


def turn_errors(found: Float[np.ndarray, "frame"], poses: Float[np.ndarray, "frame 3"]) -> dict[str, float]:
    """Of turns over `SPAN` frames up to each frame (nan: none), rad: RMSE in degrees, and how large turns are."""
    true = np.full(len(poses), np.nan)
    true[SPAN:] = wrap(poses[SPAN:, 2] - poses[:-SPAN, 2])
    known = np.isfinite(found) & np.isfinite(true)
    error = np.degrees(wrap(found - true)[known])
    return {
        "yaw_rmse_deg": float(np.sqrt(np.mean(error**2))),
        "yaw_median_deg": float(np.median(np.abs(error))),
        "turns_rms_deg": float(np.sqrt(np.mean(np.degrees(true[known]) ** 2))),
    }


def shifted_turns(pictures: UInt8[np.ndarray, "frame range azimuth"]) -> Float[np.ndarray, "frame"]:
    """Turns by shifting pictures against each other over azimuth: the place of the largest correlation, between
    columns by a parabola."""
    size = 2 * polar.COLUMNS
    spectra = np.fft.rfft(pictures.astype(np.float32), size, axis=2)
    found = np.full(len(pictures), np.nan)
    shifts = np.arange(-_MOST, _MOST + 1)
    for frame in range(SPAN, len(pictures)):
        both = np.fft.irfft((spectra[frame - SPAN] * spectra[frame].conj()).sum(axis=0), size)[shifts]
        best = int(both.argmax())
        if 0 < best < len(shifts) - 1:
            before, at, after = both[best - 1 : best + 2]
            best += (before - after) / (2 * (before - 2 * at + after) or 1.0)
        found[frame] = (best - _MOST) * (polar.AZIMUTHS[1] - polar.AZIMUTHS[0])
    return found


def smoothed(turns: Float[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
    """Turns averaged over neighbouring frames: rigs turn more smoothly than the estimates of their turns. Where a frame
    has none (nan) its neighbours are, and it stays without."""
    known = np.isfinite(turns)
    weights = gaussian_filter1d(known.astype(float), SMOOTH)
    averaged = gaussian_filter1d(np.where(known, turns, 0.0), SMOOTH) / np.maximum(weights, 1e-9)
    return np.where(known, averaged, np.nan)


def disturbed(
    poses: Float[np.ndarray, "frame 3"], seed: int
) -> tuple[Float[np.ndarray, "frame 3"], Float[np.ndarray, "frame 3 3"]]:
    """Poses as an odometry with errors would have added them up, and the covariance of each step.

    Covariances know of each step alone: a bias counts as an error that is new every second.
    """
    rng = np.random.default_rng(seed)
    steps = between(poses[:-1], poses[1:])
    deviation = _STEP[0] * np.hypot(steps[:, 0], steps[:, 1]) + _STEP[1]
    steps[:, :2] += rng.normal(size=(len(steps), 2)) * deviation[:, None]
    steps[:, 2] += rng.normal(0, _YAW, len(steps)) + PERIOD * rng.normal(0, _BIAS)
    found = [poses[0]]
    for step in steps:
        found.append(compose(found[-1], step))
    covariance = np.zeros((len(poses), 3, 3))
    covariance[1:, 0, 0] = covariance[1:, 1, 1] = deviation**2
    covariance[1:, 2, 2] = _YAW**2 + _BIAS**2 * PERIOD
    return np.array(found), covariance


def followed(
    ranges: Float[np.ndarray, "frame bearing"], rates: Float[np.ndarray, "frame 2"] | None
) -> tuple[Float[np.ndarray, "frame 3"], ErrorModel]:
    """Poses by matching scans alone, and the errors of their steps.

    Args:
        ranges: scans on `BEARINGS`, m.
        rates: of turning, rad/s, and their variances, as a network tells them; nan: not known.
    """
    batch = Batch(Signal(PRESETS["radarhd"]), None, stamps(len(ranges)))
    told = None if rates is None else lambda batch: rates
    batch.ranges = np.where(np.isnan(ranges), np.inf, ranges)
    matching = ScanMatching(rates=told, bearings=BEARINGS)
    track = matching.update(batch)
    return track.pose, track.errors


def network_rates(weights: Weights, pictures: UInt8[np.ndarray, "frame range azimuth"]) -> Float[np.ndarray, "frame 2"]:
    """Rates of turning over `SPAN` frames (rad/s) and their variances by a network that was trained in simulation; nan:
    not known."""
    inputs, times = Inputs(PRESETS["radarhd"], weights=weights), stamps(len(pictures))
    network, found = PictureRates(inputs), np.empty((len(pictures), 2))
    if round(network.span / PERIOD) != SPAN:
        raise InputError(f"picture-turns: is of frames {network.span:g} s apart, expected {SPAN * PERIOD:g} s")
    for start in range(0, len(pictures), 64):
        some = slice(start, start + 64)
        found[some] = network.rates(Batch(inputs.signal, None, times[some], maps={"picture": pictures[some]}))
    return found


def mapped(
    ranges: Float[np.ndarray, "frame bearing"],
    poses: Float[np.ndarray, "frame 3"],
    surface: Float[np.ndarray, "point 2"],
    odometry: Float[np.ndarray, "frame 3"],
    errors: ErrorModel | Float[np.ndarray, "frame 3 3"],
) -> dict[str, float]:
    """SLAM with scans: error of its trajectory, and its map against the lidar's.

    Args:
        ranges: scans on `BEARINGS`, m; nan: not known.
        poses: true ones.
        surface: of the lidar's map, m, in the frame of the poses.
        odometry: that SLAM is given.
        errors: of its steps, or their covariances.
    """
    slam = Slam(_CONFIG)
    for frame in range(len(ranges)):
        slam.add_odometry(PERIOD * frame, odometry[frame], errors[frame])
        slam.add_scan(PERIOD * frame, BEARINGS, ranges[frame])
    slam.finish()
    times, found = slam.trajectory()
    turn, shift = _alignment(found, at(times, stamps(len(poses)), poses))
    return {
        "ate_m": float(_compared(times, found, poses).position.mean),
        **map_agreement(slam.map(), turn, shift, surface),
    }


def drift(odometry: Float[np.ndarray, "frame 3"], poses: Float[np.ndarray, "frame 3"]) -> float:
    """ATE of an odometry, m."""
    return float(_compared(stamps(len(poses)), odometry, poses).position.mean)


def surface_of(
    clouds: Sequence[Float[np.ndarray, "point 2"]], poses: Float[np.ndarray, "frame 3"]
) -> Float[np.ndarray, "cell 2"]:
    """The lidar's map: middles of the cells that it has points in from several frames, m."""
    touched = [
        np.unique(np.floor(transform(pose, cloud) / _CELL).astype(int), axis=0)
        for pose, cloud in zip(poses, clouds, strict=True)
    ]
    cells, count = np.unique(np.concatenate(touched), axis=0, return_counts=True)
    return (cells[count >= _SEEN] + 0.5) * _CELL


def map_agreement(
    grid: OccupancyGrid, turn: float, shift: Float[np.ndarray, "2"], surface: Float[np.ndarray, "point 2"]
) -> dict[str, float]:
    """Share of occupied cells near the surface (precision), of the surface near occupied cells (recall), and F1.

    Args:
        grid: map.
        turn, shift: rad, m; from its frame to that of the surface.
        surface: of the lidar's map, m.
    """
    row, column = np.nonzero(grid.probability > 0.5)
    cells = transform(np.array([*shift, turn]), grid.origin + (np.column_stack([column, row]) + 0.5) * grid.resolution)
    off_surface = cKDTree(surface).query(cells)[0]
    off_map = cKDTree(cells).query(surface)[0]  # far from a map without cells
    found = {}
    for near in NEAR:
        for name, value in agreement(off_surface, off_map, near).items():
            found[f"map_{name}_{100 * near:.0f}cm"] = float(value)
    return found


def _alignment(
    found: Float[np.ndarray, "scan 3"], true: Float[np.ndarray, "scan 3"]
) -> tuple[float, Float[np.ndarray, "2"]]:
    """Turn (rad) and shift (m) from one frame to the other, by headings: who stands has no positions to tell it."""
    apart = true[:, 2] - found[:, 2]
    turn = float(np.arctan2(np.sin(apart).mean(), np.cos(apart).mean()))
    return turn, true[:, :2].mean(axis=0) - transform(np.array([0.0, 0.0, turn]), found[:, :2]).mean(axis=0)


def _compared(
    times: Float[np.ndarray, "scan"], found: Float[np.ndarray, "scan 3"], poses: Float[np.ndarray, "frame 3"]
) -> TrajectoryErrors:
    reference = trajectory(stamps(len(poses)), planar_poses(poses))
    return evaluate_trajectory(trajectory(times, planar_poses(found)), reference)
